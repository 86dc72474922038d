"""Information of a target: matrices Q (..., m, m) and vectors y (..., m, D), one for each axis, and what they stand for.

All axes share their matrix. As messages and reports they are packed: their C different numbers (..., C).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from analysis.models import jets
from analysis.models.arrays import Array

# What estimators of a target report: position and derivatives to steer for, shape (m + 1, D), the position found by oneself,
# (D,), the variance of the former per axis, and one's own information and that found together, with m derivatives, (m + 1, C).
_REPORTS = frozenset({"reference", "found", "variance", "information", "fused"})


def reported(names: Iterable[str]) -> bool:
    """Whether reports of these names are those of a target."""
    return _REPORTS.issubset(names)


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
