"""The MMSE filter (paper 004, Algorithm 4, with the sign of (4.21) put right): the last estimate is the prior of the next."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import kalman
from agents.algebra.geometry import identity
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from analysis.models.arrays import Array, Mask
from analysis.models.reports import NIS


class Recent(NamedTuple):
    """The estimates, shape (..., n, D), their covariances, shape (..., n, D, D), and `nis`, shape (..., n)."""

    mean: Array
    covariance: Array
    nis: Array


@dataclass(frozen=True)
class MinimumMeanSquareError(Estimator[Recent]):
    """Each tick's measurement, drawn toward the last estimate, which begins at zero; an edge not measured stays as it was.

    Parameters
    ----------
    sigma_prior
        Standard deviation of the prior about the last estimate, per axis, in metres.
    """

    sigma_prior: float = 0.1

    def __post_init__(self) -> None:
        refuse_negative(sigma_prior=self.sigma_prior)

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Recent:
        """Everybody at the same place."""
        square = (*batch, brief.relative.shape[-2], brief.dimension, brief.dimension)
        prior = np.broadcast_to(self._prior(brief), square).copy()
        return Recent(np.zeros(square[:-1]), prior, np.full(square[:-2], np.nan))

    def sense(self, brief: Brief, state: Recent, measured: Array, seen: Mask) -> tuple[Recent, Mapping[str, Fields]]:
        """Correct the last estimates (4.20)."""
        prior = np.broadcast_to(self._prior(brief), state.covariance.shape)
        R = brief.sensor.weight(measured, state.mean, prior)
        return Recent(*kalman.correct(state.mean, prior, measured, R, seen)), {}

    def fuse(
        self,
        brief: Brief,
        state: Recent,
        heard: Mapping[str, Heard],  # noqa: ARG002
        own: Own,  # noqa: ARG002
    ) -> tuple[Recent, Estimate]:
        """The estimates."""
        known = np.broadcast_to(brief.present, state.mean.shape[:-1])
        return state, Estimate(state.mean, known, state.covariance, no_indicator(known), reports={NIS: state.nis})

    def _prior(self, brief: Brief) -> Array:
        return self.sigma_prior * self.sigma_prior * identity(brief.dimension)
