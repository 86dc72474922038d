"""Constant delay in whole ticks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def due(tick: int, delay_ticks: NDArray[np.int64], least: int) -> NDArray[np.int64]:
    """The tick in whose exchange a message offered in `tick` arrives.

    Parameters
    ----------
    tick
        When it was offered.
    delay_ticks
        One way, shape (L,); 0 arrives in the same exchange.
    least
        Ticks that every message takes at least: 0 for the papers' synchronous exchange, 1 for `next-tick`.

    Returns
    -------
    NDArray[int]
        Shape (L,).
    """
    arrival: NDArray[np.int64] = tick + np.maximum(delay_ticks, least)
    return arrival
