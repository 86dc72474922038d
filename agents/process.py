"""One agent as a process (`python -m agents`): it hears the medium, lets `Agent` decide, and speaks on keys of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np

from agents import checkpoint
from agents.agent import Agent, AgentState
from agents.brief import Brief
from agents.exchange import Channels, Heard
from analysis.models.arrays import Array
from analysis.models.pursuit import Sighting
from netem.core import channels
from netem.loading.choice import Choice
from netem.processes.leaving import leave, status_of
from netem.processes.supervised import Supervisor
from netem.processes.user_code import UserCodeError
from netem.wire import messages
from netem.wire.arrays import TRUTH, Form, WireError, channel_rows, numbers, packed
from netem.wire.carrier import Session, await_heard
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering, Sequences
from netem.wire.session import CENTRE, HUB, Login, client


@dataclass(frozen=True)
class AgentBrief:
    """All an agent process is told.

    Parameters
    ----------
    run, login
        Where it connects, and as whom.
    agent, neighbours
        Its number, and the numbers of the agents in its neighbour slots.
    estimator, law, leaders, leader_gain, limit, reports, brief
        What `Agent` is made of.
    hears_centre
        Whether a centre tells it its edges.
    checkpoint, remembers
        The file that keeps its state, if one is wanted, and whether it goes on from what is in there.
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


