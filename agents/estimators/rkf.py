"""Relative Kalman filtering (paper 000, Algorithm 1): one filter an edge, which coasts when the edge is not measured.

Each filter starts at zero with a wide prior, so the first measurement sets it; before that, its edge is not known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import kalman
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.reports import NIS


class Tracks(NamedTuple):
    """The edge filters: mean (..., n, S), covariance (..., n, S, S), `nis`, and whether ever corrected, both (..., n)."""

    mean: Array
    covariance: Array
    nis: Array
    known: Mask


@dataclass(frozen=True)
class EdgeFilters:
    """A filter for every edge: constant acceleration (19)-(21), or another model of its motion.

    Parameters
    ----------
    sigma_w
        Standard deviation of the noise that drives the model: of the acceleration, in metres per second squared; with a random
        walk of the velocity, in metres per second.
    prior_position
        Standard deviation of a relative position before the first measurement, in metres.
    prior_velocity
        Of a relative velocity, in metres per second, where the model has one.
    prior_acceleration
        Of a relative acceleration, in metres per second squared, where the model has one.
    model
        How a relative position moves (`kalman.motion`).
    """

    sigma_w: float = 0.5
    prior_position: float = 10.0
    prior_velocity: float = 2.0
    prior_acceleration: float = 1.0
    model: kalman.Model = "constant-acceleration"

    def __post_init__(self) -> None:
        priors = {name: getattr(self, name) for name in ("prior_position", "prior_velocity", "prior_acceleration")}
        refuse_negative(sigma_w=self.sigma_w, **priors)

    def unknown(self, brief: Brief, batch: tuple[int, ...]) -> Tracks:
        """All edges unknown."""
        shape = (*batch, brief.relative.shape[-2])
        deviations = (self.prior_position, self.prior_velocity, self.prior_acceleration)
        filters = kalman.unknown(shape, brief.dimension, deviations[: kalman.ORDER[self.model]])
        return Tracks(*filters, np.full(shape, np.nan), np.zeros(shape, dtype=bool))

    def ahead(self, brief: Brief, tracks: Tracks) -> tuple[Array, Array]:
        """Mean and covariance of all filters one tick ahead."""
        F, Q = kalman.motion(self.model, brief.dt, self.sigma_w)
        return kalman.predict(tracks.mean, tracks.covariance, F, Q)

    def coasted(self, brief: Brief, tracks: Tracks, ticks: Integers) -> Tracks:
        """All filters after so many ticks without a measurement, shape (...)."""
        of_edges = np.broadcast_to(ticks[..., None], tracks.known.shape)
        F, Q = kalman.motion(self.model, brief.dt, self.sigma_w)
        mean, covariance = kalman.coasted(tracks.mean, tracks.covariance, F, Q, of_edges)
        return tracks._replace(mean=mean, covariance=covariance)

    def estimate(self, brief: Brief, tracks: Tracks, psi: Array) -> Estimate:
        """What the filters say."""
        dimension = brief.dimension
        moves = kalman.ORDER[self.model] > 1
        return Estimate(
            relative=tracks.mean[..., :dimension],
            known=tracks.known,
            covariance=tracks.covariance[..., :dimension, :dimension],
            psi=psi,
            relative_velocity=tracks.mean[..., dimension : 2 * dimension] if moves else None,
            reports={NIS: tracks.nis},
        )


@dataclass(frozen=True)
class RelativeKalmanFilter(EdgeFilters, Estimator[Tracks]):
    """RKF: correct the edges that are measured, propagate the others."""

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing: a neighbour's measurements of others say nothing of this edge."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Tracks:
        """All edges unknown."""
        return self.unknown(brief, batch)

    def missed(self, brief: Brief, state: Tracks, gap: Gap) -> Tracks:
        """Every edge coasts."""
        return self.coasted(brief, state, gap.ticks)

    def sense(self, brief: Brief, state: Tracks, measured: Array, seen: Mask) -> tuple[Tracks, Mapping[str, Fields]]:
        """Predict every edge, correct those measured."""
        F, Q = kalman.motion(self.model, brief.dt, self.sigma_w)
        R = self._weight(brief, state, measured)
        return Tracks(*kalman.tracked(*state[:2], F, Q, measured, R, seen), state.known | seen), {}

    def fuse(
        self,
        brief: Brief,
        state: Tracks,
        heard: Mapping[str, Heard],  # noqa: ARG002
        own: Own,  # noqa: ARG002
    ) -> tuple[Tracks, Estimate]:
        """The filters' positions."""
        return state, self.estimate(brief, state, no_indicator(state.known))

    def _weight(self, brief: Brief, state: Tracks, measured: Array) -> Array:
        if brief.sensor.is_even:  # then it does not hang on what is predicted
            return brief.sensor.common
        mean, covariance = self.ahead(brief, state)
        D = brief.dimension
        return brief.sensor.weight(measured, mean[..., :D], covariance[..., :D, :D])
