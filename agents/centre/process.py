"""A centre as a process (`python -m agents.centre.process`): it hears all agents, and tells each its edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn

import numpy as np

from agents.brief import DERIVATIVES
from agents.centre.checked import CheckedCentre, centre_of
from agents.estimators.base import CentreEstimate
from agents.swarm import SwarmBrief
from netem.core.channels import INPUT, MEASUREMENT
from netem.core.clock import Clock, Lockstep
from netem.loading.choice import Choice
from netem.processes.leaving import leave, status_of
from netem.processes.supervised import Supervisor, called
from netem.processes.user_code import in_tick
from netem.wire import messages
from netem.wire.arrays import WHOLE, Form, numbers, packed
from netem.wire.broadcasts import Broadcasts
from netem.wire.carrier import Session, await_heard
from netem.wire.intake import Intake, Trust
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.repeating import opened
from netem.wire.sequence import Numbering
from netem.wire.session import CENTRE, Login, client


@dataclass(frozen=True)
class CentreBrief:
    """All the centre is told.

    Parameters
    ----------
    run, login
        Where it connects, and as whom.
    estimator
        Whose centre it is.
    swarm
        What that is made for.
    trust
        What is taken from agents.
    """

    run: str
    login: Login
    estimator: Choice
    swarm: SwarmBrief
    trust: Trust


class CentreNode:
    """The centre on the network."""

    def __init__(self, session: Session, supervisor: Supervisor, brief: CentreBrief, centre: CheckedCentre) -> None:
        self._supervisor, self._swarm, self._centre = supervisor, brief.swarm, centre
        keys, self._agents = Keys(brief.run), range(1, brief.swarm.agents + 1)
        heard = (MEASUREMENT, INPUT)
        self._ears = {
            channel: session.hears_anybody(keys.broadcast("*", channel), brief.swarm.agents) for channel in heard
        }
        self._told = {agent: session.says(keys.told(agent)) for agent in self._agents}
        self._intake, self._numbers = Intake(brief.trust), Numbering()
        supervisor.counts(lambda: self._intake.refused)
        slots = zip(brief.swarm.neighbours.tolist(), brief.swarm.present.tolist(), strict=True)
        self._slots = [
            {number + 1: slot for slot, (number, real) in enumerate(zip(row, there, strict=True)) if real}
            for row, there in slots
        ]
        steered = dict.fromkeys(DERIVATIVES[: brief.swarm.order], Form((brief.swarm.dimension,), truths=False))
        neighbours = {agent: frozenset(slots) for agent, slots in enumerate(self._slots, start=1)}
        payloads = Payloads({INPUT: steered}, neighbours, brief.swarm.dimension, brief.trust.foreign)
        self._reader = Broadcasts(keys, self._agents, heard, payloads)

    def await_everybody(self) -> None:
        """Wait until all agents listen."""
        await_heard(self._told.values())

    def run(self, clock: Clock) -> None:
        """Tick after tick: hear everybody, estimate, tell everybody."""
        state = self._centre.begin(())
        for tick in clock:
            said = {channel: self._hear(channel, tick) for channel in self._ears}
            measured, seen = self._measurements(said[MEASUREMENT])
            inputs = np.array([self._input(agent, said[INPUT][agent]) for agent in self._agents])
            self._supervisor.works(tick)
            with in_tick(tick):
                state, told = self._centre.step(state, measured, seen, inputs)
            self._tell(tick, told)

    def _hear(self, channel: str, tick: int) -> dict[int, dict[str, Any]]:
        said: dict[int, dict[str, Any]] = {}
        self._supervisor.waits(tick, "what it broadcasts", partial(_silent, self._agents, said))
        awaited = {(agent, channel) for agent in self._agents}
        while awaited:
            broadcast = self._intake.take(self._ears[channel].next(), tick, awaited, self._reader)
            if broadcast is not None:
                awaited.remove((broadcast.src, channel))
                said[broadcast.src] = broadcast.payload
        return said

    def _input(self, agent: int, said: dict[str, Any]) -> Any:
        name = DERIVATIVES[self._swarm.order - 1]
        whose = f"agent {agent} on {INPUT!r}: {name!r}"
        return numbers(said.get(name), whose, (self._swarm.dimension,))

    def _measurements(self, said: dict[int, dict[str, Any]]) -> tuple[Any, Any]:
        agents, slots = self._swarm.neighbours.shape
        measured = np.zeros((agents, slots, self._swarm.dimension))
        seen = np.zeros((agents, slots), dtype=bool)
        for agent, observed in said.items():
            whose, slots_of = f"agent {agent} on {MEASUREMENT!r}", self._slots[agent - 1]
            whom = numbers(observed.get("neighbours"), f"{whose}: 'neighbours'", (-1,), WHOLE).tolist()
            rows = [slots_of[neighbour] for neighbour in whom]
            given = numbers(observed.get("measured"), f"{whose}: 'measured'", (len(rows), self._swarm.dimension))
            measured[agent - 1, rows], seen[agent - 1, rows] = given, True
        return measured, seen

    def _tell(self, tick: int, told: CentreEstimate) -> None:
        assert told.nis is not None  # `CheckedCentre` says NaN where the filter says nothing
        for agent, voice in self._told.items():
            number = self._numbers.next(str(agent))
            message = messages.Told(
                k=tick,
                src=CENTRE,
                seq=number,
                relative=packed(told.relative[agent - 1]),
                covariance=packed(told.covariance[agent - 1]),
                nis=packed(told.nis[agent - 1]),
            )
            voice.say(messages.pack(message))


def _silent(agents: range, said: dict[int, Any]) -> list[str]:
    return [called(agent) for agent in sorted(set(agents) - set(said))]


def main() -> NoReturn:
    """Estimate until the run is over; the process ends here, whatever threads the user's own code has started."""
    leave(status_of(_estimate))


def _estimate() -> None:
    supervisor = Supervisor()
    brief = supervisor.brief(CentreBrief)
    with supervisor.confessing(), opened(client(brief.login), brief.login, supervisor.lost) as session:
        centre = centre_of(brief.estimator.build(), brief.swarm)
        if centre is None:
            raise RuntimeError(f"{brief.estimator.path} wanted a centre when it was planned, and now wants none")
        listener = CentreNode(session, supervisor, brief, centre)
        listener.await_everybody()
        supervisor.tell("ready")
        listener.run(Lockstep(brief.swarm.ticks))
        supervisor.tell("done")
