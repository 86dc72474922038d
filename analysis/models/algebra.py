"""Products and sums of arrays whose bits do not depend on how the arrays lie in memory.

NumPy hands a product to BLAS or to a loop of its own, and adds in one order or another, by the strides of the arrays. Those of
a row alone and of the same row in a batch may differ, be it only after an index or a moved axis.
"""

from __future__ import annotations

from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array

_SMALL = 12


def product(*factors: NDArray[Any]) -> Array:
    """The matrix product of stacks of matrices (..., r, s), (..., s, t) ..., from left to right."""
    return reduce(_multiplied, (np.ascontiguousarray(factor) for factor in factors))


def _multiplied(one: NDArray[Any], other: NDArray[Any]) -> Array:
    """By a kernel where matrices are small: a call into BLAS would be mostly preparation."""
    small = one.ndim > 1 and other.ndim > 1 and max(*one.shape[-2:], other.shape[-1]) <= _SMALL
    if small and one.dtype == other.dtype == np.float64:
        multiplied: Array = _small(one, other)
        return multiplied
    return np.matmul(one, other)


@kernel("(r,s),(s,t)->(r,t)", "dd->d")
def _small() -> Plain:
    def plain(one: Array, other: Array, multiplied: Array) -> None:
        for row in range(len(one)):
            for column in range(other.shape[1]):
                multiplied[row, column] = 0.0
            for between in range(len(other)):
                for column in range(other.shape[1]):
                    multiplied[row, column] += one[row, between] * other[between, column]

    return plain


def sum_over(array: NDArray[Any], axis: int | tuple[int, ...]) -> Array:
    """The sum over one or more of the last axes."""
    summed: Array = np.ascontiguousarray(array).sum(axis=axis)
    return summed
