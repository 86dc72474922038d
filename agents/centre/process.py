"""The centralized filter as a process (`python -m agents.centre.process`): it hears all agents, and tells each its edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from agents.centre.filter import Centre, CentreEstimate
from netem.core.channels import INPUT, MEASUREMENT
from netem.core.clock import Clock, Lockstep
from netem.processes.supervised import Supervisor, called
from netem.wire import messages
from netem.wire.broadcasts import Broadcasts
from netem.wire.carrier import Session, await_heard
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering
from netem.wire.session import CENTRE, Login, client


@dataclass(frozen=True)
class CentreBrief:
    """All the centre is told.

    Parameters
    ----------
    run, login
        Where it connects, and as whom.
    ticks
        How many there are.
    centre
        The filter.
    """

    run: str
    login: Login
    ticks: int
    centre: Centre


class CentreNode:
    """The centre on the network."""

    def __init__(self, session: Session, supervisor: Supervisor, brief: CentreBrief) -> None:
        self._supervisor, self._brief, self._centre = supervisor, brief, brief.centre
        keys, self._agents = Keys(brief.run), range(1, len(brief.centre.neighbours) + 1)
        self._ears = {channel: session.hears(keys.broadcast("*", channel), 4096) for channel in (MEASUREMENT, INPUT)}
        self._told = {agent: session.says(keys.told(agent)) for agent in self._agents}
        self._reader, self._numbers = Broadcasts(keys, self._agents, (MEASUREMENT, INPUT)), Numbering()
        self._dimension = len(brief.centre.process) // len(brief.centre.neighbours)
        slots = zip(brief.centre.neighbours.tolist(), brief.centre.present.tolist(), strict=True)
        self._slots = [
            {number + 1: slot for slot, (number, real) in enumerate(zip(row, there, strict=True)) if real}
            for row, there in slots
        ]

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
            state, told = self._centre.step(state, measured, seen, inputs)
            self._tell(tick, told)

    def _hear(self, channel: str, tick: int) -> dict[int, dict[str, Any]]:
        said: dict[int, dict[str, Any]] = {}
        self._supervisor.waits(tick, "what it broadcasts", partial(_silent, self._agents, said))
        awaited = {(agent, channel) for agent in self._agents}
        while awaited:
            arrived = self._ears[channel].next()
            broadcast = self._reader.read(arrived.key, arrived.data, tick, awaited)
            awaited.remove((broadcast.src, channel))
            said[broadcast.src] = broadcast.payload
        return said

    def _input(self, agent: int, said: dict[str, Any]) -> Any:
        return messages.numbers(said.get("velocity"), f"agent {agent} on {INPUT!r}: 'velocity'", (self._dimension,))

    def _measurements(self, said: dict[int, dict[str, Any]]) -> tuple[Any, Any]:
        agents, slots = self._centre.neighbours.shape
        measured = np.zeros((agents, slots, self._dimension))
        seen = np.zeros((agents, slots), dtype=bool)
        for agent, observed in said.items():
            whose, slots_of = f"agent {agent} on {MEASUREMENT!r}", self._slots[agent - 1]
            whom = messages.numbers(observed.get("neighbours"), f"{whose}: 'neighbours'", (None,), "iu").tolist()
            if strangers := [neighbour for neighbour in whom if neighbour not in slots_of]:
                raise messages.WireError(
                    f"{whose}: 'neighbours': it has none called {strangers} (see docs/protocol.md)"
                )
            rows = [slots_of[neighbour] for neighbour in whom]
            given = messages.numbers(observed.get("measured"), f"{whose}: 'measured'", (len(rows), self._dimension))
            measured[agent - 1, rows], seen[agent - 1, rows] = given, True
        return measured, seen

    def _tell(self, tick: int, told: CentreEstimate) -> None:
        for agent, voice in self._told.items():
            number = self._numbers.next(str(agent))
            message = messages.Told(
                k=tick,
                src=CENTRE,
                seq=number,
                relative=told.relative[agent - 1],
                covariance=told.covariance[agent - 1],
            )
            voice.say(messages.pack(message))


def _silent(agents: range, said: dict[int, Any]) -> list[str]:
    return [called(agent) for agent in sorted(set(agents) - set(said))]


def main() -> None:
    """Estimate until the run is over."""
    supervisor = Supervisor()
    brief = supervisor.brief(CentreBrief)
    with supervisor.confessing(), Session(client(brief.login)) as session:
        listener = CentreNode(session, supervisor, brief)
        listener.await_everybody()
        supervisor.tell("ready")
        listener.run(Lockstep(brief.ticks))
        supervisor.tell("done")


if __name__ == "__main__":
    main()
