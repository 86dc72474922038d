"""What an agent believes of its neighbours."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Mask
from analysis.models.small import triangle


class Estimate(NamedTuple):
    """What an agent believes of its neighbours.

    Parameters
    ----------
    relative
        Relative positions zhat_ij of z_ij = z_i - z_j, where the agent is from its neighbour, shape (..., n, D), in metres; 0
        where not known.
    known
        Where there is an estimate at all, shape (..., n).
    covariance
        Of the relative positions, shape (..., n, D, D), in square metres; of no meaning where not known.
    psi
        Convergence indicator (paper 000, eq. 16), shape (...), in square units of Theta; NaN where undefined.
    relative_velocity
        Estimated relative velocities, shape (..., n, D), in metres per second, by estimators that track them.
    feasible
        Whether the neighbours seen in this tick determine a local map, shape (...), by estimators that fit one.
    reports
        What else an estimator has to say, for recordings, metrics and control laws: named arrays, each of one shape (..., *).
    """

    relative: Array
    known: Mask
    covariance: Array
    psi: Array
    relative_velocity: Array | None = None
    feasible: Mask | None = None
    reports: Mapping[str, Array] = MappingProxyType({})

    @property
    def spread(self) -> Array:
        """Upper triangles of the covariances, row by row, shape (..., n, D (D + 1) / 2); 0 where not known."""
        return np.where(self.known[..., None], triangle(self.covariance), 0.0)


def no_edges(slots: Mask, dimension: int, reports: Mapping[str, Array]) -> Estimate:
    """What an agent has to say that estimates no relative position in any of its slots, (..., n)."""
    relative = np.zeros((*slots.shape, dimension))
    covariance = np.zeros((*slots.shape, dimension, dimension))
    return Estimate(relative, np.zeros_like(slots), covariance, no_indicator(slots), reports=reports)


def no_indicator(known: Mask) -> Array:
    """The psi of an estimator that has none: NaN, shape (...)."""
    return np.full(known.shape[:-1], np.nan)
