"""The medium of a run in lockstep: it waits for what everybody says in a tick, and then delivers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers
from netem.brief import MediumBrief
from netem.medium.entry import Entry
from netem.medium.relay import Relay, Relayed, changed_on_the_way
from netem.ports import MediumPorts, Seen, medium_of
from netem.processes.supervised import Supervisor, called
from netem.wire.carrier import Session
from netem.wire.keys import Keys
from netem.wire.session import WORLD

if TYPE_CHECKING:
    from netem.medium.journal import Writer

Spoken = dict[tuple[int, str], bytes]  # broadcasts of a tick, by who says them and on which channel


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


class LockstepNode:
    """The medium of a run in lockstep: one tick is sense, collect, deliver."""

    def __init__(self, session: Session, supervisor: Supervisor, brief: MediumBrief, journal: Writer) -> None:
        keys = Keys(brief.run)
        self._supervisor, self._written, self._links = supervisor, journal, brief.links
        self._relay = Relay[Spoken](medium_of(brief))
        self._ports = MediumPorts(session, brief, self._relay)
        supervisor.counts(lambda: self._ports.intake.refused)
        self._channels, self._has_gaps = len(brief.channels), brief.gaps
        self._agents = np.arange(1, brief.links.agents + 2)
        self._voices = [(agent, name) for agent in self._agents[:-1].tolist() for name in brief.channels]
        self._awaited: set[tuple[int, str]] = set()
        self._sense = session.hears(keys.sense, 16)
        self._broadcasts = session.hears_anybody(keys.broadcast("*", "*"), len(self._voices))

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        self._ports.await_everybody()

    def run(self) -> None:
        """Relay tick after tick until the world says that it was the last."""
        decided = self._decide(0, None) if self._ahead else None
        tick = 0
        while True:
            self._supervisor.waits(tick, "what it senses", lambda: (WORLD,))
            sense = self._ports.sense(self._sense.next().data, tick)
            self._supervisor.works(sense.k)
            self._ports.refuse_strangers()
            if sense.last:
                self._ports.end(sense.k)
                return
            if sense.fired:
                self._relay.fire(sense.fired, sense.k)
            if decided is None:
                decided = self._decide(sense.k, self._ports.where(sense), self._ports.measured(sense))
            self._ports.welcome_back(sense.k)
            self._ports.call(sense.k, set(decided.awake))
            self._ports.hand_out_measurements(sense, decided.awake, decided.seen)
            self._ports.tell_the_world(decided.journal)
            self._collect(decided)
            self._hand_out_broadcasts(decided)
            # The agents now work on what they heard: time to write down, and to decide the next tick, where that needs no
            # positions.
            self._relay.finish(sense.k)
            self._written.enter(decided.entry, self._relay.in_flight, self._supervisor.lost_anywhere())
            tick = sense.k + 1
            decided = self._decide(tick, None) if self._ahead else None

    @property
    def _ahead(self) -> bool:
        """Whether a tick can be decided before anything is sensed in it."""
        return self._relay.ahead and not self._has_gaps

    def _decide(self, tick: int, position: Array | None, measured: Array | None = None) -> Decided:
        self._ports.obey_orders(tick)
        relayed = self._relay.decide(tick, position, measured)
        heard, entry = self._heard(relayed.arriving), relayed.entry
        journal = self._ports.journal(tick, entry, np.diff(heard.ends).tolist())
        awake = tuple((np.flatnonzero(relayed.awake) + 1).tolist())
        return Decided(relayed, awake, self._ports.seen(relayed.seen), heard, entry, journal)

    def _heard(self, arriving: Integers) -> Heard:
        receiver = self._links.dst[arriving[:, 1]]
        by_receiver = np.argsort(receiver, kind="stable")
        rows = arriving[by_receiver]
        content, link, channel, mark = rows.T
        voices = (self._links.src[link] - 1) * self._channels + channel
        return Heard(
            content=content.tolist(),
            said=[self._voices[voice] for voice in voices.tolist()],
            changed=np.flatnonzero(changed_on_the_way(mark)).tolist(),
            rows=rows,
            ends=np.searchsorted(receiver[by_receiver], self._agents).tolist(),
        )

    def _collect(self, decided: Decided) -> None:
        tick, said = decided.relayed.tick, Spoken()
        self._awaited = {(agent, name) for agent in decided.awake for name in self._ports.spoken}
        self._supervisor.waits(tick, "what it broadcasts", self._silent)
        somebody_lies = bool(decided.relayed.conditions.liars)
        while self._awaited:
            arrived = self._broadcasts.next()
            broadcast = self._ports.intake.take(arrived, tick, self._awaited, self._ports.reader)
            if broadcast is None:
                continue
            self._awaited.remove((broadcast.src, broadcast.channel))
            said[broadcast.src, broadcast.channel] = (
                self._ports.as_told(broadcast, arrived.data) if somebody_lies else arrived.data
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
            arriving[n] = self._ports.as_it_arrives(arriving[n], heard.rows[n])
        for agent in decided.awake:
            self._ports.hand_out_broadcasts(decided.relayed.tick, agent, arriving[ends[agent - 1] : ends[agent]])
