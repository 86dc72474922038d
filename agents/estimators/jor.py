"""Localization by Jacobi over-relaxation (paper 003): where an agent is, relative to the weighted centroid of all.

Every edge counts with what was first measured of it, from either end. In each tick an agent moves its estimate toward where its
neighbours, as last heard, say that it is; a message that is lost or late leaves it with what it heard before.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from agents.algebra import starts
from agents.algebra.geometry import identity
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_edges
from agents.estimators.base import Estimator
from agents.exchange import Channels, Field, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models import jacobi
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.small import inverse
from netem.core.channels import PLACE


class Side(NamedTuple):
    """What one end of each edge measured, of the agent relative to the neighbour, (..., n, D), and whether it did (..., n)."""

    measured: Array
    seen: Mask


class Belief(NamedTuple):
    """Where the agent is (..., D), where its neighbours said they are (..., n, D), who has said so (..., n), and both sides."""

    place: Array
    theirs: Array
    told: Mask
    own: Side
    other: Side


@dataclass(frozen=True)
class JacobiOverRelaxation(Estimator[Belief]):
    """JOR (11)-(13).

    Parameters
    ----------
    h
        Step: below 1/2 nothing rings (lemma 5.1), below 1 it converges (theorem 4.1). `affinet check` says which are fastest.
    anchor
        Whether leaders stay at the origin of the common frame, as in anchor-based methods (definition 4.1).
    covariance
        Of the measurements: "full", or "diagonal", which dismisses what their axes have to do with each other.
    start
        x(0): where each agent believes it is before anything is measured, in metres; none, at the origin.
    """

    h: float = 0.49
    anchor: bool = False
    covariance: Literal["full", "diagonal"] = "full"
    start: Sequence[Sequence[float]] = ()

    def __post_init__(self) -> None:
        if not 0.0 < self.h < 1.0:
            raise ValueError(f"h is a step between 0 and 1, not {self.h}")

    def channels(self, brief: Brief) -> Channels:
        """Where it believes it is, and what it first measured of each neighbour."""
        slots, dimension = brief.relative.shape[-2:]
        measured = {"measured": Field((slots, dimension)), "seen": Field((slots,), bool)}
        return {PLACE: {"place": Field((dimension,)), **measured}}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Belief:
        """Where it is given, or at the origin; nothing measured, nobody heard."""
        shape = (*batch, *brief.relative.shape[-2:])
        nothing, no = np.zeros(shape), np.zeros(shape[:-1], dtype=bool)
        place = np.broadcast_to(starts.own(self.start, brief.number, shape[-1:]), (*batch, shape[-1])).copy()
        return Belief(place, nothing, no, Side(nothing, no), Side(nothing, no))

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Belief,
        measured: Array,
        seen: Mask,
    ) -> tuple[Belief, Mapping[str, Fields]]:
        """Keep the first measurement of each edge, and tell it with the estimate."""
        own = _first(state.own, measured, seen)
        return state._replace(own=own), {PLACE: {"place": state.place, **own._asdict()}}

    def fuse(
        self,
        brief: Brief,
        state: Belief,
        heard: Mapping[str, Heard],
        own: Own,  # noqa: ARG002
    ) -> tuple[Belief, Estimate]:
        """One iteration (13)."""
        said = heard[PLACE]
        here = np.broadcast_to(brief.back, said.fresh.shape)[..., None]
        of_me = np.take_along_axis(said.fields["measured"], here[..., None], axis=-2)[..., 0, :]
        seen = np.take_along_axis(said.fields["seen"], here, axis=-1)[..., 0]
        # Who restarts measures anew, or not at all, and says so in every message: both ends then go by that.
        other = Side(
            np.where((said.fresh & seen)[..., None], -of_me, state.other.measured),
            np.where(said.fresh, seen, state.other.seen),
        )
        theirs = np.where(said.fresh[..., None], said.fields["place"], state.theirs)
        told = state.told | said.fresh
        information, pull = self._edges(brief, state.own, other)
        counts = told & (state.own.seen | other.seen)
        place = self._moved(
            brief, state.place, theirs, np.where(counts[..., None, None], information, 0.0), pull, counts
        )
        return Belief(place, theirs, told, state.own, other), no_edges(counts, brief.dimension, {PLACE: place})

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """How fast it comes to its answer, from measurements as they would be without noise."""
        if not swarm.sensor.says_positions:
            says = "agents find out where they are from positions of each other, and the sensor says directions alone"
            return [Finding("localization", "error", says)]
        if unfit := starts.suits("start", self.start, swarm.agents, (swarm.dimension,)):
            return unfit
        leaders = np.flatnonzero(swarm.leader)
        if self.anchor and len(leaders) != 1:
            says = f"with an anchor exactly one agent leads: formation.leaders has {len(leaders)}"
            return [Finding("localization", "error", says)]
        known, anchor = _noiseless(swarm), int(leaders[0]) if len(leaders) == 1 else 0
        found = jacobi.rates(known, self.h, anchor)
        says = (
            f"rate {found.anchor if self.anchor else found.centroid:.4f} a tick with h {self.h:g} (weighted centroid "
            f"{found.centroid:.4f}, agent {anchor + 1} as the anchor {found.anchor:.4f}); "
            f"h {jacobi.step(known, 'smooth'):.3f} is the fastest without ringing, {jacobi.step(known, 'fast'):.3f} of all"
        )
        return [Finding("localization", "ok", says)]

    def _moved(self, brief: Brief, place: Array, theirs: Array, information: Array, pull: Array, counts: Mask) -> Array:
        own = sum_over(information, -3)
        drawn = product(information, theirs[..., None])[..., 0] + np.where(counts[..., None], pull, 0.0)
        anybody = np.asarray(counts.any(axis=-1))
        weight = np.where(anybody[..., None, None], own, identity(brief.dimension))
        toward = product(inverse(weight), sum_over(drawn, -2)[..., None])[..., 0]
        fixed = np.logical_and(brief.leader, self.anchor)
        stepped = (1.0 - self.h) * place + self.h * toward
        return np.where((anybody & ~fixed)[..., None], stepped, place)

    def _edges(self, brief: Brief, own: Side, other: Side) -> tuple[Array, Array]:
        """Inverse covariances of the edges, both sides together, (..., n, D, D), and these times what was measured.

        Both sides weigh as where their mean puts the neighbour: a weight by one's own noise prefers what fell short.
        """
        number = own.seen.astype(np.float64) + other.seen
        total = np.where(own.seen[..., None], own.measured, 0.0) + np.where(other.seen[..., None], other.measured, 0.0)
        known = number[..., None, None] > 0.0
        spread = brief.sensor.spread(total / np.maximum(number, 1.0)[..., None])
        if self.covariance == "diagonal":
            spread = spread * identity(brief.dimension)
        precision = np.where(known, inverse(np.where(known, spread, identity(brief.dimension))), 0.0)
        return number[..., None, None] * precision, product(precision, total[..., None])[..., 0]


def _noiseless(swarm: SwarmBrief) -> jacobi.EdgeInformation:
    own, slots = np.nonzero(swarm.present)
    edges = own, swarm.neighbours[own, slots]
    relative = np.zeros((swarm.agents, swarm.agents, swarm.dimension))
    relative[edges] = swarm.nominal[edges[0]] - swarm.nominal[edges[1]]
    information = np.zeros((*relative.shape, swarm.dimension))
    information[edges] = np.linalg.inv(swarm.sensor.spread(relative[edges]))
    return jacobi.together(relative, information)


def _first(side: Side, measured: Array, seen: Mask) -> Side:
    new = seen & ~side.seen
    return Side(np.where(new[..., None], measured, side.measured), side.seen | seen)
