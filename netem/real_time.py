"""The medium of a run in real time: it relays messages as they come, each when it is due."""

from __future__ import annotations

from collections import defaultdict, deque
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from netem.brief import MediumBrief
from netem.core.pace import Pace
from netem.medium.parcels import Parcel
from netem.medium.real_time import RealTimeRelay
from netem.medium.relay import changed_on_the_way
from netem.ports import MediumPorts, medium_of
from netem.processes.background import Background
from netem.processes.supervised import Supervisor
from netem.processes.wall_time import WallTime, freeze_garbage
from netem.wire import messages
from netem.wire.carrier import Arrived, Session
from netem.wire.keys import Keys
from netem.wire.session import WORLD
from netem.wire.wrong import WireError

if TYPE_CHECKING:
    from netem.medium.deliveries import Deliveries
    from netem.medium.journal import Writer

# A fault that is injected holds from so many ticks later on, by when the world has heard of it.
_NOTICE = 3
# What is due within less is handed on together.
_AT_ONCE_S = 0.0005


class RealTimeNode:
    """The medium of a run in real time."""

    def __init__(
        self,
        session: Session,
        supervisor: Supervisor,
        brief: MediumBrief,
        journal: Writer,
        deliveries: Deliveries,
        background: Background,
    ) -> None:
        assert brief.pace is not None, "of a run in real time"
        self._keys, self._supervisor, self._written = Keys(brief.run), supervisor, journal
        self._pace: Pace = brief.pace
        self._brief = brief
        self._relay = self._new_relay()
        self._ports = MediumPorts(session, brief, self._relay, supervisor.lost)
        supervisor.counts(lambda: self._ports.intake.refused)
        self._row = {name: row for row, name in enumerate(brief.channels)}
        self._ears = session.hears_both(self._keys.sense, self._keys.broadcast("*", "*"))
        self._deliveries, self._background = deliveries, background
        self._handed = [0] * brief.links.agents
        self._awake: frozenset[int] = frozenset()
        self._wall: WallTime | None = None
        self._tick, self._told = -1, 0
        self._late = 0.0
        self._over = False

    def _new_relay(self) -> RealTimeRelay[bytes]:
        brief, pace = self._brief, self._pace
        return RealTimeRelay(medium_of(brief), brief.links, len(brief.channels), pace.dt, pace.grace)

    def await_everybody(self) -> None:
        """Wait until all agents and the world listen."""
        self._ports.await_everybody()
        _rehearse(self._new_relay(), self._brief)
        freeze_garbage()

    def run(self) -> None:
        """Relay until the world says that it was the last tick."""
        self._supervisor.waits(0, "what it senses", lambda: (WORLD,))
        while not self._over:
            arrived = self._ears.next(self._patience_s)
            while arrived is not None:
                self._take(arrived)
                if self._is_late:
                    break
                arrived = self._ears.next(0.0)
            if not self._over:
                self._hand_out()

    @property
    def _is_late(self) -> bool:
        """Whether what is due should be handed on before more is heard."""
        due_s = self._relay.next_s
        return (
            due_s is not None and self._wall is not None and self._wall.now() > due_s + _AT_ONCE_S * self._pace.factor
        )

    @property
    def _patience_s(self) -> float | None:
        due_s = self._relay.next_s
        return None if due_s is None or self._wall is None else self._wall.until(due_s)

    def _take(self, arrived: Arrived) -> None:
        if arrived.key == self._keys.sense:
            self._begin(self._ports.sense(arrived.data, self._tick + 1))
        else:
            self._hear(arrived)

    def _begin(self, sense: messages.Sense) -> None:
        self._ports.refuse_strangers()
        if sense.last:
            self._over = True
            self._write_down(all_of_them=True)
            self._ports.end(sense.k)
            return
        if self._wall is None:
            if sense.began is None:
                raise WireError("the world: Sense: began: a run in real time begins at a time (see docs/protocol.md)")
            self._wall = WallTime(sense.began + self._brief.clock_s, self._pace.factor)
        self._tick = sense.k
        if sense.fired:
            self._relay.fire(sense.fired, sense.k)
        self._ports.obey_orders(sense.k + _NOTICE)
        begun = self._relay.begin(sense.k, self._ports.where(sense), self._ports.measured(sense))
        self._awake = frozenset(begun.awake)
        self._ports.welcome_back(sense.k)
        self._ports.call(sense.k, self._awake)
        self._ports.hand_out_measurements(sense, begun.awake, self._ports.seen(begun.seen), self._wall.began)
        self._write_down()
        self._supervisor.waits(sense.k, "what it senses", lambda: (WORLD,))

    def _hear(self, arrived: Arrived) -> None:
        said = self._ports.intake.take(arrived, self._tick, (), self._ports.reader)
        if said is None:
            return
        lies = self._relay.lies(said.k, said.channel, said.src)
        data = self._ports.as_told(said, arrived.data) if lies else arrived.data
        self._relay.say(said.src, self._row[said.channel], said.k, said.at or 0.0, data)

    def _hand_out(self) -> None:
        if self._wall is None:
            return
        arriving = self._relay.arriving(self._wall.now())
        if not arriving:
            return
        inboxes: dict[int, list[Parcel[bytes]]] = defaultdict(list)
        for parcel in arriving:
            inboxes[self._relay.receiver(parcel)].append(parcel)
        for agent, parcels in inboxes.items():
            if agent in self._awake:
                parcels.sort(key=lambda parcel: (parcel.content, parcel.link, parcel.channel, parcel.mark))
                self._ports.hand_out_broadcasts(self._tick, agent, [self._as_it_arrives(parcel) for parcel in parcels])
                self._handed[agent - 1] += len(parcels)
        now_s = self._wall.now()
        self._late = max(self._late, *(now_s - parcel.due_s for parcel in arriving))
        self._background.later(partial(self._deliveries.book, self._tick, arriving, now_s))

    def _as_it_arrives(self, parcel: Parcel[bytes]) -> bytes:
        if not changed_on_the_way(parcel.mark):
            return parcel.said
        row = np.array([parcel.content, parcel.link, parcel.channel, parcel.mark])
        return self._ports.as_it_arrives(parcel.said, row)

    def _write_down(self, *, all_of_them: bool = False) -> None:
        for entry in self._relay.closed(all_of_them=all_of_them):
            handed, self._handed = self._handed, [0] * len(self._handed)
            kept = messages.Punctuality(late=self._late / self._pace.factor, missed=int(self._late > self._pace.dt))
            self._ports.tell_the_world(self._ports.journal(self._told, entry, handed, kept))
            lost = self._supervisor.lost_anywhere()
            self._background.later(partial(self._written.enter, entry, self._relay.in_flight, lost))
            self._told, self._late = self._told + 1, 0.0


def _rehearse(relay: RealTimeRelay[bytes], brief: MediumBrief) -> None:
    """Call what a tick calls: to load kernels takes longer than a tick may."""
    relay.begin(0, np.zeros((brief.links.agents, brief.dimension)))
    for agent in range(1, brief.links.agents + 1):
        for channel in range(1, len(brief.channels)):
            relay.say(agent, channel, 0, 0.0, b"")
    relay.arriving(np.inf)
    deque(relay.closed(all_of_them=True), maxlen=0)
