"""Nested lists of a scenario as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from affinet.scenario.units import Matrix
from affinet.scenario.wrong import ScenarioError


def covariance(
    section: str, sigma: float | None, given: Matrix | None, dimension: int
) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The covariance in a section, or that of a standard deviation on each axis, shape (D, D), in square metres.

    Parameters
    ----------
    section
        Which says it.
    sigma
        The standard deviation, in metres; None is 0.
    given
        The covariance, in square metres, where it is said in full.
    dimension
        D.

    Raises
    ------
    ScenarioError
        When it is no covariance of this dimension.
    """
    if given is None:
        return float(sigma or 0.0) ** 2 * np.eye(dimension)
    matrix = array(f"{section}.covariance", given, (dimension, dimension))
    if (matrix != matrix.T).any() or np.linalg.eigvalsh(matrix)[0] <= 0:
        raise ScenarioError(f"{section}.covariance: must be symmetric and positive definite, in m2")
    return matrix


def array(key: str, rows: Sequence[Any], shape: tuple[int, ...]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Nested lists as an array of this shape.

    Raises
    ------
    ScenarioError
        When they have another.
    """
    try:
        values = np.array(rows, dtype=np.float64)
    except ValueError:
        values = np.empty(0)
    if values.shape != shape:
        raise ScenarioError(f"{key}: must be {' x '.join(map(str, shape))} numbers")
    return values
