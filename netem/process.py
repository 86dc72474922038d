"""The medium as a process: it is also the run's only Zenoh router (`python -m netem`).

It reads, lets `Medium` decide, and writes; what it relays it does not look into beyond the envelope.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from typing import Any

import numpy as np
import zenoh

from netem import channels, wire
from netem.keys import Keys
from netem.links import Links, Mask
from netem.medium import Delivery, Fate, InFlight, Medium
from netem.profile import Profile
from netem.sequence import Numbering, Sequences
from netem.session import HUB, Login, await_subscribers, hub
from netem.supervised import Supervisor, patience
from netem.timeline import Fault, Timeline


@dataclass(frozen=True)
class MediumBrief:
    """All the medium process is told.

    Parameters
    ----------
    run
        The run's name, part of every key.
    login, dictionary_file
        Where to listen, and the file with everybody's password.
    seed, links, channels, profile, faults
        What the medium is made of.
    leaders
        Agents that have positioning, shape (N,).
    patience_s
        How long to wait for a broadcast before the run is stalled, in seconds.
    """

    run: str
    login: Login
    dictionary_file: str
    seed: int
    links: Links
    channels: tuple[str, ...]
    profile: Profile
    faults: tuple[Fault, ...]
    leaders: Mask
    patience_s: float


class Relay:
    """The medium of a run over Zenoh: one tick is sense, collect, deliver."""

    def __init__(self, session: zenoh.Session, brief: MediumBrief) -> None:
        self._brief = brief
        self._keys = Keys(brief.run)
        self._links = brief.links
        self._medium = Medium(brief.seed, brief.channels, brief.profile, Timeline(brief.links, brief.faults))
        self._spoken = [name for name in brief.channels if name != channels.SENSE]
        self._in_flight = InFlight()
        self._said: dict[tuple[int, int, str], bytes] = {}
        self._from_world = Sequences("world")
        self._from_agents = Sequences("agent")
        self._numbers = Numbering()
        self._sense = session.declare_subscriber(self._keys.sense, zenoh.handlers.FifoChannel(16))
        self._broadcasts = session.declare_subscriber(
            self._keys.broadcast("*", "*"), zenoh.handlers.FifoChannel(4096)
        )
        self._journal = session.declare_publisher(self._keys.journal)
        self._inboxes = {
            agent: session.declare_publisher(self._keys.inbox(agent)) for agent in range(1, brief.links.agents + 1)
        }

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        await_subscribers([*self._inboxes.values(), self._journal])

    def run(self) -> None:
        """Relay tick after tick until the world says that it was the last."""
        while True:
            sense = wire.unpack(wire.Sense, self._sense.recv().payload.to_bytes())
            self._from_world.check("sense", sense.seq)
            if sense.last:
                self._end(sense.k)
                return
            self._tick(sense)

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return len(self._in_flight)

    def _tick(self, sense: wire.Sense) -> None:
        alive = ~self._medium.timeline.at(sense.k).dead
        self._welcome_back(sense.k)
        fates = self._medium.judge(sense.k, self._offered(alive))
        self._hand_out_measurements(sense, fates[0] == Fate.DELIVERED, alive)
        self._collect(sense.k, alive)
        self._in_flight, delivery = self._medium.deliver(sense.k, self._in_flight, fates)
        self._hand_out_broadcasts(sense.k, delivery, alive)
        late = delivery.late[:, 1]
        self._journal.put(
            wire.pack(wire.Journal(sense.k, HUB, self._numbers.next("journal"), fates, late, delivery.dropped))
        )
        self._forget(sense.k)

    def _welcome_back(self, tick: int) -> None:
        for agent in self._medium.timeline.restarted(tick):
            self._numbers.restart(f"inbox {agent}")
            for name in self._spoken:
                self._from_agents.restart(f"{agent} {name}")

    def _offered(self, alive: Mask) -> Mask:
        speaks = alive[self._links.src - 1]
        return np.stack([np.ones_like(speaks) if name == channels.SENSE else speaks for name in self._brief.channels])

    def _hand_out_measurements(self, sense: wire.Sense, seen: Mask, alive: Mask) -> None:
        neighbours: dict[int, list[int]] = defaultdict(list)
        measured: dict[int, list[Any]] = defaultdict(list)
        for src, dst, y, arrived in zip(
            self._links.src.tolist(), self._links.dst.tolist(), sense.measured, seen.tolist(), strict=True
        ):
            if arrived:
                neighbours[dst].append(src)
                measured[dst].append(y)
        for agent in (np.flatnonzero(alive) + 1).tolist():
            position = sense.position[agent - 1] if self._brief.leaders[agent - 1] else None
            seq = self._numbers.next(f"inbox {agent}")
            inbox = wire.SenseInbox(
                sense.k, HUB, seq, wire.Phase.SENSE, neighbours[agent], measured[agent], position
            )
            self._inboxes[agent].put(wire.pack(inbox))

    def _collect(self, tick: int, alive: Mask) -> None:
        awaited = {(agent, name) for agent in (np.flatnonzero(alive) + 1).tolist() for name in self._spoken}
        with patience(self._brief.patience_s, lambda: _missing(tick, awaited)):
            while awaited:
                sample = self._broadcasts.recv()
                speaker = self._keys.speaker(str(sample.key_expr))
                data = sample.payload.to_bytes()
                said = wire.unpack(wire.Broadcast, data)
                if said.src != speaker or said.k != tick or (speaker, said.channel) not in awaited:
                    raise wire.WireError(
                        f"agent {speaker} said src {said.src}, tick {said.k}, channel {said.channel!r} on {sample.key_expr}"
                        f" in tick {tick}"
                    )
                self._from_agents.check(f"{speaker} {said.channel}", said.seq)
                self._said[tick, speaker, said.channel] = data
                awaited.remove((speaker, said.channel))

    def _hand_out_broadcasts(self, tick: int, delivery: Delivery, alive: Mask) -> None:
        inboxes: dict[int, list[bytes]] = defaultdict(list)
        for sent, link, channel in delivery.late.tolist():
            self._pass_on(inboxes, sent, link, channel)
        for link, channel in np.argwhere(delivery.sent.T == tick).tolist():
            if self._brief.channels[channel] != channels.SENSE:
                self._pass_on(inboxes, tick, link, channel)
        for agent in (np.flatnonzero(alive) + 1).tolist():
            seq = self._numbers.next(f"inbox {agent}")
            self._inboxes[agent].put(wire.pack_exchange(tick, seq, inboxes[agent]))

    def _pass_on(self, inboxes: dict[int, list[bytes]], sent: int, link: int, channel: int) -> None:
        src, dst = int(self._links.src[link]), int(self._links.dst[link])
        inboxes[dst].append(self._said[sent, src, self._brief.channels[channel]])

    def _forget(self, tick: int) -> None:
        awaited = {(sent, channel) for _, sent, channel, _ in self._in_flight.rows.tolist()}
        if not awaited:
            self._said.clear()
            return
        oldest = min(sent for sent, _ in awaited)
        self._said = {said: data for said, data in self._said.items() if said[0] >= oldest}

    def _end(self, tick: int) -> None:
        for agent, inbox in self._inboxes.items():
            inbox.put(wire.pack(wire.EndInbox(tick, HUB, self._numbers.next(f"inbox {agent}"), wire.Phase.END)))


def _missing(tick: int, awaited: set[tuple[int, str]]) -> str:
    shown = ", ".join(f"agent {agent}'s {channel}" for agent, channel in sorted(awaited)[:6])
    return f"{shown} of tick {tick}{' and more' if len(awaited) > 6 else ''}"


def main() -> None:
    """Run the medium until the run is over."""
    supervisor = Supervisor()
    brief = supervisor.brief(MediumBrief)
    config = hub(brief.login, brief.dictionary_file, Keys(brief.run), range(1, brief.links.agents + 1))
    with zenoh.open(config) as session:
        relay = Relay(session, brief)
        relay.await_everybody()
        supervisor.tell("ready")
        with supervisor.confessing():
            relay.run()
        supervisor.tell("done", in_flight=relay.in_flight)
        supervisor.await_order("leave")
