"""Scripted faults in simulated time: what holds in which tick.

A fault is an interval of ticks with a verb and what it takes hold of. Faults never write each other's state: at any tick
the conditions are the union of all faults then active, so the end of one cannot heal another.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.faults import cut
from netem.faults.conditions import Acting, Conditions
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.trigger import Trigger

_KEPT = 64  # segments whose conditions are kept: who goes from tick to tick looks at two of them
# What a clock gains is a whole number of ticks again and again, and floats fall a little short of that.
_ROUNDING = 1e-9


class Timeline:
    """All scripted faults of a run over its links.

    Parameters
    ----------
    links
        Of the nominal graph.
    scripted
        Faults of the scenario.
    triggers
        Those that set some of them off.
    injected
        Faults that were put on top while the run flew.
    """

    def __init__(
        self,
        links: Links,
        scripted: Sequence[Fault],
        triggers: Sequence[Trigger] = (),
        injected: Sequence[Fault] = (),
    ) -> None:
        """Fails with ValueError where a fault names a link, group or agent that does not exist."""
        self.links = links
        self.scripted, self.injected = tuple(scripted), tuple(injected)
        self.faults = (*self.scripted, *self.injected)
        self.triggers = tuple(triggers)
        # What comes back every so many seconds holds the same each time.
        of_links = {(fault.pairs, fault.groups): self._links_held(fault) for fault in _alike_once(self.faults)}
        of_agents = {fault.agents: self._agents_held(fault) for fault in _alike_once(self.faults)}
        self._link_masks = [of_links[fault.pairs, fault.groups] for fault in self.faults]
        self._agent_masks = [of_agents[fault.agents] for fault in self.faults]
        self._segments: dict[int, Conditions] = {}

    def at(self, tick: int) -> Conditions:
        """The conditions of a tick; the same object for as long as nothing changes."""
        return self._segment(bisect_right(self._boundaries, tick) - 1)

    def present(self, ticks: Iterable[int]) -> Mask:
        """Agents that take part in each of these ticks, shape (T, N)."""
        return self.each(ticks, lambda now: ~now.absent)

    def each(self, ticks: Iterable[int], read: Callable[[Conditions], Mask]) -> Mask:
        """What is read of the conditions of each of these ticks, of the agents, shape (T, N)."""
        segments = np.searchsorted(self._boundaries, np.fromiter(ticks, dtype=np.int64), side="right") - 1
        apart, row = np.unique(segments, return_inverse=True)
        masks = [read(self._segment(segment)) for segment in apart.tolist()]
        return np.reshape(masks, (len(apart), self.links.agents)).astype(bool)[row]

    def without(self, number: int) -> Timeline:
        """As long as one fault lasts, the timeline had it not been: of the others only those that hold meanwhile."""
        fault = self.faults[number]
        first = bisect_right(self._boundaries, fault.start) - 1
        end = None if fault.end is None else bisect_left(self._boundaries, fault.end)
        meanwhile = sorted({one for in_force in self._in_force[first:end] for one in in_force} - {number})
        return Timeline(self.links, [self.faults[one] for one in meanwhile], self.triggers)

    @cached_property
    def pending(self) -> tuple[int, ...]:
        """Triggers that have not fired yet and still hold a fault back."""
        return tuple(sorted({fault.trigger for fault in self.faults if fault.trigger is not None}))

    def due(self, errors: Array) -> list[int]:
        """Triggers that fire in the tick after these tracking errors, shape (T,), in square metres."""
        return [number for number in self.pending if self.triggers[number].fires(errors)]

    def fired(self, triggers: Iterable[int], tick: int) -> Timeline:
        """The timeline once these triggers have fired in this tick."""
        chosen = set(triggers)
        placed = [_placed(fault, tick) if fault.trigger in chosen else fault for fault in self.scripted]
        return Timeline(self.links, placed, self.triggers, self.injected)

    def facing(self, injected: Sequence[Fault]) -> Timeline:
        """The timeline with these faults injected, and no others."""
        return Timeline(self.links, self.scripted, self.triggers, injected)

    def starting(self, tick: int) -> list[Fault]:
        """Faults whose first tick this is."""
        return [self.faults[number] for number in self.starting_numbers(tick)]

    def starting_numbers(self, tick: int) -> Sequence[int]:
        """Numbers of the faults whose first tick this is."""
        return self._starts.get(tick, ())

    def ending(self, tick: int) -> list[Fault]:
        """Faults that hold no longer from this tick on."""
        return [self.faults[number] for number in self._ends.get(tick, ())]

    def restarted(self, tick: int) -> list[int]:
        """Agents whose processes are new in this tick."""
        ended = {agent for fault in self.ending(tick) if fault.verb is Verb.KILL for agent in fault.agents}
        return sorted(agent for agent in ended if not self.at(tick).dead[agent - 1])

    def remembering(self, tick: int) -> list[int]:
        """Those among them that go on from their own last state."""
        warm = {agent for fault in self.ending(tick) if fault.warm for agent in fault.agents}
        return [agent for agent in self.restarted(tick) if agent in warm]

    def killed(self, tick: int) -> list[int]:
        """Agents whose processes die at this tick."""
        starting = {agent for fault in self.starting(tick) if fault.verb is Verb.KILL for agent in fault.agents}
        return sorted(agent for agent in starting if tick == 0 or not self.at(tick - 1).dead[agent - 1])

    def paused(self, tick: int) -> list[int]:
        """Agents whose processes are to be stopped at this tick."""
        if not tick:
            return _numbers(self.at(tick).paused)
        before, now = self.at(tick - 1), self.at(tick)
        return [] if now is before else _numbers(now.paused & ~before.paused)

    def resumed(self, tick: int) -> list[int]:
        """Agents whose processes go on at this tick."""
        if not tick:
            return []
        before, now = self.at(tick - 1), self.at(tick)
        return [] if now is before else _numbers(before.paused & ~now.idle)

    def clock(self, tick: int) -> Integers:
        """What each agent's clock says in this tick, in ticks, shape (N,)."""
        reading = np.full(self.links.agents, tick)
        wrong = self.at(tick).under(Verb.CLOCK)
        for fault, _, agents in wrong:
            reading += agents * int(np.floor(fault.rate * (tick - fault.start) + _ROUNDING))
        return np.maximum(reading, 0) if wrong else reading

    def gains(self, tick: int) -> Array:
        """By how much each agent's clock gains in this tick, in seconds per second, shape (N,)."""
        gains = np.zeros(self.links.agents)
        for fault, _, agents in self.at(tick).under(Verb.CLOCK):
            gains += agents * fault.rate
        return gains

    def held(self, fault: int) -> Mask:
        """Links on which fault number `fault` acts, shape (L,)."""
        return self._link_masks[fault] | self.links.touching(self._agent_masks[fault])

    @property
    def warm(self) -> frozenset[int]:
        """Agents that at some time go on from their own last state."""
        return frozenset(agent for fault in self.faults if fault.warm for agent in fault.agents)

    @cached_property
    def _starts(self) -> dict[int, list[int]]:
        """Numbers of the faults that begin in a tick."""
        return _by_tick((number, fault.start) for number, fault in enumerate(self.faults) if fault.trigger is None)

    @cached_property
    def _ends(self) -> dict[int, list[int]]:
        """Numbers of the faults that hold no longer from a tick on."""
        placed = ((number, fault) for number, fault in enumerate(self.faults) if fault.trigger is None)
        return _by_tick((number, fault.end) for number, fault in placed if fault.end is not None)

    @cached_property
    def _boundaries(self) -> list[int]:
        return sorted({0, *self._starts, *self._ends})

    @cached_property
    def _in_force(self) -> list[list[int]]:
        """Numbers of the faults that hold from each boundary to the next."""
        segments, now = [], set[int]()
        for tick in self._boundaries:
            now = (now | set(self._starts.get(tick, ()))) - set(self._ends.get(tick, ()))
            segments.append(sorted(number for number in now if self.faults[number].active(tick)))
        return segments

    def _segment(self, number: int) -> Conditions:
        """What holds from a boundary to the next."""
        if number not in self._segments:
            if len(self._segments) == _KEPT:
                del self._segments[next(iter(self._segments))]
            self._segments[number] = self._conditions(self._in_force[number])
        return self._segments[number]

    def _conditions(self, in_force: Sequence[int]) -> Conditions:
        size, agents = len(self.links), self.links.agents

        def under(verb: Verb, masks: Sequence[Mask]) -> list[tuple[Fault, Mask]]:
            return [(self.faults[number], masks[number]) for number in in_force if self.faults[number].verb is verb]

        def links(*verbs: Verb, which: Callable[[Fault], bool] = lambda _: True) -> Mask:
            acting = [pair for verb in verbs for pair in under(verb, self._link_masks)]
            return np.logical_or.reduce([np.zeros(size, dtype=bool), *(m for f, m in acting if which(f))])

        def whom(verb: Verb, which: Callable[[Fault], bool] = lambda _: True) -> Mask:
            acting = under(verb, self._agent_masks)
            return np.logical_or.reduce([np.zeros(agents, dtype=bool), *(m for f, m in acting if which(f))])

        def chance(verb: Verb) -> Array:
            passing = np.ones(size)
            for fault, mask in under(verb, self._link_masks):
                passing = passing * np.where(mask, 1.0 - fault.probability, 1.0)
            return 1.0 - passing

        def sums(verb: Verb, masks: Sequence[Mask], rows: int) -> Array:
            acting = under(verb, masks)
            return sum((mask[:, None] * np.array(fault.vector) for fault, mask in acting), start=np.zeros((rows, 1)))

        def largest(verb: Verb, value: Callable[[Fault], float]) -> Array:
            acting = under(verb, self._link_masks)
            return np.max([np.zeros(size), *(mask * value(fault) for fault, mask in acting)], axis=0)

        dead, receiver = whom(Verb.KILL), self.links.dst - 1
        drops, holds = (
            (lambda fault, policy=policy: fault.under_way is policy) for policy in UnderWay if policy != "deliver"
        )
        delays = [mask * fault.seconds for fault, mask in under(Verb.DELAY, self._link_masks)]
        return Conditions(
            dead=dead,
            paused=whom(Verb.PAUSE) & ~dead,
            departed=whom(Verb.DEPART),
            drifting=whom(Verb.DEPART, lambda fault: fault.body is DepartedBody.DRIFT),
            vanished=whom(Verb.DEPART, lambda fault: fault.body is DepartedBody.VANISH),
            cut=links(Verb.CUT),
            partitioned=links(Verb.PARTITION),
            cut_drops=links(Verb.CUT, which=drops),
            partition_drops=links(Verb.PARTITION, which=drops),
            pause_drops=whom(Verb.PAUSE, drops)[receiver],
            holds=links(Verb.CUT, Verb.PARTITION, which=holds) | whom(Verb.PAUSE, holds)[receiver],
            loss=chance(Verb.LOSE),
            dropout=chance(Verb.DROPOUT),
            delay_s=np.sum([np.zeros(size), *delays], axis=0),
            profile=largest(Verb.DEGRADE, lambda fault: fault.profile).astype(np.uint8),
            frozen=links(Verb.FREEZE),
            bias=sums(Verb.BIAS, self._link_masks, size),
            push=sums(Verb.GUST, self._agent_masks, agents),
            outlier=chance(Verb.OUTLIER),
            deviation=largest(Verb.OUTLIER, lambda fault: fault.deviation),
            acting=tuple(Acting(self.faults[n], self._link_masks[n], self._agent_masks[n]) for n in in_force),
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


def _alike_once(faults: Iterable[Fault]) -> Iterable[Fault]:
    """One of each kind of faults that hold the same."""
    return {(fault.pairs, fault.groups, fault.agents): fault for fault in faults}.values()


def _numbers(agents: Mask) -> list[int]:
    """The numbers of those among all agents, shape (N,)."""
    return (np.flatnonzero(agents) + 1).tolist()


def _by_tick(placed: Iterable[tuple[int, int]]) -> dict[int, list[int]]:
    ticks: dict[int, list[int]] = {}
    for number, tick in placed:
        ticks.setdefault(tick, []).append(number)
    return ticks


def _placed(fault: Fault, tick: int) -> Fault:
    return replace(fault, trigger=None, start=tick + fault.start, end=None if fault.end is None else tick + fault.end)
