"""Agents of a process in real time: they wake by their own clock, and act on what has arrived by then."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import ceil
from typing import NamedTuple

from agents.agent import AgentAction
from agents.loading import capabilities
from agents.node import AgentBrief, AgentsNode
from agents.timer import OwnClock
from netem.processes.supervised import Supervisor
from netem.processes.user_code import in_tick
from netem.processes.wall_time import WallTime, freeze_garbage
from netem.wire import messages
from netem.wire.carrier import Session
from netem.wire.session import HUB
from netem.wire.wrong import WireError

_ROUNDING = 1e-9


class Moment(NamedTuple):
    """When agents wake, when they act, and when they wake again, in simulated seconds; and after how many ticks at the most."""

    wakes: float
    acts: float
    following: float
    ticks: int


class RealTimeAgentsNode(AgentsNode):
    """Agents that wake by a timer."""

    def __init__(
        self, session: Session, supervisor: Supervisor, briefs: Sequence[AgentBrief], host: int | None = None
    ) -> None:
        super().__init__(session, supervisor, briefs, host, lost=supervisor.lost)
        first = briefs[0]
        assert first.timer is not None, "of a run in real time"
        self._timer, self._clock_s = first.timer, first.clock_s
        algorithms = (first.estimator.build(), first.law.build())
        self._only_of_now = any(capabilities.wants(algorithm).synchronous for algorithm in algorithms)
        self._senses: dict[int, messages.SenseInbox] = {}
        self._pending: dict[int, list[messages.Broadcast]] = {agent: [] for agent in self._mailboxes}
        self._wall: WallTime
        self._is_over = False
        self._lived = -1
        self._missed = 0

    def run(self) -> None:
        """Wake, sense, speak, listen and act until the medium says that the run is over."""
        freeze_garbage()
        self._wall = self._await_the_first()
        clock, number = OwnClock.right(self._timer.drift), 0
        while not self._is_over:
            following = self._timer.after(clock.says(self._wall.now()), number)
            self._missed += following - number
            number = following
            moment = self._moment(clock, number)
            self._supervisor.waits(max(self._lived, 0), "its inbox", lambda: (HUB,))
            self._wall.wait_until(moment.wakes)
            self._listen()
            if (inboxes := self._unlived()) and not self._is_over:
                self._live_by(moment, inboxes)
            before, clock = clock, self._set(clock)
            # Whose clock is set wakes by what it says now, and has missed nothing by that.
            number = number + 1 if clock is before else self._timer.after(clock.says(self._wall.now()), 0)

    def _moment(self, clock: OwnClock, number: int) -> Moment:
        wakes = clock.when(self._timer.moment(number))
        following = clock.when(self._timer.moment(number + 1))
        ticks = ceil(self._timer.period / clock.speed / self._agents.brief.dt - _ROUNDING)
        return Moment(wakes, wakes + self._timer.listens / clock.speed, following, ticks)

    def _set(self, clock: OwnClock) -> OwnClock:
        """The clock as it runs from now on."""
        gains = max((inbox.gains for inbox in self._senses.values()), key=abs, default=0.0)
        right = OwnClock.right(self._timer.drift)
        if clock.speed == right.speed + gains:
            return clock
        return clock.running(self._wall.now(), right.speed + gains) if gains else right

    def _await_the_first(self) -> WallTime:
        self._supervisor.waits(0, "its inbox", lambda: (HUB,))
        while not (awake := self._taking_part()):
            continue
        while not self._senses and not self._is_over:
            self._take(awake[0], self._mailboxes[awake[0]].next_inbox())
        began = next(iter(self._senses.values())).began if self._senses else 0.0
        if began is None:
            raise WireError("the medium: SenseInbox: began: a run in real time begins at a time (see docs/protocol.md)")
        return WallTime(began - self._clock_s, self._timer.factor)

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

    def _live_by(self, moment: Moment, inboxes: Mapping[int, messages.SenseInbox]) -> None:
        late, tick = self._wall.now() - moment.wakes, next(iter(inboxes.values())).k
        if self._lived >= 0:
            self._missed += max(0, tick - self._lived - moment.ticks)
        self._lived = tick
        self._supervisor.works(tick)
        with in_tick(tick):
            action, late_to_act = self._live_till(moment.acts, tick, inboxes)
        missed, self._missed = self._missed + (self._wall.now() > moment.following), 0
        late = max(late, late_to_act) / self._timer.factor
        self._tell(tick, action, [*inboxes], messages.Punctuality(late=late, missed=missed))

    def _live_till(
        self, acts: float, tick: int, inboxes: Mapping[int, messages.SenseInbox]
    ) -> tuple[AgentAction, float]:
        """What they do in a tick, and by how much they were late to decide it, in simulated seconds."""
        living, idle = self._living(tick, inboxes)
        sensed = self._arrivals.sensed(inboxes)
        state = self._speak(tick, living, sensed, inboxes, self._wall.now())
        self._wall.wait_until(acts)
        late = self._wall.now() - acts
        self._listen()
        heard = self._arrivals.heard(tick, self._heard_by(tick, inboxes))
        state, action = self._agents.act(state, sensed.clock, heard, sensed.position, sensed.motion, sensed.sighting)
        self._keep(state, idle)
        return action, late

    def _heard_by(self, tick: int, awake: Collection[int]) -> dict[int, list[messages.Broadcast]]:
        heard = {}
        for agent in awake:
            pending, self._pending[agent] = self._pending[agent], []
            pending.sort(key=lambda said: (said.k, said.src, said.channel))
            heard[agent] = [said for said in pending if said.k >= tick] if self._only_of_now else pending
        return heard
