"""The medium's place on the network: whom it hears, and how it tells what was decided.

It does not look into what it relays, beyond the envelope, unless it changes it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from analysis.models.arrays import Array, Integers, Mask
from netem.brief import MediumBrief
from netem.core import channels
from netem.faults.control import Order
from netem.faults.timeline import Timeline
from netem.medium.entry import Entry
from netem.medium.medium import Medium, recorded
from netem.medium.relay import FaultedRelay
from netem.wire import messages
from netem.wire.arrays import CODE, WHOLE, channel_rows, numbers, packed
from netem.wire.broadcasts import Broadcasts
from netem.wire.carrier import Session, await_heard
from netem.wire.intake import Intake
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.senses import Senses
from netem.wire.sequence import Numbering
from netem.wire.session import HUB, clients
from netem.wire.wrong import WireError


class Seen(NamedTuple):
    """The measurements that arrive in a tick: their links, who is measured, and where those of each agent end, from 0 on."""

    links: Integers
    neighbours: list[int]
    ends: list[int]


class MediumPorts:
    """The medium's place on the network: whom it hears, and how it says what was decided."""

    def __init__(
        self, session: Session, brief: MediumBrief, relay: FaultedRelay, lost: Callable[[str, int], None] | None = None
    ) -> None:
        keys = Keys(brief.run)
        agents = range(1, brief.links.agents + 1)
        self._brief = brief
        self._relay = relay
        self._links = brief.links
        self._ends = np.concatenate([[0], np.cumsum(brief.links.degree)])
        self.spoken = [name for name in brief.channels if name != channels.SENSE]
        self.intake = Intake(brief.trust)
        neighbours = {agent: frozenset(brief.links.neighbours_of(agent)) for agent in agents}
        payloads = Payloads(brief.forms, neighbours, brief.dimension, brief.trust.foreign)
        self.reader = Broadcasts(keys, agents, self.spoken, payloads, in_real_time=brief.pace is not None, lost=lost)
        self._senses = Senses(len(brief.links), brief.links.agents, brief.dimension)
        self._numbers = Numbering()
        self._journal = session.says(keys.journal)
        self._control = session.answers(keys.control, 16)
        self._doorway = session.doorway(clients(agents, brief.hosts))
        self._inboxes = {agent: session.says(keys.inbox(agent)) for agent in agents}
        self._streams = {agent: f"inbox {agent}" for agent in agents}
        self._positioned = brief.positioned.tolist()
        self._rosters = {host: session.says(keys.roster(host)) for host in brief.hosts}

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        await_heard([*self._inboxes.values(), *self._rosters.values(), self._journal])

    def sense(self, data: bytes, tick: int) -> messages.Sense:
        """What the world senses in a tick.

        Raises
        ------
        WireError
            When it is something else.
        UninstructedLoss
            When something before it is missing.
        """
        return self._senses.read(data, tick)

    def where(self, sense: messages.Sense) -> Array:
        """The agents' positions, shape (N, D), in metres."""
        position: Array = numbers(sense.position, "the world: Sense: position", (len(self._inboxes), -1))
        return position

    def measured(self, sense: messages.Sense) -> Array | None:
        """What sensors said of every link, shape (L, D), where some may have said nothing."""
        if not self._brief.gaps:
            return None
        shape = (len(self._links), self._brief.dimension)
        measured: Array = numbers(sense.measured, "the world: Sense: measured", shape)
        return measured

    def refuse_strangers(self) -> None:
        """Look who has come in."""
        self._doorway.refuse_strangers()

    def obey_orders(self, tick: int) -> None:
        """Do what was asked of the medium, from this tick on."""
        while question := self._control.waiting():
            with question:
                try:
                    order = messages.unpack(Order, question.data)
                except WireError as error:
                    self.intake.note(None, error.wrong)
                    question.refuse(str(error))
                    continue
                question.answer(messages.pack(self._relay.obey(order, tick)))

    def welcome_back(self, tick: int) -> None:
        """Begin anew with those whose processes are new in this tick."""
        for agent in self._relay.timeline.restarted(tick):
            self._numbers.restart(self._streams[agent])
            self.reader.restart(agent)

    def call(self, tick: int, awake: Collection[int]) -> None:
        """Tell each host who of its agents takes part."""
        if not self._rosters:
            return
        restarted, remembering = (
            set(of(tick)) for of in (self._relay.timeline.restarted, self._relay.timeline.remembering)
        )
        for host, agents in self._brief.hosts.items():
            roster = messages.Roster(
                k=tick,
                src=HUB,
                seq=self._numbers.next(f"roster {host}"),
                awake=[agent for agent in agents if agent in awake],
                restarted=[agent for agent in agents if agent in restarted],
                remembering=[agent for agent in agents if agent in remembering],
            )
            self._rosters[host].say(messages.pack(roster))

    def seen(self, arrived: Mask) -> Seen:
        """The measurements that arrive, by the links (L,) whose do."""
        rows = np.flatnonzero(arrived)  # links toward one agent stand together
        return Seen(rows, self._links.src[rows].tolist(), np.searchsorted(rows, self._ends).tolist())

    def hand_out_measurements(
        self, sense: messages.Sense, awake: Iterable[int], seen: Seen, began: float | None = None
    ) -> None:
        """Tell those who are awake what they sense, and in real time when the run began, by the medium's clock."""
        timeline = self._relay.timeline
        clock = timeline.clock(sense.k).tolist()
        gains = [0.0] * len(clock) if began is None else timeline.gains(sense.k).tolist()
        links, neighbours, ends = seen
        measured, size = _rows(sense.measured, len(self._links), links)
        position = _parts(sense.position, len(self._inboxes))
        motion = None if sense.motion is None else _parts(sense.motion, len(self._inboxes))
        flown = None if sense.flown is None else _parts(sense.flown, len(self._inboxes))
        for agent in awake:
            start, end = ends[agent - 1], ends[agent]
            inbox = messages.SenseInbox(
                k=sense.k,
                src=HUB,
                seq=self._numbers.next(self._streams[agent]),
                clock=clock[agent - 1],
                neighbours=neighbours[start:end],
                measured=measured[start * size : end * size],
                position=position[agent - 1] if self._positioned[agent - 1] else None,
                motion=None if motion is None else motion[agent - 1],
                sighting=None if sense.sightings is None else sense.sightings[agent - 1],
                flown=None if flown is None else flown[agent - 1],
                began=began,
                gains=gains[agent - 1],
            )
            self._inboxes[agent].say(messages.pack(inbox))

    def hand_out_broadcasts(self, tick: int, agent: int, broadcasts: Sequence[bytes]) -> None:
        """Tell an agent what it hears."""
        seq = self._numbers.next(self._streams[agent])
        self._inboxes[agent].say(messages.pack_exchange(tick, seq, broadcasts))

    def journal(
        self, tick: int, entry: Entry, handed: list[int], punctuality: messages.Punctuality | None = None
    ) -> bytes:
        """What the world is told of a tick: what became of its messages, and how many were handed to each agent."""
        journal = messages.Journal(
            k=tick,
            src=HUB,
            seq=self._numbers.next("journal"),
            handed=handed,
            verdicts=packed(entry.verdicts, CODE),
            odd=packed(entry.odd, WHOLE),
            apart=packed(entry.apart, WHOLE),
            late=int(entry.late),
            dropped=packed(entry.dropped, WHOLE),
            released=packed(entry.released, WHOLE),
            injected=entry.injected,
            punctuality=punctuality,
        )
        return messages.pack(journal)

    def tell_the_world(self, journal: bytes) -> None:
        """Send it that."""
        self._journal.say(journal)

    def as_told(self, said: messages.Broadcast, data: bytes) -> bytes:
        """A broadcast as it was told: with the lies of who lies."""
        if not self._relay.lies(said.k, said.channel, said.src):
            return data
        return self._rewritten(
            said, lambda fields: self._relay.as_told(said.k, said.channel, np.array([said.src]), fields)
        )

    def as_it_arrives(self, data: bytes, row: Integers) -> bytes:
        """A broadcast as it arrives, which `row` says: (content tick, link row, channel row, mark)."""
        content, link, channel, mark = row[:, None]
        corrupted = mark.astype(np.uint8)
        said = messages.unpack(messages.Broadcast, data)
        return self._rewritten(
            said, lambda fields: self._relay.as_it_arrives(content, channel, link, corrupted, fields)
        )

    def _rewritten(self, said: messages.Broadcast, change: Callable[[dict[str, Any]], dict[str, Any]]) -> bytes:
        """A broadcast with its fields as `change` makes them; it sees them as those of one message, shape (1, ...)."""
        whose = f"agent {said.src} on {said.channel!r}"
        if said.channel == channels.MEASUREMENT:  # of as many neighbours as were measured
            measured = numbers(said.payload["measured"], f"{whose}: 'measured'", (-1, self._brief.dimension))
            payload = {**said.payload, "measured": packed(change({"measured": measured[None]})["measured"])}
        else:
            forms = self._brief.forms[said.channel]
            changed = change(channel_rows(forms, [said.payload], [whose]))
            payload = {name: packed(changed[name], form.dtype) for name, form in forms.items()}
        return messages.pack(replace(said, payload=payload))

    def end(self, tick: int) -> None:
        """Tell everybody that the run is over."""
        self.call(tick, self._inboxes.keys())
        for agent, inbox in self._inboxes.items():
            number = self._numbers.next(self._streams[agent])
            inbox.say(messages.pack(messages.EndInbox(k=tick, src=HUB, seq=number)))


def medium_of(brief: MediumBrief) -> Medium:
    """What decides."""
    timeline = Timeline(brief.links, brief.faults, brief.triggers, brief.injected)
    path = None if brief.recorded is None else Path(brief.recorded)
    judge = recorded(path, brief.links, brief.channels)
    return Medium(brief.seed, brief.channels, brief.profiles, timeline, judge)


def _parts(data: bytes, count: int) -> list[bytes]:
    """As many bytes for each."""
    size = len(data) // count
    return [data[start : start + size] for start in range(0, size * count, size)]


def _rows(data: bytes, count: int, which: Integers) -> tuple[bytes, int]:
    """Of as many bytes for each of so many, those of some, one after the other; and how many each has."""
    size = len(data) // count
    return np.frombuffer(data, f"V{size}", count)[which].tobytes(), size
