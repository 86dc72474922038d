"""Products and sums of arrays whose bits do not depend on how the arrays lie in memory.

NumPy hands a product to BLAS or to a loop of its own, and adds in one order or another, by the strides of the arrays. Those of
a row alone and of the same row in a batch may differ, be it only after an index or a moved axis.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Array


def product(*factors: NDArray[Any]) -> Array:
    """The matrix product of stacks of matrices (..., r, s), (..., s, t) ..., from left to right."""
    return reduce(np.matmul, (np.ascontiguousarray(factor) for factor in factors))


def sum_over(array: NDArray[Any], axis: int | tuple[int, ...]) -> Array:
    """The sum over one or more of the last axes."""
    summed: Array = np.ascontiguousarray(array).sum(axis=axis)
    return summed
