"""Whether an estimator's covariances tell the truth: normalised errors and innovations, and their chi-square bands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtri, stdtrit

from analysis.models.algebra import sum_over
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.elementary import whole_power

DRAWN = 0.95  # how probable the bands of pictures are
BATCHES = 10
_WINDOW = 5.0  # correlation times over which correlations are summed
_SINGULAR = 1e-12  # of the trace: a smallest eigenvalue below this is what rounding leaves of nothing


class Normalised(NamedTuple):
    """The mean over the edges of a swarm, shape (...), NaN where there are none, and how many there are, shape (...)."""

    mean: Array
    number: Integers


def of_errors(estimate: Array, true: Array, covariance: Array, known: Mask) -> Normalised:
    """NEES of the edges of a swarm.

    Parameters
    ----------
    estimate, true
        Relative positions, shape (..., N, n, D), in metres.
    covariance
        Upper triangles of the covariances, shape (..., N, n, D (D + 1) / 2), in square metres.
    known
        Which edges are estimated, shape (..., N, n).
    """
    normalised = np.zeros(known.shape)
    normalised[known] = nees((estimate - true)[known], covariance[known])  # LAPACK is not asked of padding
    return _averaged(normalised, known)


def of_innovations(nis: Array, seen: Mask) -> Normalised:
    """NIS of a swarm, from that of its edges; NaN where the filter of one has diverged.

    Parameters
    ----------
    nis
        Innovations squared, normalised by their covariances, shape (..., N, n).
    seen
        Which edges were measured, shape (..., N, n).
    """
    return _averaged(nis, seen)


def band(level: float, dimension: int, number: ArrayLike) -> tuple[Array, Array]:
    """Between which values the mean of independent normalised errors lies with a probability, each of shape (...).

    Parameters
    ----------
    level
        The probability.
    dimension
        Degrees of freedom of each.
    number
        How many are averaged, shape (...).
    """
    averaged = np.asarray(number)
    low, high = (chdtri(dimension * averaged, tail) / averaged for tail in ((1.0 + level) / 2, (1.0 - level) / 2))
    return low, high


class Averaged(NamedTuple):
    """The mean of a series, half its confidence interval, and the means of its batches, shape (BATCHES,)."""

    mean: float
    half: float
    batches: Array


def averaged(series: Array, level: float) -> Averaged:
    """The mean of a series of correlated values, by batch means with Student's t (Law, Simulation Modeling, section 9.5).

    Ticks of a filter are correlated, and edges share their noise: batches longer than what correlates them are as good as
    independent, and what they differ by says how much the mean is worth.

    Parameters
    ----------
    series
        Shape (T,), of at least 2 BATCHES values.
    level
        The probability that the interval has the mean in it.
    """
    starts = np.arange(BATCHES) * len(series) // BATCHES
    lengths = np.diff(np.append(starts, len(series)))
    batches = np.add.reduceat(series, starts) / lengths
    spread = np.sqrt(whole_power(batches - batches.mean(), 2).sum() / (BATCHES - 1))
    half = stdtrit(BATCHES - 1, (1.0 + level) / 2) * spread / np.sqrt(BATCHES)
    return Averaged(float(series.mean()), float(half), batches)


def correlation_time(series: Array) -> float:
    """Over how many values of a series its fluctuations last: 1 of independent ones (integrated, with Sokal's window).

    Parameters
    ----------
    series
        Shape (T,). That of a series not much longer than this is found too short.

    References
    ----------
    Sokal, "Monte Carlo methods in statistical mechanics", section 3, 1996.
    """
    off = series - series.mean()
    power = whole_power(np.abs(np.fft.rfft(off, 2 * len(off))), 2)
    covariance = np.fft.irfft(power)[: len(off)]
    if covariance[0] <= 0.0:
        return 1.0
    times = 2.0 * np.cumsum(covariance / covariance[0]) - 1.0
    enough = np.arange(len(off)) >= _WINDOW * times
    return float(max(1.0, times[int(np.argmax(enough)) if enough.any() else -1]))


def nees(error: Array, covariance: Array) -> Array:
    """Normalised estimation errors squared, e^T P^-1 e, shape (...); infinite where P is singular, NaN where it is no number.

    Parameters
    ----------
    error
        Shape (..., D).
    covariance
        Upper triangles of their covariances, shape (..., D (D + 1) / 2).
    """
    matrix = whole(covariance)
    return _normalised(error, matrix, _smallest(matrix))


def whole(triangles: Array) -> Array:
    """Symmetric matrices (..., D, D) from their upper triangles, row by row, shape (..., D (D + 1) / 2)."""
    dimension = int(np.sqrt(2 * triangles.shape[-1]))
    matrices = np.empty((*triangles.shape[:-1], dimension, dimension))
    rows, columns = np.triu_indices(dimension)
    matrices[..., rows, columns] = matrices[..., columns, rows] = triangles
    return matrices


def _normalised(error: Array, covariance: Array, smallest: Array) -> Array:
    """e^T P^-1 e, shape (...), of covariances with these smallest eigenvalues (...)."""
    singular = smallest <= _SINGULAR * np.trace(covariance, axis1=-2, axis2=-1)
    regular = ~(singular | np.isnan(smallest))
    solvable = np.where(regular[..., None, None], covariance, np.eye(error.shape[-1]))
    length = (error * np.linalg.solve(solvable, error[..., None])[..., 0]).sum(axis=-1)
    return np.where(singular, np.inf, np.where(regular, length, np.nan))


def _smallest(matrix: Array) -> Array:
    """The smallest eigenvalues of symmetric matrices, NaN where they are no numbers: LAPACK would raise."""
    finite = np.asarray(np.isfinite(matrix).all(axis=(-2, -1)))
    smallest = np.linalg.eigvalsh(np.where(finite[..., None, None], matrix, 0.0))[..., 0]
    return np.where(finite, smallest, np.nan)


def _averaged(normalised: Array, counted: Mask) -> Normalised:
    number = counted.sum(axis=(-2, -1))
    total = sum_over(np.where(counted, normalised, 0.0), (-2, -1))
    return Normalised(np.where(number > 0, total / np.maximum(number, 1), np.nan), number)
