"""Whether an estimator's covariances tell the truth: normalised errors and their chi-square bands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

Array = NDArray[np.float64]


def nees(error: Array, covariance: Array) -> Array:
    """Normalised estimation errors squared, e^T P^-1 e, shape (...); infinite where P is singular.

    Parameters
    ----------
    error
        Shape (..., D).
    covariance
        Upper triangles of their covariances, shape (..., D (D + 1) / 2).
    """
    dimension = error.shape[-1]
    whole = np.zeros((*error.shape, dimension))
    rows, columns = np.triu_indices(dimension)
    whole[..., rows, columns] = whole[..., columns, rows] = covariance
    singular = np.linalg.det(whole) == 0.0
    solved = np.linalg.solve(np.where(singular[..., None, None], np.eye(dimension), whole), error[..., None])[..., 0]
    return np.where(singular, np.inf, (error * solved).sum(axis=-1))


def band(level: float, dimension: int, number: int) -> tuple[float, float]:
    """Between which values the mean of independent normalised errors lies with a probability.

    Parameters
    ----------
    level
        The probability.
    dimension
        Degrees of freedom of each.
    number
        How many are averaged.
    """
    upper_tails = np.array([(1.0 + level) / 2, (1.0 - level) / 2])
    low, high = chdtri(dimension * number, upper_tails) / number
    return float(low), float(high)
