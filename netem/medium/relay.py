"""The relay of a run: who offers what, what becomes of it, and what its receivers are told; each runtime relays by this alone.

It keeps what was said for as long as somebody may hear it, and does not look into it: that is up to whoever carries it, as
arrays of all agents in one process, as bytes over the wire.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from analysis.models.arrays import Array, Integers, Mask, chosen
from netem.core.plain import to_plain
from netem.faults import control, lie
from netem.faults.conditions import Conditions
from netem.faults.control import Answer, Order
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.impairments.corrupt import Mark, Marks, corrupted_fields
from netem.medium.entry import Entry, out_of_the_ordinary
from netem.medium.in_flight import Delivery, Verdicts
from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

Said = TypeVar("Said")

# An enumeration member is compared ten times as slowly.
_STALE, _DELIVERED = int(Mark.STALE), int(Verdict.DELIVERED)


class Relayed(NamedTuple):
    """All that is decided of a tick before anybody speaks: verdicts ask who speaks to whom and when, never what is said.

    Parameters
    ----------
    tick
        Its number.
    conditions
        What the timeline imposes in it.
    verdicts, delivery
        What becomes of the messages offered, and what arrives.
    injected
        All faults injected so far, when one was injected or healed since the tick before.
    """

    tick: int
    conditions: Conditions
    verdicts: Verdicts
    delivery: Delivery
    injected: tuple[Fault, ...] | None

    @property
    def awake(self) -> Mask:
        """Agents whose processes hear and speak, shape (N,)."""
        return ~self.conditions.idle

    @property
    def seen(self) -> Mask:
        """Links whose measurement reaches the agent that made it, shape (L,)."""
        return self.verdicts.kind[0] == _DELIVERED

    @property
    def arriving(self) -> Integers:
        """What arrives, in this order: rows of (content tick, link row, channel row, mark), shape (m, 4)."""
        links, rows = np.nonzero(self.delivery.plain[1:].T)
        plain = np.stack([np.full_like(links, self.tick), links, rows + 1, np.zeros_like(links)], axis=-1)
        apart = self.delivery.apart
        rows = np.concatenate([apart, plain])
        return rows[np.lexsort(rows.T[::-1])] if len(apart) else rows

    @property
    def entry(self) -> Entry:
        """What is written down of it."""
        delivery = self.delivery
        return Entry(
            verdicts=self.verdicts.kind,
            odd=out_of_the_ordinary(self.tick, self.verdicts),
            apart=delivery.apart,
            late=delivery.late,
            dropped=delivery.dropped,
            released=delivery.released,
            injected=None if self.injected is None else to_plain(list(self.injected)),
        )


class FaultedRelay:
    """What every relay does with the faults of its run: it takes orders, fires triggers, and has liars lie.

    Parameters
    ----------
    medium
        What decides.
    """

    def __init__(self, medium: Medium) -> None:
        self._medium = medium
        self._told: tuple[Fault, ...] = ()

    @property
    def timeline(self) -> Timeline:
        """What is scripted and injected, as far as it is known by now."""
        return self._medium.timeline

    def fire(self, triggers: Iterable[int], tick: int) -> None:
        """From this tick on, what waited for these triggers holds."""
        self._medium.timeline = self.timeline.fired(triggers, tick)

    def obey(self, order: Order, tick: int) -> Answer:
        """Change what is injected, from this tick on."""
        self._medium.timeline, answer = control.obey(order, tick, self.timeline)
        return answer

    def lies(self, tick: int, channel: str, agent: int) -> bool:
        """Whether this agent says on this channel what is not so."""
        return any(agent in liar.agents for liar in self._liars(tick, channel))

    def as_told(self, tick: int, channel: str, agents: Integers, fields: Mapping[str, Any]) -> dict[str, Any]:
        """The named fields (m, ...) that these agents (m,) broadcast, with the lies of those who lie."""
        told = dict(fields)
        for liar in self._liars(tick, channel):
            lies, false = np.isin(agents, liar.agents), lie.told(told, liar)
            told = {name: chosen(lies, false[name], true) for name, true in told.items()}
        return told

    def as_it_arrives(
        self, content: Integers, channel: Integers, link: Integers, mark: Marks, fields: Mapping[str, Any]
    ) -> dict[str, Any]:
        """The named fields (m, ...) of messages as they arrive, by their marks.

        Parameters
        ----------
        content, channel, link, mark
            Of each message: the tick it speaks of, its rows, and how it is corrupted, shape (m,).
        fields
            As they were told.
        """
        draw = self._medium.bit_draws(content, channel, link)
        return corrupted_fields(fields, mark, self._medium.bias(content, link), draw)

    def _newly_injected(self) -> tuple[Fault, ...] | None:
        """All faults injected so far, when one was injected or healed since this was asked last."""
        injected = self.timeline.injected
        changed, self._told = injected != self._told, injected
        return injected if changed else None

    def _liars(self, tick: int, channel: str) -> tuple[Fault, ...]:
        return self.timeline.at(tick).liars if channel == lie.CHANNEL else ()


class Relay(FaultedRelay, Generic[Said]):
    """Relays tick after tick: decide, keep what is said, hand it out, finish.

    Parameters
    ----------
    medium
        What decides.
    """

    def __init__(self, medium: Medium) -> None:
        super().__init__(medium)
        self._state = self._decided = medium.begin()
        self._said: dict[int, Said] = {}

    @property
    def in_flight(self) -> int:
        """Messages under way after the last tick that is finished."""
        return self._state.in_flight

    @property
    def under_way(self) -> Integers:
        """Of them, those on each link, shape (L,)."""
        return self._state.over_links()

    @property
    def ahead(self) -> bool:
        """Whether a tick can be decided before it is known where the agents are."""
        return self._medium.ahead

    def decide(self, tick: int, position: Array | None, measured: Array | None = None) -> Relayed:
        """What becomes of a tick in which all who are awake speak to all their neighbours.

        Parameters
        ----------
        tick
            Its number: one after the tick that was finished last.
        position
            The agents', shape (N, D), in metres; only a spatial profile needs them.
        measured
            What sensors said, shape (L, D), NaN of those that said nothing; None where all said something.
        """
        return self.decide_on(tick, self._medium.offered(tick, measured), position)

    def decide_on(self, tick: int, offered: Mask, position: Array | None) -> Relayed:
        """What becomes of a tick in which a message is offered where `offered` says so, shape (C, L)."""
        state, verdicts = self._medium.judge(self._state, tick, offered, position)
        self._decided, delivery = self._medium.deliver(state, tick, verdicts)
        return Relayed(tick, self.timeline.at(tick), verdicts, delivery, self._newly_injected())

    def under(self, timeline: Timeline) -> Relay[Said]:
        """A relay that goes on from here under another timeline, tick by tick beside this one."""
        other = copy(self)
        other._medium = self._medium.under(timeline)
        return other

    def keep(self, tick: int, said: Said) -> None:
        """Keep what was said in a tick, as it was told."""
        self._said[tick] = said

    def said(self, tick: int) -> Said:
        """What was said in a tick of which somebody may still hear."""
        return self._said[tick]

    def finish(self, tick: int) -> None:
        """The tick that was decided last is over; what nobody will hear any more is forgotten."""
        self._state = self._decided
        oldest = self._state.oldest_sent(tick) - 1  # a stale message says what was said the tick before it was sent
        self._said = {sent: said for sent, said in self._said.items() if sent >= oldest}


def changed_on_the_way(mark: Marks | int) -> Any:
    """Whether a message arrives as something that nobody said, by its mark, or where, by marks of any shape."""
    return mark > _STALE
