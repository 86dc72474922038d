"""The arrays that everything is said in: float64, int64 and truth, of any shape."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Mask = NDArray[np.bool_]


def chosen(which: Mask, one: Any, other: Any) -> Any:
    """Array `one` where `which` (batch axes) is true, the other (batch axes, *) elsewhere; `one` may be a number.

    Of nested tuples, array by array.
    """
    if isinstance(other, tuple):
        parts = (chosen(which, *both) for both in zip(one, other, strict=True))
        return type(other)(*parts) if hasattr(other, "_fields") else tuple(parts)
    return np.where(which.reshape(which.shape + (1,) * (other.ndim - which.ndim)), one, other)
