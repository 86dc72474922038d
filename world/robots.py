"""What is measured on robots outside, read from the wire: checked against the swarm, and a wrong one names its agent."""

from __future__ import annotations

from collections.abc import Callable, Container
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.wire import messages, values
from netem.wire.arrays import numbers
from netem.wire.keys import Keys
from netem.wire.sequence import Sequences
from netem.wire.session import DRIVER
from netem.wire.wrong import WireError, Wrong


class OnRobot(NamedTuple):
    """What is measured on one robot.

    Parameters
    ----------
    agent, tick
        Of whom, and of which tick it speaks.
    links, measured
        Rows of the links measured, shape (m,), and y of each, shape (m, D).
    position
        Where it is, shape (D,), in metres, if that is known.
    """

    agent: int
    tick: int
    links: Integers
    measured: Array
    position: Array | None


class Robots:
    """Reads what drivers say.

    Parameters
    ----------
    keys, links, dimension
        Of the run.
    positioned
        Agents that are told where they are, shape (N,), and whose robots have to know it.
    in_real_time
        Whether what is of an earlier tick may come.
    lost
        Told on which key, and how many messages are missing, if that is no reason to refuse the next one.
    """

    def __init__(
        self,
        keys: Keys,
        links: Links,
        dimension: int,
        positioned: Mask,
        *,
        in_real_time: bool,
        lost: Callable[[str, int], None] | None,
    ) -> None:
        self._speaking = {keys.measured(agent): agent for agent in range(1, links.agents + 1)}
        self._links, self._dimension, self._positioned = links, dimension, positioned
        self._in_real_time = in_real_time
        self._stream = {key: f"robot {agent}" for key, agent in self._speaking.items()}
        of_robot = {stream: key for key, stream in self._stream.items()}
        self._streams = Sequences("the driver's", lost=lost and (lambda stream, number: lost(of_robot[stream], number)))

    def speaker(self, key: str) -> int:
        """Whose key it is."""
        return self._speaking[key]

    def refuse(self, key: str) -> None:
        """Take note that what is said of a robot was refused before its number was looked at."""
        self._streams.refuse(self._stream[key])

    def read(self, key: str, data: bytes, tick: int, awaited: Container[int]) -> OnRobot:
        """What came on a key.

        Parameters
        ----------
        key, data
            As it came.
        tick
            Which is about to begin.
        awaited
            Agents whose robots are still to say something of it.

        Raises
        ------
        WireError
            When it is no such message, or of another tick or robot, or something else stands in a field than belongs there.
        UninstructedLoss
            When one before it is missing.
        """
        agent = self._speaking[key]
        whose = f"the robot of agent {agent}"
        try:
            said = messages.unpack(messages.Measured, data)
        except WireError as error:
            raise WireError(f"{whose}: {error}", error.wrong) from error
        if said.src != DRIVER or said.agent != agent:
            raise WireError(f"{whose}: {said.src!r} speaks for agent {said.agent}", Wrong.SPOOFED)
        if not (0 <= said.k <= tick if self._in_real_time else said.k == tick):
            wrong = Wrong.PAST if said.k < tick else Wrong.FUTURE
            raise WireError(f"{whose}: it says what is measured in tick {said.k}, where {tick} is due", wrong)
        if not (self._in_real_time or agent in awaited):
            raise WireError(f"{whose}: it says twice what is measured in tick {tick}", Wrong.REPEATED)
        read = self._read(agent, said, f"{whose}: Measured")
        self._streams.check(self._stream[key], said.seq)
        return read

    def _read(self, agent: int, said: messages.Measured, whose: str) -> OnRobot:
        pairs = [(neighbour, agent) for neighbour in said.neighbours]
        if len(set(pairs)) < len(pairs) or not self._links.index.keys() >= set(pairs):
            known = self._links.neighbours_of(agent)
            says = f"expected some of {[*known]}, each once, got {said.neighbours}"
            raise WireError(f"{whose}: neighbours: {says} (see docs/protocol.md)", Wrong.SHAPE)
        measured = numbers(said.measured, f"{whose}: measured", (len(pairs), self._dimension))
        values.finite(measured, f"{whose}: measured")
        position = None
        if said.position is not None:
            position = numbers(said.position, f"{whose}: position", (self._dimension,))
            values.finite(position, f"{whose}: position")
        elif self._positioned[agent - 1]:
            says = "agents that are told where they are need one of their robots"
            raise WireError(f"{whose}: position: {says} (see docs/hardware.md)", Wrong.SHAPE)
        links = np.array([self._links.index[pair] for pair in pairs], dtype=np.int64)
        # A robot says where its neighbour is; y_ij = z_i - z_j is where it is from there (000, eq. 7).
        return OnRobot(agent, said.k, links, -measured, position)
