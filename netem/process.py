"""The medium as a process: it is also the run's only Zenoh router (`python -m netem`).

It reads, lets `Medium` decide, and writes; it does not look into what it relays, beyond the envelope, unless it corrupts it.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zenoh

from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels
from netem.core.links import Links
from netem.faults import lie
from netem.faults.control import Order, obey
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.impairments.corrupt import Mark, corrupted_fields
from netem.impairments.profile import Profile
from netem.medium.in_flight import Delivery, out_of_the_ordinary
from netem.medium.medium import Medium, recorded
from netem.medium.verdict import Fate
from netem.processes.supervised import Supervisor, called
from netem.wire import messages
from netem.wire.broadcasts import Broadcasts, fields
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering, Sequences
from netem.wire.session import HUB, WORLD, Login, await_subscribers, hub


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
    positioned
        Agents that have positioning, shape (N,).
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
    positioned: Mask


@dataclass(frozen=True)
class Arriving:
    """A broadcast on its way into an inbox: the tick it speaks of, who said it on which link and channel, how corrupted."""

    content: int
    src: int
    channel: int
    link: int
    mark: int


@dataclass(frozen=True)
class TickVerdicts:
    """All that is decided of a tick before anybody speaks: verdicts ask who speaks to whom and when, never what is said.

    Parameters
    ----------
    tick
        k.
    awake
        Numbers of the agents whose processes live and run.
    seen
        For each agent, the neighbours whose measurement reaches it, and the link rows these stand in.
    heard
        For each agent, the broadcasts that reach it, in order.
    journal
        The verdicts, packed for the world.
    """

    tick: int
    awake: tuple[int, ...]
    seen: dict[int, tuple[list[int], list[int]]]
    heard: dict[int, list[Arriving]]
    journal: bytes


class MediumNode:
    """The medium of a run over Zenoh: one tick is sense, collect, deliver."""

    def __init__(self, session: zenoh.Session, supervisor: Supervisor, brief: MediumBrief) -> None:
        keys = self._keys = Keys(brief.run)
        agents = range(1, brief.links.agents + 1)
        self._brief = brief
        self._supervisor = supervisor
        self._awaited: set[tuple[int, str]] = set()
        self._links = brief.links
        self._injected = brief.injected
        self._scripted = Timeline(brief.links, brief.faults, brief.triggers)
        self._timeline = self._scripted.facing(brief.injected)
        path = None if brief.recorded is None else Path(brief.recorded)
        verdicts = recorded(path, brief.links, brief.channels)
        self._medium = Medium(brief.seed, brief.channels, brief.profiles, self._timeline, verdicts)
        self._air = self._ahead = self._medium.begin()
        self._spoken = [name for name in brief.channels if name != channels.SENSE]
        self._said: dict[tuple[int, int, str], bytes] = {}
        self._from_world = Sequences("world")
        self._reader = Broadcasts(keys, agents, self._spoken)
        self._numbers = Numbering()
        self._sense = session.declare_subscriber(keys.sense, zenoh.handlers.FifoChannel(16))
        self._broadcasts = session.declare_subscriber(keys.broadcast("*", "*"), zenoh.handlers.FifoChannel(4096))
        self._journal = session.declare_publisher(keys.journal)
        self._control = session.declare_queryable(keys.control, zenoh.handlers.FifoChannel(16))
        self._inboxes = {agent: session.declare_publisher(keys.inbox(agent)) for agent in agents}

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return self._air.in_flight

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        await_subscribers([*self._inboxes.values(), self._journal])

    def run(self) -> None:
        """Relay tick after tick until the world says that it was the last."""
        decided = self._judge(0, None) if self._medium.ahead else None
        tick = 0
        while True:
            self._supervisor.waits(tick, "what it senses", lambda: (WORLD,))
            sense = messages.unpack(messages.Sense, self._sense.recv().payload.to_bytes())
            self._from_world.check("sense", sense.seq)
            self._supervisor.works(sense.k)
            if sense.last:
                self._end(sense.k)
                return
            if sense.fired:
                self._scripted = self._scripted.fired(sense.fired, sense.k)
                self._change()
            if decided is None:
                decided = self._judge(sense.k, np.array(sense.position, dtype=np.float64))
            self._welcome_back(sense.k)
            self._hand_out_measurements(sense, decided)
            self._journal.put(decided.journal)
            self._collect(decided)
            self._hand_out_broadcasts(decided)
            # The agents now work on what they heard: time to decide the next tick, where that needs no positions.
            self._air = self._ahead
            self._forget(sense.k)
            tick = sense.k + 1
            decided = self._judge(tick, None) if self._medium.ahead else None

    def _judge(self, tick: int, position: Array | None) -> TickVerdicts:
        changed = self._take_orders(tick) or (tick == 0 and len(self._injected) > 0)
        awake = ~self._timeline.at(tick).idle
        speaks = awake[self._links.src - 1]
        offered = np.stack([speaks | (name == channels.SENSE) for name in self._brief.channels])
        air, verdicts = self._medium.judge(self._air, tick, offered, position)
        self._ahead, delivery = self._medium.deliver(air, tick, verdicts)
        heard = self._heard(tick, delivery)
        journal = messages.Journal(
            k=tick,
            src=HUB,
            seq=self._numbers.next("journal"),
            fates=verdicts.fate,
            odd=out_of_the_ordinary(tick, verdicts),
            apart=delivery.apart,
            late=delivery.late,
            dropped=delivery.dropped,
            released=delivery.released,
            handed=[len(heard[agent]) for agent in self._inboxes],
            injected=list(self._injected) if changed else None,
        )
        awake_agents = tuple((np.flatnonzero(awake) + 1).tolist())
        return TickVerdicts(
            tick, awake_agents, self._seen(verdicts.fate[0] == Fate.DELIVERED), heard, messages.pack(journal)
        )

    def _take_orders(self, tick: int) -> bool:
        """Obey whoever asks to change the air from this tick on; whether anything changed."""
        before = self._injected
        while query := self._control.try_recv():
            with query:
                try:
                    order = messages.unpack(Order, query.payload.to_bytes() if query.payload else b"")
                except messages.WireError as error:
                    query.reply_err(str(error).encode())
                    continue
                obeyed = obey(order, tick, self._scripted.faults, self._injected, self._links)
                self._injected = obeyed.injected
                query.reply(self._keys.control, messages.pack_record(obeyed.answer))
        if self._injected == before:
            return False
        self._change()
        return True

    def _change(self) -> None:
        self._timeline = self._medium.timeline = self._scripted.facing(self._injected)

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

    def _heard(self, tick: int, delivery: Delivery) -> dict[int, list[Arriving]]:
        """Sorted by the tick they speak of, source, channel and corruption, as links and channels are."""
        links, rows = np.nonzero(delivery.plain[1:].T)
        plain = np.stack([np.full_like(links, tick), links, rows + 1, np.zeros_like(links)], axis=-1)
        arriving: Integers = np.concatenate([delivery.apart, plain])
        if len(delivery.apart):
            arriving = arriving[np.lexsort(arriving.T[::-1])]
        sources, receivers = self._links.src[arriving[:, 1]].tolist(), self._links.dst[arriving[:, 1]].tolist()
        heard: dict[int, list[Arriving]] = defaultdict(list)
        for (content, link, channel, mark), src, dst in zip(arriving.tolist(), sources, receivers, strict=True):
            heard[dst].append(Arriving(content, src, channel, link, mark))
        return heard

    def _welcome_back(self, tick: int) -> None:
        for agent in self._timeline.restarted(tick):
            self._numbers.restart(f"inbox {agent}")
            self._reader.restart(agent)

    def _hand_out_measurements(self, sense: messages.Sense, decided: TickVerdicts) -> None:
        clock = self._timeline.clock(sense.k).tolist()
        for agent in decided.awake:
            neighbours, links = decided.seen[agent]
            inbox = messages.SenseInbox(
                k=sense.k,
                src=HUB,
                seq=self._numbers.next(f"inbox {agent}"),
                phase=messages.Phase.SENSE,
                clock=clock[agent - 1],
                neighbours=neighbours,
                measured=[sense.measured[link] for link in links],
                position=sense.position[agent - 1] if self._brief.positioned[agent - 1] else None,
                motion=None if sense.motion is None else sense.motion[agent - 1],
                sighting=None if sense.sightings is None else sense.sightings[agent - 1],
            )
            self._inboxes[agent].put(messages.pack(inbox))

    def _collect(self, decided: TickVerdicts) -> None:
        self._awaited = {(agent, name) for agent in decided.awake for name in self._spoken}
        self._supervisor.waits(decided.tick, "what it broadcasts", self._silent)
        while self._awaited:
            sample = self._broadcasts.recv()
            data = sample.payload.to_bytes()
            said = self._reader.read(str(sample.key_expr), data, decided.tick, self._awaited)
            self._said[said.k, said.src, said.channel] = self._as_told(said, data)
            self._awaited.remove((said.src, said.channel))
        self._supervisor.works(decided.tick)

    def _silent(self) -> list[str]:
        return [called(agent) for agent in sorted({agent for agent, _ in tuple(self._awaited)})]

    def _hand_out_broadcasts(self, decided: TickVerdicts) -> None:
        for agent in decided.awake:
            arriving = [self._as_it_arrives(said) for said in decided.heard[agent]]
            seq = self._numbers.next(f"inbox {agent}")
            self._inboxes[agent].put(messages.pack_exchange(decided.tick, seq, arriving))

    def _as_told(self, said: messages.Broadcast, data: bytes) -> bytes:
        for liar in self._timeline.at(said.k).liars:
            if said.src in liar.agents and said.channel == lie.CHANNEL:
                said = said._replace(payload=lie.told(fields(said), liar))
                data = messages.pack(said)
        return data

    def _as_it_arrives(self, arriving: Arriving) -> bytes:
        data = self._said[arriving.content, arriving.src, self._brief.channels[arriving.channel]]
        if arriving.mark in (Mark.NONE, Mark.STALE):
            return data
        draw = self._medium.bit_draws(*(np.array([n]) for n in (arriving.content, arriving.channel, arriving.link)))
        kind, bias = (
            np.array([arriving.mark], dtype=np.uint8),
            self._medium.bias(np.array([arriving.content]), np.array([arriving.link])),
        )
        broadcast = messages.unpack(messages.Broadcast, data)
        said = {name: field[None] for name, field in fields(broadcast).items()}
        wrong = {name: field[0] for name, field in corrupted_fields(said, kind, bias, draw).items()}
        return messages.pack(broadcast._replace(payload=wrong))

    def _forget(self, tick: int) -> None:
        """Drop what nobody will hear any more; a stale message says what was said the tick before it was sent."""
        oldest = self._air.oldest_sent(tick) - 1
        self._said = {said: data for said, data in self._said.items() if said[0] >= oldest}

    def _end(self, tick: int) -> None:
        for agent, inbox in self._inboxes.items():
            inbox.put(
                messages.pack(messages.EndInbox(tick, HUB, self._numbers.next(f"inbox {agent}"), messages.Phase.END))
            )


def main() -> None:
    """Run the medium until the run is over."""
    supervisor = Supervisor()
    brief = supervisor.brief(MediumBrief)
    config = hub(brief.login, brief.dictionary_file, Keys(brief.run), range(1, brief.links.agents + 1))
    with supervisor.confessing(), zenoh.open(config) as session:
        node = MediumNode(session, supervisor, brief)
        node.await_everybody()
        supervisor.tell("ready")
        node.run()
        supervisor.tell("done", in_flight=node.in_flight)
        supervisor.await_order("leave")
