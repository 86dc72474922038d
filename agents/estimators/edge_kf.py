"""The edge Kalman filter (paper 001, (5a)-(5g); paper 004, Algorithms 5 and 8): an edge moves as the inputs of its ends say.

A neighbour says what it flew from the tick before. What is not heard is guessed by an autoregressive model, and stays in doubt
until it is heard: the state has the neighbour's inputs beside the edge, and what displaces the edge where disturbances persist.
The printed algorithms take both doubts for white, which makes them too sure (docs/decisions/0017); where all inputs are heard
and disturbances are white, this is the printed filter.

Of a sensor that says directions alone, the first one puts an edge at its nominal distance; from then on how far it is follows
from how its direction changes while both ends fly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from agents.algebra import inputs, kalman, late_news, missed_ticks
from agents.algebra.blocks import diagonal_blocks
from agents.algebra.geometry import identity
from agents.algebra.unknowns import Belief, EdgeModel
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.reports import NIS
from netem.core.channels import INPUT


class Edges(NamedTuple):
    """What is believed of each edge by itself, with axes (..., n), and which were ever measured, shape (..., n)."""

    belief: Belief
    met: Mask


class EdgeStates(NamedTuple):
    """The filters, what they remember of the last ticks, and what is measured in this one: (..., n, D) and (..., n)."""

    edges: Edges
    past: late_news.RecentTicks[Edges]
    measured: Array
    seen: Mask


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
        Standard deviation of what drives that model, per axis, in metres per second; 0 takes what is guessed for known.
    memory
        How late an input may be heard, and be of use, in ticks: later ones count as lost. No more are remembered than the
        network can make messages late.
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

    def init(self, brief: Brief, batch: tuple[int, ...]) -> EdgeStates:
        """Everybody at the same place, as far as is known (5a)."""
        slots, dimension = brief.relative.shape[-2:]
        shape = (*batch, slots)
        prior = 2.0 * self.prior_position * self.prior_position * identity(dimension)
        edges = Edges(self._model(brief).begin(prior, of_edges(brief), shape), np.zeros(shape, dtype=bool))
        past = late_news.blank(edges, batch, (slots, dimension), min(self.memory, brief.lateness))
        return EdgeStates(edges, past, np.zeros((*shape, dimension)), np.zeros(shape, dtype=bool))

    def missed(self, brief: Brief, state: EdgeStates, gap: Gap) -> EdgeStates:
        """Predict by what the agent flew and the neighbours are guessed to fly; begin again where guesses are not doubted."""
        if self.sigma_n == 0.0:
            return self.init(brief, gap.ticks.shape)

        def live(state: EdgeStates, gone: int) -> EdgeStates:
            own = gap.within if gone else gap.before
            edges, past = late_news.unheard(state.past, state.edges, own, partial(self._step, brief))
            return state._replace(edges=edges, past=past)

        return missed_ticks.lived(state, gap.ticks, live, fresh=lambda: self.init(brief, gap.ticks.shape))

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
        """Predict every edge by the inputs (5c)-(5d), and correct those measured (5e)-(5g), from the oldest news on."""
        inputs.refuse_accelerations(heard[INPUT])
        past = late_news.advanced(state.past, state.edges, own.velocity, state.measured, state.seen)
        past, oldest = late_news.filled_in(past, heard[INPUT])
        edges, past, nis = late_news.reprocessed(past, oldest, partial(self._step, brief))
        mean, covariance = edges.belief.edges
        known = np.broadcast_to(brief.present, state.seen.shape)
        estimate = Estimate(mean, known, covariance, no_indicator(known), reports={NIS: nis})
        return state._replace(edges=edges, past=past), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether inputs are heard in the tick they are of."""
        return inputs.late(swarm, self.sigma_n, self.memory)

    def _model(self, brief: Brief) -> EdgeModel:
        return EdgeModel(brief.dt, tuple(self.coefficients), self.sigma_n, brief.persistence)

    def _step(self, brief: Brief, edges: Edges, tick: late_news.TakenIn) -> tuple[Edges, Array]:
        model, sure = self._model(brief), np.broadcast_to(tick.known[..., None], tick.inputs.shape)
        belief = model.hear(model.ahead(edges.belief, of_edges(brief)), tick.inputs, sure)
        belief = model.move(belief, tick.own[..., None, :])
        mean, covariance = belief.edges
        if not brief.sensor.says_positions:
            nominal = np.linalg.norm(brief.relative, axis=-1, keepdims=True) * tick.measured
            mean = np.where((tick.seen & ~edges.met)[..., None], nominal, mean)
            belief = belief.placed(mean)
        observed = brief.sensor.observed(tick.measured, mean, covariance)
        mean, covariance, nis = kalman.correct(belief.doubted, belief.covariance, *observed, tick.seen)
        return Edges(belief.corrected(mean, covariance), edges.met | tick.seen), nis


def of_edges(brief: Brief) -> Array:
    """Q_ij = B_ij^T Q B_ij of every edge by itself, shape (..., n, D, D): the diagonal blocks of the agent's."""
    return diagonal_blocks(brief.process, brief.dimension)
