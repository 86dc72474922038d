"""A target that is driven by noise, and detectors that find it with a latency (paper 002, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis import jets

Array = NDArray[np.float64]

# What estimators of a target report: position and derivatives to steer for, shape (m + 1, D), the position found by oneself,
# (D,), the variance of the former per axis, and one's own information and that found together, with m derivatives, (m + 1, C).
REPORTS = frozenset({"reference", "found", "variance", "information", "fused"})


class Sighting(NamedTuple):
    """What detectors say in a tick.

    Parameters
    ----------
    position
        Of the target, when the detection began, shape (..., D), in metres; of no meaning where none is done.
    done
        Whether a detection is done in this tick, shape (...).
    by
        Which method found it, shape (...).
    method
        Which the detector uses from now on, shape (...).
    """

    position: Array
    done: NDArray[np.bool_]
    by: NDArray[np.int64]
    method: NDArray[np.int64]


@dataclass(frozen=True)
class Target:
    """What is pursued, and how it can be found; all axes are alike and independent.

    Parameters
    ----------
    order
        m: how often what drives it is integrated to a position.
    intensity
        W of the Wiener process that drives it, per axis, in m2/s^(2m - 1).
    latencies
        How long each method of detection takes, shape (M,), in ticks.
    variances
        Of a position that it finds, per axis, shape (M,), in square metres.
    """

    order: int
    intensity: float
    latencies: NDArray[np.int64]
    variances: Array


def transition(order: int, seconds: Array) -> Array:
    """A_d: how position and derivatives go on undisturbed for times (...), shape (..., m, m) (4)."""
    steps = np.arange(order)[None, :] - np.arange(order)[:, None]
    forward = np.maximum(steps, 0)
    factorials = np.array([float(factorial(step)) for step in range(order)])
    powers = np.asarray(seconds)[..., None, None] ** forward / factorials[forward]
    return np.where(steps >= 0, powers, 0.0)


def diffusion(order: int, seconds: Array, intensity: float) -> Array:
    """W_d: the covariance of what noise has done to them after times (...), shape (..., m, m) (4)."""
    lower = order - 1 - np.arange(order)
    exponent = lower[:, None] + lower[None, :] + 1
    scale = np.array([float(factorial(step)) for step in range(order)])[lower]
    spread: Array = (
        intensity * np.asarray(seconds)[..., None, None] ** exponent / (exponent * scale[:, None] * scale[None, :])
    )
    return spread


def numbers(order: int, dimension: int) -> int:
    """How many different numbers information matrix and vectors have."""
    return order * (order + 1) // 2 + order * dimension


def packed(Q: Array, y: Array) -> Array:
    """The different numbers of symmetric matrices (..., m, m) and of vectors (..., m, D), shape (..., C)."""
    rows, columns = np.triu_indices(Q.shape[-1])
    return np.concatenate([Q[..., rows, columns], y.reshape(*y.shape[:-2], -1)], axis=-1)


def unpacked(information: Array, dimension: int, order: int) -> tuple[Array, Array]:
    """Information matrices (..., m, m) and vectors (..., m, D) from their different numbers (..., C)."""
    rows, columns = np.triu_indices(order)
    Q = np.zeros((*information.shape[:-1], order, order))
    Q[..., rows, columns] = Q[..., columns, rows] = information[..., : len(rows)]
    return Q, information[..., len(rows) :].reshape(*information.shape[:-1], order, dimension)


def position(information: Array, dimension: int, order: int) -> Array:
    """The position that information (..., C) stands for (8), shape (..., D), in metres."""
    Q, y = unpacked(information, dimension, order)
    return np.asarray(np.linalg.solve(Q, y)[..., 0, :], dtype=np.float64)


def position_jet(Q: Array, y: Array) -> Array:
    """The position and its derivatives that jets of information stand for (Algorithm 1, lemma 1).

    Parameters
    ----------
    Q, y
        Information matrices (m + 1, ..., m, m) and vectors (m + 1, ..., m, D).

    Returns
    -------
    Shape (m + 1, ..., D), in metres, metres per second ...
    """
    found: Array = jets.times(jets.inverse(Q), y)[..., 0, :]
    return found
