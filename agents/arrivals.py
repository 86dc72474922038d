"""What came to the agents of a process, message by message, as arrays of them all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np

from agents.brief import Reading
from agents.exchange import Channels, Heard
from analysis.models.arrays import Array, Mask
from analysis.models.pursuit import Sighting
from netem.wire import messages
from netem.wire.arrays import Form, channel_rows, numbers
from netem.wire.wrong import WireError


class Sensed(NamedTuple):
    """What agents sense in a tick; of those to whom nothing came, zeros.

    Parameters
    ----------
    measured, seen
        Relative positions, shape (N, n, D), in metres, and which there are, shape (N, n).
    clock
        What their clocks say.
    position
        Their own, shape (N, D), in metres; None where nobody is told.
    motion
        Velocity and higher derivatives, shape (N, m - 1, D), of bodies that have them.
    sighting
        What their detectors say, if there is a target.
    flown
        What they fly just now, shape (N, D), in metres per second, where that is not what they commanded.
    """

    measured: Array
    seen: Mask
    clock: Reading
    position: Array | None
    motion: Array | None
    sighting: Sighting | None
    flown: Array | None


class Arrivals:
    """Reads what came to agents.

    Parameters
    ----------
    neighbours
        By number of the agent, in the order of its row, the numbers of the agents in its neighbour slots.
    width, dimension
        How many slots there are, and D.
    forms
        What the fields of each channel hold.
    """

    def __init__(
        self,
        neighbours: Mapping[int, Sequence[int]],
        width: int,
        dimension: int,
        forms: Mapping[str, Mapping[str, Form]],
    ) -> None:
        self._rows = {agent: row for row, agent in enumerate(neighbours)}
        self._slot = {
            agent: {number: row * width + slot for slot, number in enumerate(neighbours[agent])}
            for agent, row in self._rows.items()
        }
        self._shape, self._dimension, self._forms = (len(neighbours), width), dimension, forms
        speaking = [number for own in neighbours.values() for number in (*own, *[0] * (width - len(own)))]
        self._said_by = {name: [f"agent {number} on {name!r}" for number in speaking] for name in forms}

    def sensed(self, inboxes: Mapping[int, messages.SenseInbox]) -> Sensed:
        """What came with measurements, by number of the agent.

        Raises
        ------
        WireError
            When an array is of another form.
        """
        measured, seen = np.zeros((*self._shape, self._dimension)), np.zeros(self._shape, dtype=bool)
        slots = [self._slot[agent][number] for agent, inbox in inboxes.items() for number in inbox.neighbours]
        if slots:
            data = b"".join([inbox.measured for inbox in inboxes.values()])
            measured.reshape(-1, self._dimension)[slots] = numbers(
                data, "SenseInbox: measured", (len(slots), self._dimension)
            )
            seen.reshape(-1)[slots] = True
        return Sensed(
            measured,
            seen,
            self._clock(inboxes),
            self._of_each(inboxes, "position"),
            self._motion(inboxes),
            self._sighting(inboxes),
            self._of_each(inboxes, "flown"),
        )

    def heard(self, tick: int, arrived: Mapping[int, Sequence[messages.Broadcast]]) -> dict[str, Heard]:
        """What neighbours said, by channel, of what arrived at each agent, sorted by tick.

        Raises
        ------
        WireError
            When an array is of another form.
        """
        # What stands in a slot in the end is the newest.
        slots = self._shape[0] * self._shape[1]
        said: dict[str, list[messages.Broadcast | None]] = {name: [None] * slots for name in self._forms}
        for agent, broadcasts in arrived.items():
            slot = self._slot[agent]
            for message in broadcasts:
                if message.channel in said:
                    said[message.channel][slot[message.src]] = message
        return {name: self._heard_on(tick, name, newest) for name, newest in said.items()}

    def _heard_on(self, tick: int, channel: str, said: list[messages.Broadcast | None]) -> Heard:
        payloads = [None if message is None else message.payload for message in said]
        fields = channel_rows(self._forms[channel], payloads, self._said_by[channel])
        fresh = np.array([message is not None for message in said], dtype=bool)
        # In real time a neighbour may be in a later tick than oneself.
        age = np.array([0 if message is None else max(tick - message.k, 0) for message in said], dtype=np.int64)
        return Heard(
            {name: rows.reshape(*self._shape, *rows.shape[1:]) for name, rows in fields.items()},
            fresh.reshape(self._shape),
            age.reshape(self._shape),
        )

    def told(self, tick: int, told: Mapping[int, messages.Told], present: Mask) -> Heard:
        """What the centre told them of their edges.

        Raises
        ------
        WireError
            When an array is of another form, or it speaks of another tick.
        """
        edges = (self._shape[1], self._dimension)
        shapes = {"relative": edges, "covariance": (*edges, self._dimension), "nis": edges[:1]}
        fields = {name: np.zeros((self._shape[0], *shape)) for name, shape in shapes.items()}
        for agent, message in told.items():
            if message.k != tick:
                raise WireError(f"the centre told of tick {message.k} in tick {tick}")
            for name, shape in shapes.items():
                fields[name][self._rows[agent]] = numbers(getattr(message, name), f"the centre: Told: {name}", shape)
        return Heard(fields, present)

    def _clock(self, inboxes: Mapping[int, messages.SenseInbox]) -> Reading:
        """One reading for all, where they agree, spares looking up the manoeuvre for each."""
        told = [inbox.clock for inbox in inboxes.values()]
        if told.count(told[0]) == len(told):
            return told[0]
        clocks = np.full(self._shape[0], told[0])
        clocks[[self._rows[agent] for agent in inboxes]] = told
        return clocks

    def _of_each(self, inboxes: Mapping[int, messages.SenseInbox], what: Literal["position", "flown"]) -> Array | None:
        """A vector of each agent that is told one."""
        told = {
            self._rows[agent]: said for agent, inbox in inboxes.items() if (said := getattr(inbox, what)) is not None
        }
        if not told:
            return None
        of_all = np.zeros((self._shape[0], self._dimension))
        of_all[[*told]] = numbers(b"".join(told.values()), f"SenseInbox: {what}", (len(told), self._dimension))
        return of_all

    def _motion(self, inboxes: Mapping[int, messages.SenseInbox]) -> Array | None:
        told = {self._rows[agent]: inbox.motion for agent, inbox in inboxes.items() if inbox.motion is not None}
        if not told:
            return None
        rows = [numbers(said, "SenseInbox: motion", (-1, self._dimension)) for said in told.values()]
        motion = np.zeros((self._shape[0], *rows[0].shape))
        motion[[*told]] = rows
        return motion

    def _sighting(self, inboxes: Mapping[int, messages.SenseInbox]) -> Sighting | None:
        told = {self._rows[agent]: inbox.sighting for agent, inbox in inboxes.items() if inbox.sighting is not None}
        if not told:
            return None
        agents, rows, said = self._shape[0], [*told], [*told.values()]
        sighting = Sighting(
            np.full((agents, self._dimension), np.nan),
            done=np.zeros(agents, dtype=bool),
            by=np.zeros(agents, dtype=np.int64),
            method=np.zeros(agents, dtype=np.int64),
        )
        data = b"".join([one.position for one in said])
        sighting.position[rows] = numbers(data, "SenseInbox: sighting", (len(said), self._dimension))
        sighting.done[rows] = [one.done for one in said]
        sighting.by[rows] = [one.by for one in said]
        sighting.method[rows] = [one.method for one in said]
        return sighting


def forms_of(spoken: Channels) -> dict[str, dict[str, Form]]:
    """What the fields of each channel hold, as the network is told."""
    return {
        channel: {name: Form(field.shape, np.dtype(field.dtype).kind == "b") for name, field in fields.items()}
        for channel, fields in spoken.items()
    }
