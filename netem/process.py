"""The medium as a process: it is also the run's only Zenoh router (`python -m netem`).

It reads, lets `Relay` decide, and writes, the journal too; it does not look into what it relays, beyond the envelope, unless it
changes it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels
from netem.core.links import Links
from netem.faults.control import Order
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.impairments.profile import Profile
from netem.medium.in_flight import Entry
from netem.medium.medium import Medium, recorded
from netem.medium.relay import Relay, Relayed, changed_on_the_way
from netem.processes.supervised import Supervisor, called
from netem.wire import messages
from netem.wire.arrays import CODE, WHOLE, Form, channel_rows, numbers, packed
from netem.wire.broadcasts import Broadcasts
from netem.wire.carrier import Session, await_heard
from netem.wire.intake import Intake, Trust
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.senses import Senses
from netem.wire.sequence import Numbering
from netem.wire.session import HUB, HUB_ENVIRONMENT, WORLD, Login, hub
from netem.wire.wrong import WireError

if TYPE_CHECKING:
    from netem.medium.journal import Writer

Spoken = dict[tuple[int, str], bytes]  # broadcasts of a tick, by who says them and on which channel


@dataclass(frozen=True)
class MediumBrief:
    """All the medium process is told.

    Parameters
    ----------
    run
        The run's name, part of every key.
    login, dictionary_file
        Where to listen, and the file with everybody's password.
    seed, links, channels, profiles, faults, triggers
        What the medium is made of.
    injected
        Faults that an earlier run was given while it flew.
    recorded
        The journal of an earlier run that is to be judge of this one.
    dimension, forms
        D, and what the fields of each channel hold that agents look into.
    positioned
        Agents that have positioning, shape (N,).
    hosts
        For each process that carries several agents, which.
    trust
        What is taken from agents.
    journal, batch
        The file to write down every verdict in, and how many ticks at once.
    """

    run: str
    login: Login
    dictionary_file: str
    seed: int
    links: Links
    channels: tuple[str, ...]
    profiles: tuple[Profile, ...]
    faults: tuple[Fault, ...]
    triggers: tuple[Trigger, ...]
    injected: tuple[Fault, ...]
    recorded: str | None
    dimension: int
    forms: Mapping[str, Mapping[str, Form]]
    positioned: Mask
    hosts: Mapping[int, tuple[int, ...]]
    trust: Trust
    journal: str
    batch: int


class Seen(NamedTuple):
    """The measurements that arrive in a tick: their links, who is measured, and where those of each agent end, from 0 on."""

    links: Integers
    neighbours: list[int]
    ends: list[int]


class Heard(NamedTuple):
    """The broadcasts that arrive in a tick, by receiver, and to each in order.

    Parameters
    ----------
    content, said
        The tick each speaks of, and who said it on which channel.
    changed
        Which of them arrive as something that nobody said.
    rows
        What `Relayed.arriving` has of each.
    ends
        Where those of each agent end, from 0 on.
    """

    content: list[int]
    said: list[tuple[int, str]]
    changed: list[int]
    rows: Integers
    ends: list[int]


@dataclass(frozen=True)
class Decided:
    """A tick as it was decided, ready to be handed out.

    Parameters
    ----------
    relayed
        What was decided.
    awake
        Numbers of the agents that hear and speak.
    seen, heard
        The measurements and the broadcasts that arrive.
    entry, journal
        What is written down of it, and told the world.
    """

    relayed: Relayed
    awake: tuple[int, ...]
    seen: Seen
    heard: Heard
    entry: Entry
    journal: bytes


class MediumNode:
    """The medium of a run on the network: one tick is sense, collect, deliver."""

    def __init__(self, session: Session, supervisor: Supervisor, brief: MediumBrief, journal: Writer) -> None:
        keys = Keys(brief.run)
        agents = range(1, brief.links.agents + 1)
        self._brief = brief
        self._supervisor = supervisor
        self._written = journal
        self._awaited: set[tuple[int, str]] = set()
        self._links = brief.links
        self._ends = np.concatenate([[0], np.cumsum(brief.links.degree)])
        self._agents = np.arange(1, brief.links.agents + 2)
        timeline = Timeline(brief.links, brief.faults, brief.triggers, brief.injected)
        path = None if brief.recorded is None else Path(brief.recorded)
        verdicts = recorded(path, brief.links, brief.channels)
        self._relay = Relay[Spoken](Medium(brief.seed, brief.channels, brief.profiles, timeline, verdicts))
        self._spoken = [name for name in brief.channels if name != channels.SENSE]
        self._voices = [(agent, name) for agent in agents for name in brief.channels]
        self._senses = Senses(len(brief.links), brief.links.agents, brief.dimension)
        self._intake = Intake(brief.trust)
        supervisor.counts(lambda: self._intake.refused)
        neighbours = {agent: frozenset(brief.links.neighbours_of(agent)) for agent in agents}
        payloads = Payloads(brief.forms, neighbours, brief.dimension, brief.trust.foreign)
        self._reader = Broadcasts(keys, agents, self._spoken, payloads)
        self._numbers = Numbering()
        self._sense = session.hears(keys.sense, 16)
        self._broadcasts = session.hears_anybody(keys.broadcast("*", "*"), len(self._voices))
        self._journal = session.says(keys.journal)
        self._control = session.answers(keys.control, 16)
        self._inboxes = {agent: session.says(keys.inbox(agent)) for agent in agents}
        self._streams = {agent: f"inbox {agent}" for agent in agents}
        self._positioned = brief.positioned.tolist()
        self._rosters = {host: session.says(keys.roster(host)) for host in brief.hosts}

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        await_heard([*self._inboxes.values(), *self._rosters.values(), self._journal])

    def run(self) -> None:
        """Relay tick after tick until the world says that it was the last."""
        decided = self._decide(0, None) if self._relay.ahead else None
        tick = 0
        while True:
            self._supervisor.waits(tick, "what it senses", lambda: (WORLD,))
            sense = self._senses.read(self._sense.next().data, tick)
            self._supervisor.works(sense.k)
            if sense.last:
                self._end(sense.k)
                return
            if sense.fired:
                self._relay.fire(sense.fired, sense.k)
            if decided is None:
                where = numbers(sense.position, "the world: Sense: position", (len(self._inboxes), -1))
                decided = self._decide(sense.k, where)
            self._welcome_back(sense.k)
            self._call(sense.k, set(decided.awake))
            self._hand_out_measurements(sense, decided)
            self._journal.say(decided.journal)
            self._collect(decided)
            self._hand_out_broadcasts(decided)
            # The agents now work on what they heard: time to write down, and to decide the next tick, where that needs no
            # positions.
            self._relay.finish(sense.k)
            self._written.enter(decided.entry, self._relay.in_flight)
            tick = sense.k + 1
            decided = self._decide(tick, None) if self._relay.ahead else None

    def _decide(self, tick: int, position: Array | None) -> Decided:
        self._obey_orders(tick)
        relayed = self._relay.decide(tick, position)
        heard, entry = self._heard(relayed.arriving), relayed.entry
        journal = messages.Journal(
            k=tick,
            src=HUB,
            seq=self._numbers.next("journal"),
            handed=np.diff(heard.ends).tolist(),
            verdicts=packed(entry.verdicts, CODE),
            odd=packed(entry.odd, WHOLE),
            apart=packed(entry.apart, WHOLE),
            late=int(entry.late),
            dropped=packed(entry.dropped, WHOLE),
            released=packed(entry.released, WHOLE),
            injected=entry.injected,
        )
        awake = tuple((np.flatnonzero(relayed.awake) + 1).tolist())
        return Decided(relayed, awake, self._seen(relayed.seen), heard, entry, messages.pack(journal))

    def _obey_orders(self, tick: int) -> None:
        while question := self._control.waiting():
            with question:
                try:
                    order = messages.unpack(Order, question.data)
                except WireError as error:
                    self._intake.note(None, error.wrong)
                    question.refuse(str(error))
                    continue
                question.answer(messages.pack(self._relay.obey(order, tick)))

    def _seen(self, arrived: Mask) -> Seen:
        rows = np.flatnonzero(arrived)  # links toward one agent stand together
        return Seen(rows, self._links.src[rows].tolist(), np.searchsorted(rows, self._ends).tolist())

    def _heard(self, arriving: Integers) -> Heard:
        receiver = self._links.dst[arriving[:, 1]]
        by_receiver = np.argsort(receiver, kind="stable")
        rows = arriving[by_receiver]
        content, link, channel, mark = rows.T
        voices = (self._links.src[link] - 1) * len(self._brief.channels) + channel
        return Heard(
            content=content.tolist(),
            said=[self._voices[voice] for voice in voices.tolist()],
            changed=np.flatnonzero(changed_on_the_way(mark)).tolist(),
            rows=rows,
            ends=np.searchsorted(receiver[by_receiver], self._agents).tolist(),
        )

    def _welcome_back(self, tick: int) -> None:
        for agent in self._relay.timeline.restarted(tick):
            self._numbers.restart(self._streams[agent])
            self._reader.restart(agent)

    def _call(self, tick: int, awake: Collection[int]) -> None:
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

    def _hand_out_measurements(self, sense: messages.Sense, decided: Decided) -> None:
        clock = self._relay.timeline.clock(sense.k).tolist()
        links, neighbours, ends = decided.seen
        measured, size = _rows(sense.measured, len(self._links), links)
        position = _parts(sense.position, len(self._inboxes))
        motion = None if sense.motion is None else _parts(sense.motion, len(self._inboxes))
        for agent in decided.awake:
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
            )
            self._inboxes[agent].say(messages.pack(inbox))

    def _collect(self, decided: Decided) -> None:
        tick, said = decided.relayed.tick, Spoken()
        self._awaited = {(agent, name) for agent in decided.awake for name in self._spoken}
        self._supervisor.waits(tick, "what it broadcasts", self._silent)
        somebody_lies = bool(decided.relayed.conditions.liars)
        while self._awaited:
            arrived = self._broadcasts.next()
            broadcast = self._intake.take(arrived, tick, self._awaited, self._reader)
            if broadcast is None:
                continue
            self._awaited.remove((broadcast.src, broadcast.channel))
            said[broadcast.src, broadcast.channel] = (
                self._as_told(broadcast, arrived.data) if somebody_lies else arrived.data
            )
        self._relay.keep(tick, said)
        self._supervisor.works(tick)

    def _silent(self) -> list[str]:
        return [called(agent) for agent in sorted({agent for agent, _ in tuple(self._awaited)})]

    def _hand_out_broadcasts(self, decided: Decided) -> None:
        heard, ends = decided.heard, decided.heard.ends
        said = {tick: self._relay.said(tick) for tick in set(heard.content)}
        arriving = [said[tick][whose] for tick, whose in zip(heard.content, heard.said, strict=True)]
        for n in heard.changed:
            arriving[n] = self._as_it_arrives(arriving[n], heard.rows[n])
        for agent in decided.awake:
            seq = self._numbers.next(self._streams[agent])
            handed = arriving[ends[agent - 1] : ends[agent]]
            self._inboxes[agent].say(messages.pack_exchange(decided.relayed.tick, seq, handed))

    def _as_told(self, said: messages.Broadcast, data: bytes) -> bytes:
        if not self._relay.lies(said.k, said.channel, said.src):
            return data
        return self._rewritten(
            said, lambda fields: self._relay.as_told(said.k, said.channel, np.array([said.src]), fields)
        )

    def _as_it_arrives(self, data: bytes, row: Integers) -> bytes:
        content, link, channel, mark = row[:, None]
        corrupted = mark.astype(np.uint8)
        said = messages.unpack(messages.Broadcast, data)
        return self._rewritten(
            said, lambda fields: self._relay.as_it_arrives(content, channel, link, corrupted, fields)
        )

    def _rewritten(self, said: messages.Broadcast, change: Callable[[dict[str, Any]], dict[str, Any]]) -> bytes:
        """A broadcast with its fields as `change` makes them; it sees them as those of one message, shape (1, ...)."""
        if (forms := self._brief.forms.get(said.channel)) is None:  # nobody looks into it
            return messages.pack(said)
        changed = change(channel_rows(forms, [said.payload], [f"agent {said.src} on {said.channel!r}"]))
        payload = {name: packed(changed[name], form.dtype) for name, form in forms.items()}
        return messages.pack(replace(said, payload=payload))

    def _end(self, tick: int) -> None:
        self._call(tick, self._inboxes.keys())
        for agent, inbox in self._inboxes.items():
            number = self._numbers.next(self._streams[agent])
            inbox.say(messages.pack(messages.EndInbox(k=tick, src=HUB, seq=number)))


def _parts(data: bytes, count: int) -> list[bytes]:
    """As many bytes for each."""
    size = len(data) // count
    return [data[start : start + size] for start in range(0, size * count, size)]


def _rows(data: bytes, count: int, which: Integers) -> tuple[bytes, int]:
    """Of as many bytes for each of so many, those of some, one after the other; and how many each has."""
    size = len(data) // count
    return np.frombuffer(data, f"V{size}", count)[which].tobytes(), size


def main() -> None:
    """Run the medium until the run is over."""
    os.environ |= HUB_ENVIRONMENT
    supervisor = Supervisor()
    brief = supervisor.brief(MediumBrief)
    config = hub(brief.login, brief.dictionary_file, Keys(brief.run), range(1, brief.links.agents + 1), brief.hosts)
    with supervisor.confessing(), Session(config) as session:
        # These take a while to import: everybody else can log in by now.
        from netem.core.arrow import do_without_pandas
        from netem.medium import journal

        do_without_pandas()
        with journal.Writer(Path(brief.journal), brief.links, brief.channels, brief.batch) as writer:
            node = MediumNode(session, supervisor, brief, writer)
            node.await_everybody()
            supervisor.tell("ready")
            node.run()
        supervisor.tell("done")
        supervisor.await_order("leave")
