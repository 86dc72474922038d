"""The directed links of a swarm: who can hear, and sense, whom.

Link j -> i carries everything agent i learns of agent j: the measurement y_ij and what j broadcasts. Agents are numbered
from 1; link arrays are ordered by (dst, src), so the links toward one agent stand together, in the order of its neighbours.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.models.arrays import Integers, Mask
from netem.core.draws import Seed


@dataclass(frozen=True)
class Links:
    """Directed links of the nominal graph.

    Parameters
    ----------
    agents
        How many agents there are.
    src, dst
        Agent numbers, shape (L,).
    swarm
        How many agents a swarm has: fewer than all when several swarms fly side by side, each a run of its own.
    """

    agents: int
    src: Integers
    dst: Integers
    swarm: int

    @classmethod
    def both_ways(cls, agents: int, edges: Iterable[tuple[int, int]]) -> Links:
        """The two directed links of every undirected edge."""
        pairs = sorted({(i, j) for a, b in edges for i, j in ((a, b), (b, a))})
        dst, src = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        return cls(agents, np.ascontiguousarray(src), np.ascontiguousarray(dst), agents)

    def __len__(self) -> int:
        return len(self.src)

    def side_by_side(self, swarms: int) -> Links:
        """The links of so many swarms of the same kind, one after the other."""
        first = np.repeat(np.arange(swarms) * self.agents, len(self))
        return Links(
            swarms * self.agents, np.tile(self.src, swarms) + first, np.tile(self.dst, swarms) + first, self.agents
        )

    def own_number(self, agents: Integers) -> Integers:
        """The numbers of agents in their own swarms: what their draws are a function of."""
        return (agents - 1) % self.swarm + 1

    @cached_property
    def ends(self) -> dict[str, Integers]:
        """`src` and `dst` of every link, in its own swarm, as draws are indexed by them."""
        return {"src": self.own_number(self.src), "dst": self.own_number(self.dst)}

    def seeds(self, seed: Seed) -> Seed:
        """The seed of every link, from that of the run, or of every agent's run."""
        return seed if isinstance(seed, int) else seed[self.dst - 1]

    @cached_property
    def index(self) -> dict[tuple[int, int], int]:
        """Row of the link (src, dst)."""
        return {(int(s), int(d)): row for row, (s, d) in enumerate(zip(self.src, self.dst, strict=True))}

    @cached_property
    def degree(self) -> Integers:
        """Links toward each agent, shape (agents,)."""
        return np.bincount(self.dst - 1, minlength=self.agents).astype(np.int64)

    @cached_property
    def present(self) -> Mask:
        """Which neighbour slots of each agent are real, shape (agents, n); the rest is padding."""
        return np.arange(int(self.degree.max(initial=0))) < self.degree[:, None]

    @cached_property
    def slots(self) -> Integers:
        """Link row behind each agent's neighbour slot, shape (agents, n); padding points at row 0."""
        rows = np.zeros(self.present.shape, dtype=np.int64)
        rows[self.present] = np.arange(len(self))
        return rows

    @cached_property
    def neighbours(self) -> Integers:
        """Neighbour in each agent's slot as an array row (number - 1), shape (agents, n)."""
        return np.where(self.present, self.src[self.slots] - 1, 0)

    def neighbours_of(self, agent: int) -> tuple[int, ...]:
        """The numbers of the agents in the neighbour slots of one."""
        row = agent - 1
        return tuple((self.neighbours[row, self.present[row]] + 1).tolist())

    @cached_property
    def back(self) -> Integers:
        """The slot in which the neighbour in each slot has this agent, shape (agents, n); 0 in padding."""
        first = np.cumsum(self.degree) - self.degree
        rows = np.array(
            [self.index.get((dst, src), -1) for src, dst in zip(self.src.tolist(), self.dst.tolist(), strict=True)]
        )
        slot = rows - first[self.src - 1]
        return np.where(self.present, slot[self.slots], 0)

    def touching(self, agents: Mask) -> Mask:
        """Links with either end among `agents` (agents,), shape (L,)."""
        touched: Mask = agents[self.src - 1] | agents[self.dst - 1]
        return touched