class AgentNode:
    """One agent on the network."""

    def __init__(self, session: Session, supervisor: Supervisor, brief: AgentBrief) -> None:
        self._supervisor = supervisor
        self._number = brief.agent
        self._neighbours = brief.neighbours
        self._slot = {number: slot for slot, number in enumerate(brief.neighbours)}
        self._agent = Agent(
            brief.brief,
            brief.estimator.build(),
            brief.law.build(),
            brief.leaders,
            brief.leader_gain,
            brief.limit,
            brief.reports,
        )
        self._width, self._dimension = brief.brief.relative.shape
        self._checkpoint = None if brief.checkpoint is None else Path(brief.checkpoint)
        self._state: AgentState = self._agent.init(())
        if self._checkpoint and brief.remembers:
            self._state = self._agent.revived(checkpoint.load(self._checkpoint, like=self._state))
        elif self._checkpoint:  # it may die before it has acted, and what a predecessor wrote is not its own
            checkpoint.save(self._checkpoint, self._state)
        self._heard = 0
        self._numbers = Numbering()
        self._inboxes = Sequences("the medium's")
        keys = Keys(brief.run)
        self._inbox = session.hears(keys.inbox(self._number), 64)
        self._channels = self._agent.channels()
        self._forms = forms_of(self._channels)
        self._said_by = {
            name: [
                f"agent {neighbour} on {name!r}"
                for neighbour in (*brief.neighbours, *[0] * (self._width - len(brief.neighbours)))
            ]
            for name in self._channels
        }
        spoken = sorted([channels.MEASUREMENT, *self._channels])
        self._broadcasts = {name: session.says(keys.broadcast(self._number, name)) for name in spoken}
        self._act = session.says(keys.act(self._number))
        self._told = session.hears(keys.told(self._number), 64) if brief.hears_centre else None
        self._tellings = Sequences("the centre's")

    def await_everybody(self) -> None:
        """Wait until the medium and the world listen."""
        await_heard([*self._broadcasts.values(), self._act])

    def run(self) -> None:
        """Sense, broadcast, hear and act until the medium says that the run is over."""
        sensed: messages.SenseInbox | None = None
        tick = 0
        while True:
            self._supervisor.waits(tick, "its inbox", lambda: (HUB,))
            inbox = messages.unpack_inbox(self._inbox.next().data)
            self._inboxes.check("inbox", inbox.seq)
            tick = inbox.k
            self._supervisor.works(tick)
            try:
                if isinstance(inbox, messages.SenseInbox):
                    sensed = inbox
                    self._sense(inbox)
                elif isinstance(inbox, messages.ExchangeInbox) and sensed is not None:
                    self._exchange(inbox, sensed)
                else:
                    return
            except UserCodeError as error:
                error.tick = inbox.k
                raise

    def _sense(self, inbox: messages.SenseInbox) -> None:
        measured = np.zeros((self._width, self._dimension))
        seen = np.zeros(self._width, dtype=bool)
        if inbox.neighbours:
            slots = [self._slot[number] for number in inbox.neighbours]
            measured[slots] = numbers(inbox.measured, "SenseInbox: measured", (len(slots), self._dimension))
            seen[slots] = True
        self._state, said = self._agent.sense(self._state, inbox.k, measured, seen, self._motion(inbox))
        observed = {"neighbours": inbox.neighbours, "measured": inbox.measured}
        for channel, fields in said.items():
            forms = self._forms[channel]
            self._say(inbox.k, channel, {name: packed(fields[name], form.dtype) for name, form in forms.items()})
        self._say(inbox.k, channels.MEASUREMENT, observed)

    def _say(self, tick: int, channel: str, payload: dict[str, Any]) -> None:
        seq = self._numbers.next(channel)
        said = messages.Broadcast(k=tick, src=self._number, channel=channel, seq=seq, payload=payload)
        self._broadcasts[channel].say(messages.pack(said))

    def _motion(self, sensed: messages.SenseInbox) -> Array | None:
        if sensed.motion is None:
            return None
        return numbers(sensed.motion, "SenseInbox: motion", (-1, self._dimension))

    def _exchange(self, inbox: messages.ExchangeInbox, sensed: messages.SenseInbox) -> None:
        self._heard += len(inbox.messages)
        heard = {**self._gather(inbox.k, inbox.messages), **self._from_the_centre(inbox.k)}
        position, motion, sighting = self._position(sensed), self._motion(sensed), self._sighting(sensed)
        self._state, action = self._agent.act(self._state, sensed.clock, heard, position, motion, sighting)
        if self._checkpoint:
            checkpoint.save(self._checkpoint, self._state)
        estimate, degree = action.estimate, len(self._neighbours)
        act = messages.Act(
            k=inbox.k,
            src=self._number,
            seq=self._numbers.next("act"),
            input=packed(action.input),
            estimate=packed(estimate.relative[:degree]),
            known=packed(estimate.known[:degree], TRUTH),
            covariance=packed(estimate.spread[:degree]),
            psi=float(estimate.psi),
            feasible=None if estimate.feasible is None else bool(estimate.feasible),
            reports={name: packed(said) for name, said in estimate.reports.items()},
            heard=self._heard,
        )
        self._act.say(messages.pack(act))

    def _from_the_centre(self, tick: int) -> Mapping[str, Heard]:
        if self._told is None:
            return {}
        self._supervisor.waits(tick, "what it tells", lambda: (CENTRE,))
        told = messages.unpack(messages.Told, self._told.next().data)
        self._supervisor.works(tick)
        self._tellings.check("told", told.seq)
        if told.k != tick:
            raise WireError(f"the centre told of tick {told.k} in tick {tick}")
        edges = (self._width, self._dimension)
        shapes = {"relative": edges, "covariance": (*edges, self._dimension), "nis": edges[:1]}
        fields = {
            name: numbers(getattr(told, name), f"the centre: Told: {name}", shape) for name, shape in shapes.items()
        }
        return {channels.CENTRE: Heard(fields, self._agent.brief.present)}

    def _gather(self, tick: int, arrived: list[messages.Broadcast]) -> Mapping[str, Heard]:
        # Messages come sorted by tick, so what stands in a slot in the end is the newest.
        said: dict[str, list[messages.Broadcast | None]] = {name: [None] * self._width for name in self._channels}
        for message in arrived:
            if message.channel in said:
                said[message.channel][self._slot[message.src]] = message
        return {name: self._heard_on(tick, name, newest) for name, newest in said.items()}

    def _heard_on(self, tick: int, channel: str, said: list[messages.Broadcast | None]) -> Heard:
        payloads = [None if message is None else message.payload for message in said]
        return Heard(
            channel_rows(self._forms[channel], payloads, self._said_by[channel]),
            fresh=np.array([message is not None for message in said], dtype=bool),
            age=np.array([0 if message is None else tick - message.k for message in said], dtype=np.int64),
        )

    def _position(self, sensed: messages.SenseInbox) -> Array | None:
        if sensed.position is None:
            return None
        return numbers(sensed.position, "SenseInbox: position", (self._dimension,))

    def _sighting(self, sensed: messages.SenseInbox) -> Sighting | None:
        if (said := sensed.sighting) is None:
            return None
        position = numbers(said.position, "SenseInbox: sighting", (self._dimension,))
        return Sighting(position, np.array(said.done), np.array(said.by), np.array(said.method))


def forms_of(spoken: Channels) -> dict[str, dict[str, Form]]:
    """What the fields of each channel hold, as the network is told."""
    return {
        channel: {name: Form(field.shape, np.dtype(field.dtype).kind == "b") for name, field in fields.items()}
        for channel, fields in spoken.items()
    }


def main() -> NoReturn:
    """Fly one agent until the run is over; the process ends here, whatever threads the user's own code has started."""
    leave(status_of(_fly))


def _fly() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(AgentBrief)
    with supervisor.confessing(), Session(client(brief.login)) as session:
        node = AgentNode(session, supervisor, brief)
        node.await_everybody()
        supervisor.tell("ready")
        node.run()
        supervisor.tell("done")
