"""The edge Kalman filter (paper 001, (5a)-(5g); paper 004, Algorithms 5 and 8): an edge moves as the inputs of its ends say.

A neighbour says what it flew from the tick before. Where that is lost, an autoregressive model predicts it from what was heard
earlier, and (6.3) widens the covariance, with the dt^2 that the printed algorithms leave out.

Of a sensor that says directions alone, the first one puts an edge at its nominal distance; from then on how far it is follows
from how its direction changes while both ends fly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import inputs, kalman
from agents.algebra.blocks import diagonal_blocks
from agents.algebra.geometry import identity
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.reports import NIS
from netem.core.channels import INPUT


class EdgeStates(NamedTuple):
    """The filters: mean (..., n, D), covariance (..., n, D, D), the neighbours' inputs, what is measured, and was ever."""

    mean: Array
    covariance: Array
    flown: inputs.NeighbourInputs
    measured: Array
    seen: Mask
    met: Mask


@dataclass(frozen=True)
class EdgeKalmanFilter(Estimator[EdgeStates]):
    """One filter an edge, predicted by communicated inputs.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres; that of an edge is twice as uncertain (5b).
    coefficients
        Of the autoregressive model for inputs that are not heard (6.5), the latest first: 1 holds the last, none takes
        the neighbour for at rest.
    sigma_n
        Standard deviation of what drives that model, per axis, in metres per second.
    """

    prior_position: float = 1.0
    coefficients: Sequence[float] = (1.0,)
    sigma_n: float = 0.0

    def __post_init__(self) -> None:
        refuse_negative(prior_position=self.prior_position, sigma_n=self.sigma_n)
        inputs.refuse_growing(self.coefficients)

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing beyond the inputs that every agent broadcasts."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> EdgeStates:
        """Everybody at the same place, as far as is known (5a)."""
        shape = (*batch, brief.relative.shape[-2])
        prior = 2.0 * self.prior_position * self.prior_position * identity(brief.dimension)
        return EdgeStates(
            mean=np.zeros((*shape, brief.dimension)),
            covariance=np.broadcast_to(prior, (*shape, *prior.shape)).copy(),
            flown=inputs.at_rest(shape, brief.dimension, len(self.coefficients)),
            measured=np.zeros((*shape, brief.dimension)),
            seen=np.zeros(shape, dtype=bool),
            met=np.zeros(shape, dtype=bool),
        )

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: EdgeStates,
        measured: Array,
        seen: Mask,
    ) -> tuple[EdgeStates, Mapping[str, Fields]]:
        """Keep the measurements until it is known how the edges have moved."""
        return state._replace(measured=measured, seen=seen), {}

    def fuse(
        self, brief: Brief, state: EdgeStates, heard: Mapping[str, Heard], own: Own
    ) -> tuple[EdgeStates, Estimate]:
        """Predict every edge by the inputs (5c)-(5d), and correct those measured (5e)-(5g)."""
        flown = inputs.hear(state.flown, heard[INPUT], self.coefficients, self.sigma_n)
        theirs, doubt = flown.last
        mean = state.mean + brief.dt * (own.velocity[..., None, :] - theirs)
        covariance = state.covariance + of_edges(brief) + brief.dt * brief.dt * doubt
        if not brief.sensor.says_positions:
            nominal = np.linalg.norm(brief.relative, axis=-1, keepdims=True) * state.measured
            mean = np.where((state.seen & ~state.met)[..., None], nominal, mean)
        observed = brief.sensor.observed(state.measured, mean, covariance)
        mean, covariance, nis = kalman.correct(mean, covariance, *observed, state.seen)
        known = np.broadcast_to(brief.present, state.seen.shape)
        estimate = Estimate(mean, known, covariance, no_indicator(state.seen), reports={NIS: nis})
        met = state.met | state.seen
        return state._replace(mean=mean, covariance=covariance, flown=flown, met=met), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether inputs are heard in the tick they are of."""
        return inputs.in_time(swarm)


def of_edges(brief: Brief) -> Array:
    """Q_ij = B_ij^T Q B_ij of every edge by itself, shape (..., n, D, D): the diagonal blocks of the agent's."""
    return diagonal_blocks(brief.process, brief.dimension)
