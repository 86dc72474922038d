"""The joint filter (paper 001, (14a)-(14g); paper 004, Algorithm 7): one Kalman filter for all edges of an agent.

Its edges share the agent's own position and disturbance, and disturbances are correlated between agents: what one edge
shows says something of the others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import inputs, kalman
from agents.algebra.blocks import block_diagonal, diagonal_blocks
from agents.algebra.geometry import identity
from agents.algebra.small import inverse
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.reports import NIS
from netem.core.channels import INPUT


class Joint(NamedTuple):
    """Mean (..., n, D) and covariance (..., n D, n D) of all edges, the neighbours' inputs, and this tick's measurements."""

    mean: Array
    covariance: Array
    flown: inputs.NeighbourInputs
    measured: Array
    seen: Mask


@dataclass(frozen=True)
class JointEdgeFilter(Estimator[Joint]):
    """JRKF, or J-Edge-KF.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    coefficients, sigma_n
        The model of inputs that are not heard, as in the edge filter.
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

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Joint:
        """Everybody at the same place, as far as is known: B_i^T B_i (x) P (14b)."""
        slots, dimension = brief.relative.shape[-2:]
        shape = (*batch, slots)
        edges = np.ones((slots, slots)) + np.eye(slots)
        prior = self.prior_position * self.prior_position * np.kron(edges, identity(dimension))
        return Joint(
            mean=np.zeros((*shape, dimension)),
            covariance=np.broadcast_to(prior, (*batch, *prior.shape)).copy(),
            flown=inputs.at_rest(shape, dimension, len(self.coefficients)),
            measured=np.zeros((*shape, dimension)),
            seen=np.zeros(shape, dtype=bool),
        )

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Joint,
        measured: Array,
        seen: Mask,
    ) -> tuple[Joint, Mapping[str, Fields]]:
        """Keep the measurements until it is known how the edges have moved."""
        return state._replace(measured=measured, seen=seen), {}

    def fuse(self, brief: Brief, state: Joint, heard: Mapping[str, Heard], own: Own) -> tuple[Joint, Estimate]:
        """Predict all edges by the inputs (14c)-(14d), and correct them by those measured (14e)-(14g)."""
        flown = inputs.hear(state.flown, heard[INPUT], self.coefficients, self.sigma_n)
        theirs, doubt = flown.last
        mean = state.mean + brief.dt * (own.velocity[..., None, :] - theirs)
        covariance = state.covariance + brief.process + brief.dt * brief.dt * block_diagonal(doubt)
        doubts = diagonal_blocks(covariance, brief.dimension)
        R = brief.sensor.weight(state.measured, mean, doubts)
        nis = kalman.normalised(state.measured - mean, inverse(doubts + R), state.seen)
        mean, covariance = corrected(mean, covariance, state.measured, block_diagonal(R), state.seen)
        known, edges = np.broadcast_to(brief.present, state.seen.shape), diagonal_blocks(covariance, brief.dimension)
        estimate = Estimate(mean, known, edges, no_indicator(state.seen), reports={NIS: nis})
        return state._replace(mean=mean, covariance=covariance, flown=flown), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether inputs are heard in the tick they are of."""
        return inputs.in_time(swarm)


def corrected(mean: Array, covariance: Array, measured: Array, R: Array, seen: Mask) -> tuple[Array, Array]:
    """The joint estimate after the measurements of some of its edges.

    Parameters
    ----------
    mean, covariance
        Predicted, shapes (..., n, D) and (..., n D, n D).
    measured, seen
        Shapes (..., n, D) and (..., n).
    R
        Covariance of all measurements together, shape (..., n D, n D).
    """
    shape, dimension = mean.shape, mean.shape[-1]
    rows = np.repeat(seen, dimension, axis=-1)
    both = rows[..., :, None] & rows[..., None, :]
    # An edge that is not measured stands apart, with an innovation of zero.
    S = np.where(both, covariance + R, np.eye(rows.shape[-1]))
    observed = np.where(rows[..., :, None], covariance, 0.0)
    gain = np.swapaxes(np.linalg.solve(S, observed), -1, -2)
    innovation = np.where(rows, (measured - mean).reshape(rows.shape), 0.0)
    moved = mean.reshape(rows.shape) + product(gain, innovation[..., None])[..., 0]
    return moved.reshape(shape), covariance - product(gain, observed)
