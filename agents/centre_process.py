"""The centralized filter as a process (`python -m agents.centre_process`): it hears all agents, and tells each its edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import zenoh

from agents.centre import Centre, Told
from netem import wire
from netem.channels import INPUT, MEASUREMENT
from netem.keys import Keys
from netem.sequence import Numbering, Sequences
from netem.session import CENTRE, Login, await_subscribers, client
from netem.supervised import Supervisor, patience


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
    patience_s
        How long it waits for an agent, in seconds.
    """

    run: str
    login: Login
    ticks: int
    centre: Centre
    patience_s: float


class Listener:
    """The centre on the network."""

    def __init__(self, session: zenoh.Session, brief: CentreBrief) -> None:
        self._brief, self._centre = brief, brief.centre
        keys, self._agents = Keys(brief.run), range(1, len(brief.centre.neighbours) + 1)
        self._ears = {
            channel: session.declare_subscriber(keys.broadcast("*", channel), zenoh.handlers.FifoChannel(4096))
            for channel in (MEASUREMENT, INPUT)
        }
        self._told = {agent: session.declare_publisher(keys.told(agent)) for agent in self._agents}
        self._streams, self._numbers = Sequences("agent"), Numbering()
        slots = zip(brief.centre.neighbours.tolist(), brief.centre.present.tolist(), strict=True)
        self._slots = [
            {number + 1: slot for slot, (number, real) in enumerate(zip(row, there, strict=True)) if real}
            for row, there in slots
        ]

    def await_everybody(self) -> None:
        """Wait until all agents listen."""
        await_subscribers(self._told.values())

    def run(self) -> None:
        """Tick after tick: hear everybody, estimate, tell everybody."""
        state = self._centre.begin(())
        for tick in range(self._brief.ticks):
            said = {channel: self._hear(channel, tick) for channel in self._ears}
            measured, seen = self._measurements(said[MEASUREMENT])
            inputs = np.array([said[INPUT][agent]["velocity"] for agent in self._agents])
            state, told = self._centre.step(state, measured, seen, inputs)
            self._tell(tick, told)

    def _hear(self, channel: str, tick: int) -> dict[int, dict[str, Any]]:
        said: dict[int, dict[str, Any]] = {}
        missing = partial(_missing, channel, tick, self._agents, said)
        with patience(self._brief.patience_s, missing):
            while len(said) < len(self._agents):
                broadcast = wire.unpack(wire.Broadcast, self._ears[channel].recv().payload.to_bytes())
                if broadcast.k != tick or broadcast.src in said:
                    raise wire.WireError(f"the centre is in tick {tick}, agent {broadcast.src} in tick {broadcast.k}")
                self._streams.check(f"{broadcast.src} {channel}", broadcast.seq)
                said[broadcast.src] = broadcast.payload
        return said

    def _measurements(self, said: dict[int, dict[str, Any]]) -> tuple[Any, Any]:
        agents, slots = self._centre.neighbours.shape
        measured = np.zeros((agents, slots, len(self._centre.process) // agents))
        seen = np.zeros((agents, slots), dtype=bool)
        for agent, observed in said.items():
            rows = [self._slots[agent - 1][neighbour] for neighbour in observed["neighbours"]]
            if rows:
                measured[agent - 1, rows], seen[agent - 1, rows] = observed["measured"], True
        return measured, seen

    def _tell(self, tick: int, told: Told) -> None:
        for agent, publisher in self._told.items():
            number = self._numbers.next(str(agent))
            message = wire.Told(tick, CENTRE, number, told.relative[agent - 1], told.covariance[agent - 1])
            publisher.put(wire.pack(message))


def _missing(channel: str, tick: int, agents: range, said: dict[int, Any]) -> str:
    return f"the {channel} of agents {sorted(set(agents) - set(said))} in tick {tick}"


def main() -> None:
    """Estimate until the run is over."""
    supervisor = Supervisor()
    brief = supervisor.brief(CentreBrief)
    with supervisor.confessing(), zenoh.open(client(brief.login)) as session:
        listener = Listener(session, brief)
        listener.await_everybody()
        supervisor.tell("ready")
        listener.run()
        supervisor.tell("done")


if __name__ == "__main__":
    main()
