"""The joint filter (paper 001, (14a)-(14g); paper 004, Algorithm 7): one Kalman filter for all edges of an agent.

Its edges share the agent's own position and disturbance, and disturbances are correlated between agents: what one edge
shows says something of the others. Inputs that are guessed and disturbances that last are in its state, as in the edge filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from agents.algebra import inputs, kalman, late_news, missed_ticks
from agents.algebra.blocks import block_diagonal, diagonal_blocks
from agents.algebra.geometry import identity
from agents.algebra.unknowns import Belief, EdgeModel
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.reports import NIS
from analysis.models.small import inverse
from netem.core.channels import INPUT


class Joint(NamedTuple):
    """What is believed of all edges, of the last ticks, and what is measured in this one: (..., n, D) and (..., n)."""

    edges: Belief
    past: late_news.RecentTicks[Belief]
    measured: Array
    seen: Mask


@dataclass(frozen=True)
class JointEdgeFilter(Estimator[Joint]):
    """JRKF, or J-Edge-KF.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    coefficients
        Of the autoregressive model for inputs that are not heard, the latest first, as in the edge filter.
    sigma_n
        Standard deviation of what drives that model, per axis, in metres per second.
    memory
        How late an input may be heard, and be of use, in ticks.
    """

    prior_position: float = 1.0
    coefficients: Sequence[float] = (1.0,)
    sigma_n: float = 0.0
    memory: int = 32

    def __post_init__(self) -> None:
        refuse_negative(prior_position=self.prior_position, sigma_n=self.sigma_n)
        inputs.refuse_growing(self.coefficients)
        late_news.refuse_forgetful(self.memory)

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing beyond the inputs that every agent broadcasts."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Joint:
        """Everybody at the same place, as far as is known: B_i^T B_i (x) P (14b)."""
        slots, dimension = brief.relative.shape[-2:]
        edges = np.ones((slots, slots)) + np.eye(slots)
        prior = self.prior_position * self.prior_position * np.kron(edges, identity(dimension)).astype(np.float64)
        belief = self._model(brief).begin(prior, brief.process, batch)
        past = late_news.blank(belief, batch, (slots, dimension), min(self.memory, brief.lateness))
        return Joint(belief, past, np.zeros((*batch, slots, dimension)), np.zeros((*batch, slots), dtype=bool))

    def missed(self, brief: Brief, state: Joint, gap: Gap) -> Joint:
        """Predict by what the agent flew and the neighbours are guessed to fly; begin again where guesses are not doubted."""
        if self.sigma_n == 0.0:
            return self.init(brief, gap.ticks.shape)

        def live(state: Joint, gone: int) -> Joint:
            own = gap.within if gone else gap.before
            belief, past = late_news.unheard(state.past, state.edges, own, partial(self._step, brief))
            return state._replace(edges=belief, past=past)

        return missed_ticks.lived(state, gap.ticks, live, fresh=lambda: self.init(brief, gap.ticks.shape))

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
        """Predict all edges by the inputs (14c)-(14d), and correct those measured (14e)-(14g), from the oldest news on."""
        inputs.refuse_accelerations(heard[INPUT])
        past = late_news.advanced(state.past, state.edges, own.velocity, state.measured, state.seen)
        past, oldest = late_news.filled_in(past, heard[INPUT])
        belief, past, nis = late_news.reprocessed(past, oldest, partial(self._step, brief))
        mean, covariance = belief.edges
        known, edges = np.broadcast_to(brief.present, state.seen.shape), diagonal_blocks(covariance, brief.dimension)
        estimate = Estimate(mean.reshape(state.measured.shape), known, edges, no_indicator(known), reports={NIS: nis})
        return state._replace(edges=belief, past=past), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether inputs are heard in the tick they are of."""
        return inputs.late(swarm, self.sigma_n, self.memory)

    def _model(self, brief: Brief) -> EdgeModel:
        return EdgeModel(brief.dt, tuple(self.coefficients), self.sigma_n, brief.persistence)

    def _step(self, brief: Brief, belief: Belief, tick: late_news.TakenIn) -> tuple[Belief, Array]:
        model, all_edges = self._model(brief), (*tick.seen.shape[:-1], -1)
        sure = np.repeat(tick.known, brief.dimension, axis=-1)
        belief = model.hear(model.ahead(belief, brief.process), tick.inputs.reshape(all_edges), sure)
        own = np.broadcast_to(tick.own[..., None, :], tick.measured.shape)
        belief = model.move(belief, own.reshape(all_edges))
        mean, covariance = belief.edges
        expected, doubts = mean.reshape(tick.measured.shape), diagonal_blocks(covariance, brief.dimension)
        R = brief.sensor.weight(tick.measured, expected, doubts)
        nis = kalman.normalised(tick.measured - expected, inverse(doubts + R), tick.seen)
        return corrected(belief, tick.measured.reshape(all_edges), block_diagonal(R), tick.seen), nis


def corrected(belief: Belief, measured: Array, R: Array, seen: Mask) -> Belief:
    """What is believed after the measurements of some of the edges.

    Parameters
    ----------
    belief
        Predicted, of n edges together.
    measured, seen
        Shapes (..., n D) and (..., n).
    R
        Covariance of all measurements together, shape (..., n D, n D).
    """
    mean, covariance = belief.edges
    rows = np.repeat(seen, measured.shape[-1] // seen.shape[-1], axis=-1)
    both = rows[..., :, None] & rows[..., None, :]
    # An edge that is not measured stands apart, with an innovation of zero.
    S = np.where(both, covariance + R, np.eye(rows.shape[-1]))
    observed = np.where(rows[..., :, None], belief.covariance[..., : rows.shape[-1], :], 0.0)
    gain = np.swapaxes(np.linalg.solve(S, observed), -1, -2)
    innovation = np.where(rows, measured - mean, 0.0)
    moved = belief.doubted + product(gain, innovation[..., None])[..., 0]
    return belief.corrected(moved, belief.covariance - product(gain, observed))
