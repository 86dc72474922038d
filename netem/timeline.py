"""Scripted faults in simulated time: what holds in which tick.

A fault is an interval of ticks with a verb and what it takes hold of. Faults never write each other's state: at any tick
the conditions are the union of all faults then active, so the end of one cannot heal another.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from netem import cut
from netem.draws import Array
from netem.links import Links, Mask


class Verb(StrEnum):
    """What a fault does while it lasts."""

    CUT = "cut"
    PARTITION = "partition"
    LOSE = "lose"
    KILL = "kill"
    DEPART = "depart"


class UnderWay(StrEnum):
    """What a cut or a partition does to the messages under way on its links."""

    DROP = "drop"
    DELIVER = "deliver"
    HOLD = "hold"


@dataclass(frozen=True)
class Fault:
    """One scripted fault, active in the ticks start <= k < end.

    Parameters
    ----------
    verb
        What happens: the directed links `pairs` carry nothing, nothing crosses between `groups`, `pairs` lose messages, the
        processes of `agents` are dead, or `agents` have left the formation.
    start, end
        Ticks; `end` is None for a fault that lasts to the end of the run.
    pairs, groups, agents
        What it takes hold of; only those of its verb are filled.
    under_way
        What a cut or partition does to messages under way: drop them, deliver them when they are due, or hold them and deliver
        them when it ends, in order.
    loss
        Probability with which LOSE loses a message, on top of what else does.
    """

    verb: Verb
    start: int
    end: int | None
    pairs: tuple[tuple[int, int], ...] = ()
    groups: tuple[tuple[int, ...], ...] = ()
    agents: tuple[int, ...] = ()
    under_way: UnderWay = UnderWay.DROP
    loss: float = 0.0

    def active(self, tick: int) -> bool:
        """Whether it holds in this tick."""
        return self.start <= tick and (self.end is None or tick < self.end)

    def describe(self) -> str:
        """What it does, for people."""
        match self.verb:
            case Verb.CUT:
                return f"cut {self._links()}"
            case Verb.LOSE:
                return f"lose {self.loss:g} on {self._links()}"
            case Verb.PARTITION:
                return "partition " + " | ".join(",".join(map(str, group)) for group in self.groups)
            case Verb.KILL | Verb.DEPART:
                return f"{self.verb} {','.join(map(str, self.agents))}"

    def describe_end(self) -> str:
        """What its end does, for people."""
        match self.verb:
            case Verb.KILL:
                return f"restart {','.join(map(str, self.agents))}"
            case Verb.DEPART:
                return f"rejoin {','.join(map(str, self.agents))}"
            case Verb.CUT | Verb.PARTITION | Verb.LOSE:
                return f"heal: {self.describe()}"

    def _links(self) -> str:
        shown = ", ".join(f"{src}->{dst}" for src, dst in self.pairs[:12])
        return f"{shown} and {len(self.pairs) - 12} more" if len(self.pairs) > 12 else shown


@dataclass(frozen=True)
class Conditions:
    """What the timeline imposes in one tick.

    Parameters
    ----------
    dead, departed
        Agents, shape (N,).
    cut, partitioned
        Links that carry nothing, shape (L,).
    cut_drops, partition_drops, holds
        Links on which messages under way are dropped by a cut, by a partition, or wait, shape (L,).
    loss
        Probability of scripted loss, shape (L,).
    """

    dead: Mask
    departed: Mask
    cut: Mask
    partitioned: Mask
    cut_drops: Mask
    partition_drops: Mask
    holds: Mask
    loss: Array

    @property
    def absent(self) -> Mask:
        """Agents that take no part: dead or departed, shape (N,)."""
        return self.dead | self.departed


class Timeline:
    """All scripted faults of a run over its links."""

    def __init__(self, links: Links, faults: Sequence[Fault]) -> None:
        """Fails with ValueError where a fault names a link, group or agent that does not exist."""
        self.links = links
        self.faults = tuple(faults)
        self._link_masks = [self._links_held(fault) for fault in self.faults]
        self._agent_masks = [self._agents_held(fault) for fault in self.faults]

    def at(self, tick: int) -> Conditions:
        """The conditions of a tick; the same object for as long as nothing changes."""
        return self._segments[bisect_right(self._boundaries, tick) - 1]

    def starting(self, tick: int) -> list[Fault]:
        """Faults whose first tick this is."""
        return [fault for fault in self.faults if fault.start == tick]

    def ending(self, tick: int) -> list[Fault]:
        """Faults that hold no longer from this tick on."""
        return [fault for fault in self.faults if fault.end == tick]

    def restarted(self, tick: int) -> list[int]:
        """Agents whose processes are fresh in this tick."""
        ended = {agent for fault in self.ending(tick) if fault.verb is Verb.KILL for agent in fault.agents}
        return sorted(agent for agent in ended if not self.at(tick).dead[agent - 1])

    def killed(self, tick: int) -> list[int]:
        """Agents whose processes die at this tick."""
        starting = {agent for fault in self.starting(tick) if fault.verb is Verb.KILL for agent in fault.agents}
        return sorted(agent for agent in starting if tick == 0 or not self.at(tick - 1).dead[agent - 1])

    def held(self, fault: int) -> Mask:
        """Links on which fault number `fault` acts, shape (L,)."""
        return self._link_masks[fault] | self.links.touching(self._agent_masks[fault])

    @cached_property
    def _boundaries(self) -> list[int]:
        ends = {fault.end for fault in self.faults if fault.end is not None}
        return sorted({0} | {fault.start for fault in self.faults} | ends)

    @cached_property
    def _segments(self) -> list[Conditions]:
        return [self._conditions(tick) for tick in self._boundaries]

    def _conditions(self, tick: int) -> Conditions:
        def union(verb: Verb, masks: list[Mask], size: int) -> Mask:
            held = [m for f, m in zip(self.faults, masks, strict=True) if f.verb is verb and f.active(tick)]
            return np.logical_or.reduce([np.zeros(size, dtype=bool), *held])

        def under_way(policy: UnderWay, *verbs: Verb) -> Mask:
            held = [
                mask
                for fault, mask in zip(self.faults, self._link_masks, strict=True)
                if fault.under_way is policy and fault.verb in verbs and fault.active(tick)
            ]
            return np.logical_or.reduce([np.zeros(len(self.links), dtype=bool), *held])

        passing = np.ones(len(self.links))
        for fault, mask in zip(self.faults, self._link_masks, strict=True):
            if fault.verb is Verb.LOSE and fault.active(tick):
                passing = passing * np.where(mask, 1.0 - fault.loss, 1.0)
        return Conditions(
            dead=union(Verb.KILL, self._agent_masks, self.links.agents),
            departed=union(Verb.DEPART, self._agent_masks, self.links.agents),
            cut=union(Verb.CUT, self._link_masks, len(self.links)),
            partitioned=union(Verb.PARTITION, self._link_masks, len(self.links)),
            cut_drops=under_way(UnderWay.DROP, Verb.CUT),
            partition_drops=under_way(UnderWay.DROP, Verb.PARTITION),
            holds=under_way(UnderWay.HOLD, Verb.CUT, Verb.PARTITION),
            loss=1.0 - passing,
        )

    def _links_held(self, fault: Fault) -> Mask:
        return cut.severed(self.links, fault.pairs) | cut.separated(self.links, fault.groups)

    def _agents_held(self, fault: Fault) -> Mask:
        mask = np.zeros(self.links.agents, dtype=bool)
        for agent in fault.agents:
            if not 1 <= agent <= self.links.agents:
                raise ValueError(f"agent {agent} does not exist: agents are 1 to {self.links.agents}")
            mask[agent - 1] = True
        return mask
