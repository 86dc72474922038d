"""The edge filter without communication (paper 004, Algorithm 9): how an edge moved tells what the neighbour flew.

From two estimates of an edge in a row and the agent's own input follows what its neighbour flew between them (6.13), with a
covariance that grows with 1 / dt^2 (6.14); a Wiener predictor for a first-order process carries it one tick on (6.17), in its
general form: for inputs of variance R_u(0), W = R_u(1) (R_u(0) + Sigma_u)^-1, with the error that this leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import inputs, kalman
from agents.algebra.geometry import identity
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.estimators.edge_kf import of_edges
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.reports import NIS
from analysis.models.small import inverse
from netem.core.channels import INPUT


class Past(NamedTuple):
    """Estimates of the edges in the last ticks, newest first, and what the agent flew after each.

    Means (..., m + 1, n, D), covariances (..., m + 1, n, D, D), own inputs (..., m + 1, D), and how many there are, (...).
    """

    mean: Array
    covariance: Array
    input: Array
    length: Array


class Silent(NamedTuple):
    """The past, and what was measured in this tick: (..., n, D) and (..., n)."""

    past: Past
    measured: Array
    seen: Mask


@dataclass(frozen=True)
class SilentEdgeFilter(Estimator[Silent]):
    """One filter an edge, predicted by what the neighbour is believed to fly.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    coefficient
        a_1 of the model of inputs: how much of an input is left a tick later.
    sigma_u
        Standard deviation of inputs, per axis, in metres per second: the square root of R_u(0).
    window
        Time between the two estimates from which an input is made, in ticks: more average it over more time.
    """

    prior_position: float = 1.0
    coefficient: float = 0.81
    sigma_u: float = 1.0
    window: int = 1

    def __post_init__(self) -> None:
        if self.window < 1:
            raise ValueError(f"window counts ticks, from 1; got {self.window}")
        refuse_negative(prior_position=self.prior_position, sigma_u=self.sigma_u)
        inputs.refuse_growing([self.coefficient])

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Silent:
        """Everybody at the same place, as far as is known, and at rest."""
        slots, dimension = brief.relative.shape[-2:]
        kept = (*batch, self.window + 1, slots)
        prior = 2.0 * self.prior_position * self.prior_position * identity(dimension)
        past = Past(
            mean=np.zeros((*kept, dimension)),
            covariance=np.broadcast_to(prior, (*kept, *prior.shape)).copy(),
            input=np.zeros((*batch, self.window + 1, dimension)),
            length=np.zeros(batch),
        )
        return Silent(past, np.zeros((*batch, slots, dimension)), np.zeros((*batch, slots), dtype=bool))

    def missed(self, brief: Brief, state: Silent, gap: Gap) -> Silent:  # noqa: ARG002
        """Begin again: what it infers counts as sure, and more so the longer nothing is measured."""
        return self.init(brief, gap.ticks.shape)

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Silent,
        measured: Array,
        seen: Mask,
    ) -> tuple[Silent, Mapping[str, Fields]]:
        """Keep the measurements until it is known how the edges have moved."""
        return state._replace(measured=measured, seen=seen), {}

    def fuse(
        self,
        brief: Brief,
        state: Silent,
        heard: Mapping[str, Heard],
        own: Own,
    ) -> tuple[Silent, Estimate]:
        """Predict every edge by what its neighbour is believed to fly, and correct those measured."""
        inputs.refuse_accelerations(heard[INPUT])
        past = state.past._replace(input=_pushed(own.velocity, state.past.input, -2))
        theirs, doubt = self._neighbours(brief, past)
        mean = past.mean[..., 0, :, :] + brief.dt * (own.velocity[..., None, :] - theirs)
        covariance = past.covariance[..., 0, :, :, :] + of_edges(brief) + brief.dt * brief.dt * doubt
        R = brief.sensor.weight(state.measured, mean, covariance)
        mean, covariance, nis = kalman.correct(mean, covariance, state.measured, R, state.seen)
        newer = Past(
            mean=_pushed(mean, past.mean, -3),
            covariance=_pushed(covariance, past.covariance, -4),
            input=past.input,
            length=np.minimum(past.length + 1, self.window + 1),
        )
        known = np.broadcast_to(brief.present, state.seen.shape)
        estimate = Estimate(mean, known, covariance, no_indicator(state.seen), reports={NIS: nis})
        return state._replace(past=newer), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether the window fits into the run."""
        if self.window < swarm.ticks:
            return []
        says = (
            f"a window of {self.window} ticks is never full in a run of {swarm.ticks}; give at most {swarm.ticks - 1}"
        )
        return [Finding("window", "error", says)]

    def _neighbours(self, brief: Brief, past: Past) -> tuple[Array, Array]:
        """What the neighbours fly, shape (..., n, D), and its covariance; at rest with R_u(0) while the past is too short."""
        R_u0, seconds = self.sigma_u * self.sigma_u * identity(brief.dimension), self.window * brief.dt
        flown = sum_over(past.input[..., 1 : self.window + 1, :], -2)[..., None, :] / self.window
        moved = past.mean[..., self.window, :, :] - past.mean[..., 0, :, :]
        observed = moved / seconds + flown
        ends = past.covariance[..., 0, :, :, :] + past.covariance[..., self.window, :, :, :]
        noise = (self.window * of_edges(brief) + ends) / (seconds * seconds)
        trust, a = product(R_u0, inverse(R_u0 + noise)), self.coefficient
        enough = (past.length > self.window)[..., None, None]
        theirs = np.where(enough, a * product(trust, observed[..., None])[..., 0], 0.0)
        # R_u(0) - W R_u(1)^T, without the difference of two large numbers.
        return theirs, np.where(enough[..., None], (1.0 - a * a) * R_u0 + product(a * a * trust, noise), R_u0)


def _pushed(newest: Array, past: Array, axis: int) -> Array:
    """The newest in front, the oldest gone, along the axis of time."""
    kept = past.take(range(past.shape[axis] - 1), axis=axis)
    return np.concatenate([np.expand_dims(newest, axis), kept], axis=axis)
