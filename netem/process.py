"""The medium as a process: it is also the run's only Zenoh router (`python -m netem`).

It reads, lets `Medium` decide, and writes; what it relays it does not look into beyond the envelope.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Sentence:
    """All that is decided of a tick before it begins: verdicts ask who speaks to whom and when, never what is said.

    Parameters
    ----------
    tick
        k.
    alive
        Numbers of the agents whose processes live.
    seen
        For each agent, the neighbours whose measurement reaches it, and the link rows these stand in.
    heard
        For each agent, the broadcasts that reach it: (tick sent, source, channel), in order.
    journal
        The verdicts, packed for the world.
    """

    tick: int
    alive: tuple[int, ...]
    seen: dict[int, tuple[list[int], list[int]]]
    heard: dict[int, list[tuple[int, int, str]]]
    journal: bytes


class Relay:
    """The medium of a run over Zenoh: one tick is sense, collect, deliver."""

    def __init__(self, session: zenoh.Session, brief: MediumBrief) -> None:
        keys = Keys(brief.run)
        agents = range(1, brief.links.agents + 1)
        self._brief = brief
        self._links = brief.links
        self._medium = Medium(brief.seed, brief.channels, brief.profile, Timeline(brief.links, brief.faults))
        self._spoken = [name for name in brief.channels if name != channels.SENSE]
        self._in_flight = self._after = InFlight()
        self._said: dict[tuple[int, int, str], bytes] = {}
        self._from_world = Sequences("world")
        self._from_agents = Sequences("agent")
        self._numbers = Numbering()
        self._sense = session.declare_subscriber(keys.sense, zenoh.handlers.FifoChannel(16))
        self._broadcasts = session.declare_subscriber(keys.broadcast("*", "*"), zenoh.handlers.FifoChannel(4096))
        self._speaking = {keys.broadcast(agent, name): (agent, name) for agent in agents for name in self._spoken}
        self._journal = session.declare_publisher(keys.journal)
        self._inboxes = {agent: session.declare_publisher(keys.inbox(agent)) for agent in agents}

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return len(self._in_flight)

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        await_subscribers([*self._inboxes.values(), self._journal])

    def run(self) -> None:
        """Relay tick after tick until the world says that it was the last."""
        sentence = self._judge(0)
        while True:
            sense = wire.unpack(wire.Sense, self._sense.recv().payload.to_bytes())
            self._from_world.check("sense", sense.seq)
            if sense.last:
                self._end(sense.k)
                return
            self._welcome_back(sense.k)
            self._hand_out_measurements(sense, sentence)
            self._journal.put(sentence.journal)
            self._collect(sentence)
            self._hand_out_broadcasts(sentence)
            # The agents now work on what they heard: time to decide the next tick.
            self._in_flight = self._after
            self._forget()
            sentence = self._judge(sense.k + 1)

    def _judge(self, tick: int) -> Sentence:
        alive = ~self._medium.timeline.at(tick).dead
        speaks = alive[self._links.src - 1]
        offered = np.stack([speaks | (name == channels.SENSE) for name in self._brief.channels])
        fates = self._medium.judge(tick, offered)
        self._after, delivery = self._medium.deliver(tick, self._in_flight, fates)
        seen, heard = self._seen(fates[0] == Fate.DELIVERED), self._heard(tick, delivery)
        journal = wire.Journal(
            k=tick,
            src=HUB,
            seq=self._numbers.next("journal"),
            fates=fates,
            handed=[len(heard[agent]) for agent in self._inboxes],
            late=len(delivery.late),
            dropped=delivery.dropped,
        )
        return Sentence(tick, tuple((np.flatnonzero(alive) + 1).tolist()), seen, heard, wire.pack(journal))

    def _seen(self, arrived: Mask) -> dict[int, tuple[list[int], list[int]]]:
        seen: dict[int, tuple[list[int], list[int]]] = defaultdict(lambda: ([], []))
        rows = np.flatnonzero(arrived)
        for row, src, dst in zip(
            rows.tolist(), self._links.src[rows].tolist(), self._links.dst[rows].tolist(), strict=True
        ):
            neighbours, links = seen[dst]
            neighbours.append(src)
            links.append(row)
        return seen

    def _heard(self, tick: int, delivery: Delivery) -> dict[int, list[tuple[int, int, str]]]:
        # Late ones first, then those of this tick: sorted by tick, source and channel, as links and channels are.
        fresh: Mask = np.equal(delivery.sent[1:].T, tick)
        links, rows = np.nonzero(fresh)
        on_time = np.stack([np.full_like(links, tick), links, rows + 1], axis=-1)
        arriving = np.concatenate([delivery.late, on_time])
        sources, receivers = (
            self._links.src[arriving[:, 1]].tolist(),
            self._links.dst[arriving[:, 1]].tolist(),
        )
        heard: dict[int, list[tuple[int, int, str]]] = defaultdict(list)
        for (sent, _, channel), src, dst in zip(arriving.tolist(), sources, receivers, strict=True):
            heard[dst].append((sent, src, self._brief.channels[channel]))
        return heard

    def _welcome_back(self, tick: int) -> None:
        for agent in self._medium.timeline.restarted(tick):
            self._numbers.restart(f"inbox {agent}")
            for name in self._spoken:
                self._from_agents.restart(f"{agent} {name}")

    def _hand_out_measurements(self, sense: wire.Sense, sentence: Sentence) -> None:
        for agent in sentence.alive:
            neighbours, links = sentence.seen[agent]
            inbox = wire.SenseInbox(
                k=sense.k,
                src=HUB,
                seq=self._numbers.next(f"inbox {agent}"),
                phase=wire.Phase.SENSE,
                neighbours=neighbours,
                measured=[sense.measured[link] for link in links],
                position=sense.position[agent - 1] if self._brief.leaders[agent - 1] else None,
            )
            self._inboxes[agent].put(wire.pack(inbox))

    def _collect(self, sentence: Sentence) -> None:
        tick = sentence.tick
        awaited = {(agent, name) for agent in sentence.alive for name in self._spoken}
        with patience(self._brief.patience_s, lambda: _missing(tick, awaited)):
            while awaited:
                sample = self._broadcasts.recv()
                key, data = str(sample.key_expr), sample.payload.to_bytes()
                said = wire.unpack(wire.Broadcast, data)
                if self._speaking.get(key) != (said.src, said.channel) or said.k != tick:
                    raise wire.WireError(
                        f"in tick {tick}, {key} said: agent {said.src}, {said.channel!r} of tick {said.k}"
                    )
                self._from_agents.check(f"{said.src} {said.channel}", said.seq)
                self._said[tick, said.src, said.channel] = data
                awaited.remove((said.src, said.channel))

    def _hand_out_broadcasts(self, sentence: Sentence) -> None:
        for agent in sentence.alive:
            arriving = [self._said[said] for said in sentence.heard[agent]]
            seq = self._numbers.next(f"inbox {agent}")
            self._inboxes[agent].put(wire.pack_exchange(sentence.tick, seq, arriving))

    def _forget(self) -> None:
        if not len(self._in_flight):
            self._said.clear()
            return
        oldest = self._in_flight.rows[:, 1].min()
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
