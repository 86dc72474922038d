"""Pairs of nodes that meet and part: from events, or from begin and end, to links that are up and down both ways."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from affinet.traces.fields import MOST_NODES
from affinet.traces.link_data import LinkData, Quantity, Steps, steps
from netem.impairments.measured import MeasuredError

_ASSUMED = "who is in contact is so both ways, and whoever is not said to be is not; in contact all passes"


class Meeting(NamedTuple):
    """An event: a pair is up, or down, from a time (s) on."""

    line: int
    time: float
    one: str
    other: str
    up: bool


def from_events(events: Sequence[Meeting], ends: float, assumed: Sequence[str] = ()) -> LinkData:
    """The links of events in the order of time.

    Parameters
    ----------
    events
        In the order of the file.
    ends
        Until when it tells, in seconds.
    assumed
        What else is taken to be so.

    Raises
    ------
    MeasuredError
        When a pair parts that never met, meets twice, or time goes back.
    """
    if not events:
        raise MeasuredError("line 1: nobody ever meets in it: one line says when two do, and that they are up")
    nodes: dict[str, int] = {}
    up: dict[tuple[str, str], bool] = {}
    rows: list[tuple[int, float, int, int, float]] = []
    before = 0.0
    for event in events:
        pair = (min(event.one, event.other), max(event.one, event.other))
        if event.one == event.other:
            raise MeasuredError(f"line {event.line}: {event.one} meets itself: two nodes are due")
        if event.time < before:
            raise MeasuredError(f"line {event.line}: {event.time:g} s comes after {before:g} s: sort the lines by time")
        if up.get(pair, False) == event.up:
            was = "up already" if event.up else "not up"
            raise MeasuredError(
                f"line {event.line}: {pair[0]} and {pair[1]} go {'up' if event.up else 'down'} and were {was}: "
                "a line is missing, or there twice"
            )
        up[pair], before = event.up, event.time
        one, other = (nodes.setdefault(name, len(nodes)) for name in (event.one, event.other))
        if len(nodes) > MOST_NODES:
            raise MeasuredError(f"line {event.line}: more than {MOST_NODES} nodes: leave out those that are no agents")
        rows += [(event.line, event.time, src, dst, float(event.up)) for src, dst in ((one, other), (other, one))]
    held = down_at_first(steps(rows), len(nodes))
    return LinkData(
        tuple(nodes), max(ends, before), {Quantity.AVAILABILITY: held}, everybody=True, assumed=(*assumed, _ASSUMED)
    )


def down_at_first(held: Steps, nodes: int) -> Steps:
    """With all pairs down at time 0 that are not told of at it."""
    src, dst = (ends.ravel() for ends in np.meshgrid(np.arange(nodes), np.arange(nodes), indexing="ij"))
    told = np.zeros((nodes, nodes), dtype=bool)
    told[held.src[held.time == 0.0], held.dst[held.time == 0.0]] = True
    missing = (src != dst) & ~told[src, dst]
    src, dst = src[missing], dst[missing]
    nothing = np.zeros(len(src), dtype=np.int64)
    return Steps(
        np.concatenate([nothing, held.line]),
        np.concatenate([nothing * 0.0, held.time]),
        np.concatenate([src, held.src]),
        np.concatenate([dst, held.dst]),
        np.concatenate([nothing * 0.0, held.value]),
    )
