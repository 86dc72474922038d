"""Agents of a process in real time: they wake by their own clock, and act on what has arrived by then."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from agents.batch import beside_others, put_back
from agents.loading import capabilities
from agents.node import AgentBrief, AgentsNode
from agents.timer import OwnClock
from netem.processes.supervised import Supervisor
from netem.processes.user_code import UserCodeError
from netem.processes.wall_time import WallTime, be_prompt
from netem.wire import messages
from netem.wire.arrays import WireError
from netem.wire.carrier import Session
from netem.wire.session import HUB


class RealTimeAgentsNode(AgentsNode):
    """Agents that wake by a timer."""

    def __init__(
        self, session: Session, supervisor: Supervisor, briefs: Sequence[AgentBrief], host: int | None = None
    ) -> None:
        super().__init__(session, supervisor, briefs, host, joins_late=True)
        first = briefs[0]
        assert first.timer is not None, "of a run in real time"
        self._timer = first.timer
        algorithms = (first.estimator.build(), first.law.build())
        self._only_of_now = any(capabilities.wants(algorithm).synchronous for algorithm in algorithms)
        self._senses: dict[int, messages.SenseInbox] = {}
        self._pending: dict[int, list[messages.Broadcast]] = {agent: [] for agent in self._mailboxes}
        self._is_over = False
        self._lived = -1
        self._missed = 0

    def run(self) -> None:
        """Wake, sense, speak, listen and act until the medium says that the run is over."""
        be_prompt()
        wall = self._await_the_first()
        clock, gains, number = OwnClock.right(self._timer.drift), 0.0, 0
        while not self._is_over:
            number = self._timer.after(clock.says(wall.now()), number)
            moment = clock.when(self._timer.moment(number))
            self._supervisor.waits(max(self._lived, 0), "its inbox", lambda: (HUB,))
            wall.wait_until(moment)
            self._listen()
            inboxes = self._unlived()
            if inboxes and not self._is_over:
                following = clock.when(self._timer.moment(number + 1))
                self._wake(wall, moment, following, moment + self._timer.listens / clock.speed, inboxes)
            now_gains = max((inbox.gains for inbox in inboxes.values()), key=abs, default=gains)
            if now_gains != gains:
                gains = now_gains
                right = OwnClock.right(self._timer.drift)
                clock = clock.running(wall.now(), right.speed + gains) if gains else right
            after = self._timer.after(clock.says(wall.now()), number + 1)
            self._missed += after - number - 1
            number = after

    def _await_the_first(self) -> WallTime:
        self._supervisor.waits(0, "its inbox", lambda: (HUB,))
        if self._roster is not None:
            self._come_back(self._roster.next())
        while not self._senses and not self._is_over:
            for agent, mailbox in self._mailboxes.items():
                self._take(agent, mailbox.next_inbox())
                break
        began = next(iter(self._senses.values())).began if self._senses else 0.0
        if began is None:
            raise WireError("the medium: SenseInbox: began: a run in real time begins at a time (see docs/protocol.md)")
        return WallTime(began, self._timer.factor)

    def _listen(self) -> None:
        for called in [] if self._roster is None else self._roster.waiting():
            self._come_back(called)
        for agent, mailbox in self._mailboxes.items():
            for inbox in mailbox.waiting_inboxes():
                self._take(agent, inbox)

    def _take(self, agent: int, inbox: messages.Inbox) -> None:
        match inbox:
            case messages.SenseInbox():
                self._senses[agent] = inbox
            case messages.ExchangeInbox():
                self._pending[agent] += inbox.messages
            case messages.EndInbox():
                self._is_over = True

    def _unlived(self) -> dict[int, messages.SenseInbox]:
        """What was sensed in the newest tick, if it has not been lived through."""
        newest = max((inbox.k for inbox in self._senses.values()), default=-1)
        if newest <= self._lived:
            return {}
        return {
            agent: self._senses[agent]
            for agent in self._mailboxes
            if agent in self._senses and self._senses[agent].k == newest
        }

    def _wake(
        self,
        wall: WallTime,
        moment: float,
        following: float,
        acts: float,
        inboxes: Mapping[int, messages.SenseInbox],
    ) -> None:
        late, (tick, *_) = wall.now() - moment, [inbox.k for inbox in inboxes.values()]
        self._lived = tick
        self._supervisor.works(tick)
        try:
            self._live_through(tick, wall, acts, following, late, inboxes)
        except UserCodeError as error:
            error.tick = tick
            raise

    def _live_through(
        self,
        tick: int,
        wall: WallTime,
        acts: float,
        following: float,
        late: float,
        inboxes: Mapping[int, messages.SenseInbox],
    ) -> None:
        before, living = self._state, self._state
        if some_idle := len(inboxes) < len(self._mailboxes):
            idle = ~np.isin(self._numbers, [*inboxes])
            living = beside_others(before, idle, tick)
        sensed = self._arrivals.sensed(inboxes)
        state = self._speak(tick, living, sensed, inboxes, wall.now())
        wall.wait_until(acts)
        late = max(late, wall.now() - acts)
        self._listen()
        heard = self._arrivals.heard(tick, self._heard_by(tick, inboxes))
        state, action = self._agents.act(state, sensed.clock, heard, sensed.position, sensed.motion, sensed.sighting)
        self._state = put_back(idle, before, state) if some_idle else state
        self._keep()
        missed, self._missed = self._missed + (wall.now() > following), 0
        self._tell(tick, action, [*inboxes], messages.Punctuality(late=late / self._timer.factor, missed=missed))

    def _heard_by(self, tick: int, awake: Collection[int]) -> dict[int, list[messages.Broadcast]]:
        heard = {}
        for agent in awake:
            pending, self._pending[agent] = self._pending[agent], []
            pending.sort(key=lambda said: (said.k, said.src, said.channel))
            heard[agent] = [said for said in pending if said.k >= tick] if self._only_of_now else pending
        return heard
