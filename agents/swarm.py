"""What is known of a whole swarm before it flies: what algorithms check themselves against, and what a centre is made for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from analysis.models.sensor import Sensor


class Late(NamedTuple):
    """What makes messages late: where the scenario says it, and by how many ticks at the most, infinite without a bound."""

    where: str
    ticks: float

    def __str__(self) -> str:
        by = f"up to {self.ticks:g} ticks" if isfinite(self.ticks) else "without a bound"
        return f"{self.where}: {by}"


@dataclass(frozen=True)
class SwarmBrief:
    """A swarm of N agents with up to n neighbours each, in D dimensions.

    Parameters
    ----------
    dt, ticks
        Tick, in seconds, and how many of them the run has.
    order
        Of the bodies: how many times they integrate their input.
    late
        What makes what agents say heard late, if anything does: the exchange, delays, profiles, and faults that are scripted.
    lateness
        By how many ticks at the most; those of the run where there is no bound.
    nominal
        Nominal positions, shape (N, D), in metres.
    neighbours, present
        Rows of the agents in the slots, and which slots are real, shape (N, n).
    leader
        Who leads, shape (N,).
    stress
        The stress matrix L, shape (N, N); 0 where the law weighs no edges by it.
    sensor
        What measures the edges.
    correlation
        Q_A, of disturbances between agents, shape (N, N).
    displacement
        Q_D, what a disturbance displaces one agent by in a tick, shape (D, D), in square metres.
    persistence
        Correlation of such a displacement with that of the tick before, in [0, 1).
    """

    dt: float
    ticks: int
    order: int
    late: tuple[Late, ...]
    lateness: int
    nominal: Array
    neighbours: Integers
    present: Mask
    leader: Mask
    stress: Array
    sensor: Sensor
    correlation: Array
    displacement: Array
    persistence: float

    @property
    def agents(self) -> int:
        """N."""
        return self.nominal.shape[0]

    @property
    def dimension(self) -> int:
        """D."""
        return self.nominal.shape[1]

    @cached_property
    def process(self) -> Array:
        """Q of all agents together, shape (N D, N D), in square metres."""
        return np.asarray(np.kron(self.correlation, self.displacement), dtype=np.float64)

    @cached_property
    def laplacian(self) -> Array:
        """Of the graph without weights, shape (N, N)."""
        edges = np.zeros((self.agents, self.agents))
        own, slots = np.nonzero(self.present)
        edges[own, self.neighbours[own, slots]] = 1.0
        return np.diag(edges.sum(axis=1)) - edges

    @property
    def follower_stress(self) -> Array:
        """Rows and columns of the F followers in the stress matrix, L_ff, shape (F, F)."""
        return self.stress[np.ix_(~self.leader, ~self.leader)]

    @property
    def follower_degree(self) -> Array:
        """gamma_i = sum_j l_ij of the followers, shape (F,)."""
        return np.diag(self.stress)[~self.leader]
