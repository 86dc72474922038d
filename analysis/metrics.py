"""How well a swarm does."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def tracking_error(position: Array, target: Array, present: NDArray[np.bool_]) -> Array:
    """Mean squared distance to the target over the agents present, in square metres (paper 000, eq. 15).

    Parameters
    ----------
    position, target
        Shape (..., N, D), in metres.
    present
        Agents that take part, shape (..., N); departed and dead agents leave the mean.

    Returns
    -------
    Array
        Shape (...); NaN where nobody is present.
    """
    squared = ((position - target) ** 2).sum(axis=-1)
    number = present.sum(axis=-1)
    total = np.where(present, squared, 0.0).sum(axis=-1)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
