"""Closed loops, one tick at a time: each is a linear system per axis, and settles when the radius of its step is below one."""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np

from analysis.models.arrays import Array
from analysis.models.elementary import log, whole_power


def radius(matrix: Array) -> float:
    """Spectral radius."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def settling_time(radius: float, dt: float) -> str:
    """How long what has this radius, below 1, takes to settle, in words; `dt` is the tick, in seconds."""
    return f"settles to 1/e in {f'{-dt / log(radius):.2f} s' if radius > 0.0 else 'one tick'}"


def chain_step(gains: Sequence[float], dt: float) -> Array:
    """One tick of a body of order m that is drawn to a place and its derivatives, shape (m, m).

    Parameters
    ----------
    gains
        On what it is off in position, velocity and so on, m of them; its input is held for the tick.
    dt
        Tick, in seconds.
    """
    order = len(gains)
    taylor = np.array([whole_power(dt, power) / factorial(power) for power in range(order + 1)])
    free = sum((taylor[power] * np.eye(order, k=power) for power in range(order)), start=np.zeros((order, order)))
    return np.asarray(free - np.outer(taylor[:0:-1], gains), dtype=np.float64)


def stretch_eigenvalue(places: Array) -> float:
    """The largest eigenvalue of sum_j p_ij p_ij^T over all pairs of places (N, D), in square metres.

    Near their distances, places that the gradient of `hold_distances` draws together come closer by 2 gain times this a second.
    """
    agents, dimension = places.shape
    apart = places[:, None] - places[None]
    outer = apart[..., :, None] * apart[..., None, :]
    blocks = np.eye(agents)[:, :, None, None] * outer.sum(axis=1)[:, None] - outer
    return float(np.linalg.eigvalsh(np.swapaxes(blocks, 1, 2).reshape(agents * dimension, -1))[-1])
