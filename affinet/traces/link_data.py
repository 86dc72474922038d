"""What a file says of links: quantities over time, messages one by one, or where nodes were; in the file's own names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.impairments.measured import MeasuredError


class Quantity(StrEnum):
    """What a link is said to be worth."""

    AVAILABILITY = "availability"
    DELAY = "delay"
    RATE = "rate"
    RSSI = "rssi"
    PATHLOSS = "pathloss"
    DISTANCE = "distance"


UNITS: Mapping[Quantity, str] = {
    Quantity.AVAILABILITY: "",
    Quantity.DELAY: "s",
    Quantity.RATE: "bit/s",
    Quantity.RSSI: "dBm",
    Quantity.PATHLOSS: "dB",
    Quantity.DISTANCE: "m",
}
# Of which a curve makes an availability.
INDIRECT = (Quantity.RSSI, Quantity.PATHLOSS, Quantity.DISTANCE)


class Steps(NamedTuple):
    """Values that hold on a link from a time on, until the next of the same link.

    Parameters
    ----------
    line
        Of the file, shape (n,).
    time
        In seconds, shape (n,), in any order.
    src, dst
        Places of sender and receiver among the nodes, shape (n,).
    value
        Shape (n,).
    """

    line: Integers
    time: Array
    src: Integers
    dst: Integers
    value: Array

    def at(self, rows: Mask | Integers) -> Steps:
        """Some of them."""
        return Steps(self.line[rows], self.time[rows], self.src[rows], self.dst[rows], self.value[rows])


class Messages(NamedTuple):
    """Messages over one link, one by one, in the order in which they were sent.

    Parameters
    ----------
    time
        When each was sent, shape (n,).
    lost
        Shape (n,).
    delay
        One way, in seconds, NaN where it was lost, shape (n,).
    late
        Those that came after one that was sent later, shape (n,).
    doubled
        How often each came once more, shape (n,).
    """

    time: Array
    lost: Mask
    delay: Array
    late: Mask
    doubled: Integers

    def at(self, rows: Mask) -> Messages:
        """Some of them."""
        return Messages(self.time[rows], self.lost[rows], self.delay[rows], self.late[rows], self.doubled[rows])


class Waypoints(NamedTuple):
    """Where a node is at times; it goes straight in between, and rests before and after.

    Parameters
    ----------
    time
        In seconds, not decreasing, shape (m,).
    position
        In metres, shape (m, D).
    """

    time: Array
    position: Array


@dataclass(frozen=True)
class LinkData:
    """A file of link data.

    Parameters
    ----------
    nodes
        What the file calls them; of a file that tells of one link, its two ends.
    steps
        Quantities over time.
    messages
        Of a file that tells of each message.
    paths
        Of a file that says where nodes are: the way of each, in the order of the nodes.
    ends
        Until when it tells, in seconds.
    one_link
        Whether it tells of one link, whose ends are not named by it.
    everybody
        Whether it tells of all pairs, linked or not.
    offered
        Whether its rates are what was offered and passed, and no limits.
    paced
        Whether its times count messages, and are no seconds.
    period
        After how many seconds it begins anew, if it does.
    assumed
        What the format does not say, and is taken to be so.
    """

    nodes: tuple[str, ...]
    ends: float
    steps: Mapping[Quantity, Steps] = field(default_factory=dict)
    messages: Messages | None = None
    paths: Sequence[Waypoints] = ()
    one_link: bool = False
    everybody: bool = False
    offered: bool = False
    paced: bool = False
    period: float | None = None
    assumed: tuple[str, ...] = ()

    @property
    def starts(self) -> float:
        """The first time of which a line of it tells, in seconds."""
        told = [one.time[one.line > 0] for one in self.steps.values()] + [path.time[:1] for path in self.paths]
        times = np.concatenate([*told, np.empty(0)])
        return float(times.min()) if len(times) else 0.0

    def begun(self, at: float) -> LinkData:
        """The same from a time on, in seconds, which is 0 then: what held at it holds from 0."""
        if not at:
            return self
        if self.period is not None:
            turned = {what: _turned(one, at, self.period) for what, one in self.steps.items()}
            return replace(self, steps=turned)
        messages = self.messages and self.messages.at(self.messages.time >= at)
        return replace(
            self,
            steps={what: _held_from(one, at) for what, one in self.steps.items()},
            messages=messages and messages._replace(time=messages.time - at),
            paths=[path._replace(time=path.time - at) for path in self.paths],
            ends=self.ends - at,
        )

    def sent_every(self, seconds: float) -> LinkData:
        """The same, where a message was sent every so many seconds."""
        steps = {what: one._replace(time=one.time * seconds) for what, one in self.steps.items()}
        messages = self.messages and self.messages._replace(time=self.messages.time * seconds)
        return replace(self, steps=steps, messages=messages, ends=self.ends * seconds, paced=False)


def _held_from(given: Steps, at: float) -> Steps:
    order = np.lexsort((given.time, given.dst, given.src))
    own = given.at(order)
    after = own.time[1:] > at
    last = np.append((own.src[1:] != own.src[:-1]) | (own.dst[1:] != own.dst[:-1]) | after, True)[: len(order)]
    return own._replace(time=np.maximum(own.time - at, 0.0)).at((own.time >= at) | last)


def _turned(given: Steps, at: float, period: float) -> Steps:
    """Steps of one link over a period, from a time of it on."""
    own = given._replace(time=(given.time - at) % period)
    own = own.at(np.argsort(own.time, kind="stable"))
    if own.time[0] == 0.0:
        return own
    whole = own.at(
        np.append(len(own.time) - 1, np.arange(len(own.time)))
    )  # what is last in it holds when it begins anew
    whole.time[0] = 0.0
    return whole


def steps(rows: Sequence[tuple[int, float, int, int, float]]) -> Steps:
    """Rows of (line, time, src, dst, value) as columns."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    line, src, dst = (table[:, column].astype(np.int64) for column in (0, 2, 3))
    return Steps(line, table[:, 1], src, dst, table[:, 4])


def once_each(given: Steps, nodes: Sequence[str]) -> Steps:
    """Without the rows that are there twice.

    Raises
    ------
    MeasuredError
        When a link has two values at one time.
    """
    order = np.lexsort((given.time, given.dst, given.src))
    held = given.at(order)
    again = np.zeros(len(order), dtype=bool)
    again[1:] = (held.time[1:] == held.time[:-1]) & (held.src[1:] == held.src[:-1]) & (held.dst[1:] == held.dst[:-1])
    other = again.copy()
    other[1:] &= held.value[1:] != held.value[:-1]
    for place in np.flatnonzero(other)[:1]:
        pair = f"{nodes[held.src[place]]}->{nodes[held.dst[place]]}"
        raise MeasuredError(
            f"line {held.line[place]}: {pair} has two values at {held.time[place]:g} s: leave the one that holds"
        )
    return held.at(~again)
