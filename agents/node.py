"""Agents of a process on the network: one, or several that a host carries as one batch.

They hear the medium, let `Agent` decide, and speak, each on keys of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from agents import checkpoint
from agents.agent import Agent, AgentAction, AgentState
from agents.arrivals import Arrivals, Sensed, forms_of
from agents.batch import beside_others, come_back, put_back
from agents.brief import Brief, together
from agents.mailbox import Mailbox
from agents.timer import Timer
from analysis.models.arrays import Mask
from netem.core import channels
from netem.loading.choice import Choice
from netem.processes.supervised import Supervisor
from netem.processes.user_code import in_tick
from netem.wire import messages
from netem.wire.arrays import TRUTH, packed
from netem.wire.carrier import Ear, Session, await_heard
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences
from netem.wire.session import CENTRE, HUB, Login
from netem.wire.wrong import WireError, Wrong


@dataclass(frozen=True)
class AgentBrief:
    """All an agent is told.

    Parameters
    ----------
    run, login
        Where its process connects, and as whom.
    agent, neighbours
        Its number, and the numbers of the agents in its neighbour slots.
    estimator, law, leaders, leader_gain, limit, reports, brief
        What `Agent` is made of.
    hears_centre
        Whether a centre tells it its edges.
    checkpoint, remembers
        The file that keeps its state, if one is wanted, and whether it goes on from what is in there.
    timer, clock_s
        When it wakes, in a run in real time, None in lockstep; and how much the medium's clock shows more than that of its
        machine, in seconds.
    """

    run: str
    login: Login
    agent: int
    neighbours: tuple[int, ...]
    estimator: Choice
    law: Choice
    leaders: Literal["pilot", "distances"]
    leader_gain: float
    limit: float | None
    reports: Mapping[str, tuple[int, ...]]
    brief: Brief
    hears_centre: bool
    checkpoint: str | None
    remembers: bool
    timer: Timer | None
    clock_s: float


@dataclass(frozen=True)
class HostBrief:
    """All a process is told that carries several agents.

    Parameters
    ----------
    host
        Which of the run's it is, from 1.
    agents
        What each of them is told.
    """

    host: int
    agents: tuple[AgentBrief, ...]


class AgentsNode:
    """Agents of one process on the network, computed as one batch."""

    def __init__(
        self,
        session: Session,
        supervisor: Supervisor,
        briefs: Sequence[AgentBrief],
        host: int | None = None,
        *,
        lost: Callable[[str, int], None] | None = None,
    ) -> None:
        """Nothing is said yet.

        Parameters
        ----------
        session, supervisor
            Where, and watched by whom.
        briefs
            What each of the agents is told.
        host
            Which of the run's hosts this is; None of an agent that has its process to itself.
        lost
            In real time, where nobody waits for them: told on which key messages are missing, and how many.
        """
        first, brief = briefs[0], together([one.brief for one in briefs])
        self._supervisor = supervisor
        self._agents = Agent(
            brief,
            first.estimator.build(),
            first.law.build(),
            first.leaders,
            first.leader_gain,
            first.limit,
            first.reports,
        )
        self._numbers = np.array([one.agent for one in briefs])
        self._state = self._begun(first)
        self._forms = forms_of(self._agents.channels())
        neighbours, (width, dimension) = {one.agent: one.neighbours for one in briefs}, brief.relative.shape[-2:]
        self._arrivals = Arrivals(neighbours, width, dimension, self._forms)
        self._mailboxes = {
            one.agent: Mailbox(
                session,
                one.run,
                one.agent,
                one.neighbours,
                sorted(self._forms),
                hears_centre=one.hears_centre,
                lost=lost,
            )
            for one in briefs
        }
        self._hears_centre = first.hears_centre
        self._roster = (
            None if host is None else Roster(session.hears(Keys(first.run).roster(host), 256), self._mailboxes)
        )

    def _begun(self, first: AgentBrief) -> AgentState:
        fresh = self._agents.init(self._numbers.shape)
        self._checkpoint = None if first.checkpoint is None else Path(first.checkpoint)
        if self._checkpoint and first.remembers:
            return self._agents.revived(checkpoint.load(self._checkpoint, like=fresh))
        if self._checkpoint:  # it may die before it has acted, and what a predecessor wrote is not its own
            checkpoint.save(self._checkpoint, fresh)
        return fresh

    def await_everybody(self) -> None:
        """Wait until the medium and the world listen."""
        await_heard(voice for mailbox in self._mailboxes.values() for voice in mailbox.voices)

    def run(self) -> None:
        """Sense, broadcast, hear and act until the medium says that the run is over."""
        tick = 0
        while True:
            self._supervisor.waits(tick, "its inbox", lambda: (HUB,))
            if not (awake := self._taking_part()):
                continue
            inboxes = {agent: inbox for agent in awake if isinstance(inbox := self._next(agent), messages.SenseInbox)}
            if len(inboxes) < len(awake):
                return
            tick = inboxes[awake[0]].k
            self._supervisor.works(tick)
            with in_tick(tick):
                self._live(tick, inboxes)

    def _taking_part(self) -> Sequence[int]:
        if self._roster is None:
            return [*self._mailboxes]
        called = self._roster.next()
        self._come_back(called)
        return called.awake

    def _come_back(self, called: messages.Roster) -> None:
        if called.restarted:
            self._state = come_back(self._agents, self._numbers, self._state, called.restarted, called.remembering)
            for agent in called.restarted:
                self._mailboxes[agent].begin()

    def _next(self, agent: int) -> messages.Inbox:
        return self._mailboxes[agent].next_inbox()

    def _live(self, tick: int, inboxes: Mapping[int, messages.SenseInbox]) -> None:
        living, idle = self._living(tick, inboxes)
        sensed = self._arrivals.sensed(inboxes)
        state = self._speak(tick, living, sensed, inboxes)
        self._supervisor.waits(tick, "its inbox", lambda: (HUB,))
        state, action = self._act(tick, state, sensed, [*inboxes])
        self._keep(state, idle)
        self._tell(tick, action, [*inboxes])

    def _living(self, tick: int, awake: Collection[int]) -> tuple[AgentState, Mask | None]:
        """The state with which a tick is lived, and who of them all is idle in it, if anybody is."""
        if len(awake) == len(self._mailboxes):
            return self._state, None
        idle = ~np.isin(self._numbers, [*awake])
        return beside_others(self._state, idle, tick), idle

    def _keep(self, state: AgentState, idle: Mask | None) -> None:
        self._state = state if idle is None else put_back(idle, self._state, state)
        if self._checkpoint:
            checkpoint.save(self._checkpoint, self._state)

    def _speak(
        self,
        tick: int,
        state: AgentState,
        sensed: Sensed,
        inboxes: Mapping[int, messages.SenseInbox],
        at: float | None = None,
    ) -> AgentState:
        state, said = self._agents.sense(state, tick, sensed.measured, sensed.seen, sensed.motion, sensed.flown)
        for row, (agent, mailbox) in enumerate(self._mailboxes.items()):
            if (inbox := inboxes.get(agent)) is None:
                continue
            for channel, fields in said.items():
                forms = self._forms[channel]
                payload = {name: packed(fields[name][row], form.dtype) for name, form in forms.items()}
                mailbox.broadcast(tick, channel, payload, at)
            observed = {"neighbours": inbox.neighbours, "measured": inbox.measured}
            mailbox.broadcast(tick, channels.MEASUREMENT, observed, at)
        return state

    def _act(
        self, tick: int, state: AgentState, sensed: Sensed, awake: Collection[int]
    ) -> tuple[AgentState, AgentAction]:
        arrived = {
            agent: inbox.messages for agent in awake if isinstance(inbox := self._next(agent), messages.ExchangeInbox)
        }
        self._supervisor.works(tick)
        heard = self._arrivals.heard(tick, arrived)
        if self._hears_centre:
            self._supervisor.waits(tick, "what it tells", lambda: (CENTRE,))
            told = {agent: self._mailboxes[agent].next_told() for agent in awake}
            self._supervisor.works(tick)
            heard[channels.CENTRE] = self._arrivals.told(tick, told, self._agents.brief.present)
        return self._agents.act(state, sensed.clock, heard, sensed.position, sensed.motion, sensed.sighting)

    def _tell(
        self,
        tick: int,
        action: AgentAction,
        awake: Collection[int],
        punctuality: messages.Punctuality | None = None,
    ) -> None:
        estimate, input_ = action.estimate, action.input
        for row, (agent, mailbox) in enumerate(self._mailboxes.items()):
            if agent not in awake:
                continue
            edges = slice(len(mailbox.neighbours))
            mailbox.act(
                tick,
                input=packed(input_[row]),
                estimate=packed(estimate.relative[row, edges]),
                known=packed(estimate.known[row, edges], TRUTH),
                covariance=packed(estimate.spread[row, edges]),
                psi=float(estimate.psi[row]),
                feasible=None if estimate.feasible is None else bool(estimate.feasible[row]),
                reports={name: packed(said[row]) for name, said in estimate.reports.items()},
                punctuality=punctuality,
            )


class Roster:
    """Who of a host's agents takes part in each tick, as the medium calls it."""

    def __init__(self, ear: Ear, agents: Collection[int]) -> None:
        self._ear, self._agents, self._calls = ear, frozenset(agents), Sequences("the medium's")

    def next(self) -> messages.Roster:
        """Wait for the next tick."""
        return self.read(self._ear.next().data)

    def waiting(self) -> list[messages.Roster]:
        """Those that have come."""
        return [self.read(arrived.data) for arrived in self._ear.waiting()]

    def read(self, data: bytes) -> messages.Roster:
        """What came.

        Raises
        ------
        WireError
            When it is something else, or calls agents that are none of this host's.
        UninstructedLoss
            When one before it is missing.
        """
        called = messages.unpack(messages.Roster, data)
        self._calls.check("roster", called.seq)
        if not self._agents.issuperset([*called.awake, *called.restarted, *called.remembering]):
            raise WireError(
                "the medium: Roster: it calls agents that are none of this host's (see docs/protocol.md)", Wrong.SHAPE
            )
        return called
