"""Movements of ns-2: `$node_(0) set X_ 5.0`, and `$ns_ at 2.0 "$node_(0) setdest 10.0 5.0 1.5"`."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from affinet.traces.fields import LATEST, MOST_NODES, moment, number
from affinet.traces.link_data import LinkData, Waypoints
from analysis.models.arrays import Array
from netem.impairments.measured import Lines, MeasuredError, shown

_SET = re.compile(r"\$node_\((\d{1,18})\)\s+set\s+([XYZ])_\s+(\S+)\s*")
_AT = re.compile(r'\$ns_?\s+at\s+(\S+)\s+"\$node_\((\d{1,18})\)\s+(setdest|set)(\s[^"]*)"\s*')
_AXES = {"X": 0, "Y": 1, "Z": 2}
_OTHER = ("$god_", "set ", "$ns_ initial", "$topo", "puts ")


class _Leg(NamedTuple):
    line: int
    time: float
    to: Array
    speed: float


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return any("$node_(" in text for text in lines.texts[:200])


def read(lines: Lines) -> LinkData:
    """The ways of the nodes: straight at a speed, and at rest where they arrive.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    start: dict[int, Array] = {}
    legs: dict[int, list[_Leg]] = {}
    for line, text in zip(*lines, strict=True):
        text = text.strip()
        if placed := _SET.fullmatch(text):
            position = start.setdefault(int(placed[1]), np.full(3, np.nan))
            position[_AXES[placed[2]]] = number(line, placed[3], f"{placed[2]}_ in m")
        elif moved := _AT.fullmatch(text):
            if moved[3] == "set":
                raise MeasuredError(f"line {line}: a node that jumps: give its place at first, and then setdest")
            legs.setdefault(int(moved[2]), []).append(_leg(line, moved[1], moved[4]))
        elif not text.startswith(_OTHER):
            raise MeasuredError(
                f'line {line}: $node_(N) set X_ ..., or $ns_ at T "$node_(N) setdest X Y SPEED", is due, '
                f"got {shown(text)}"
            )
    for node, own in legs.items():
        if node not in start:
            raise MeasuredError(f"line {own[0].line}: node {node} moves and has no place at first: set its X_ and Y_")
    if not start:
        raise MeasuredError("line 1: no node in it: $node_(N) set X_ ... says where one is")
    if len(start) > MOST_NODES:
        raise MeasuredError(
            f"it has {len(start)} nodes, and at most {MOST_NODES} are read: leave out those that are none"
        )
    for node, position in start.items():
        if np.isnan(position[:2]).any():
            raise MeasuredError(f"node {node} has no {'X_' if np.isnan(position[0]) else 'Y_'} at first: set it")
    nodes = sorted(start)
    paths = [_way(start[node], sorted(legs.get(node, []), key=lambda leg: leg.time)) for node in nodes]
    return LinkData(
        nodes=tuple(map(str, nodes)),
        ends=max(float(path.time[-1]) for path in paths),
        paths=paths,
        everybody=True,
        assumed=("a node that is told anew turns where it is; its height stays as it was set, 0 m where it was not",),
    )


def _leg(line: int, time: str, said: str) -> _Leg:
    words = said.split()
    if len(words) != 3:
        raise MeasuredError(f"line {line}: setdest takes X, Y and a speed, got {shown(said.strip())}")
    x, y = (number(line, word, f"{axis} in m") for word, axis in zip(words, "XY", strict=False))
    speed = number(line, words[2], "a speed in m/s", least=0.0)
    return _Leg(line, moment(line, time), np.array([x, y]), speed)


def _way(start: Array, legs: list[_Leg]) -> Waypoints:
    here = np.nan_to_num(start, nan=0.0)
    times, places = [0.0], [here]
    for leg, following in zip(legs, [*legs[1:], None], strict=False):
        if leg.time > times[-1]:
            times.append(leg.time)
            places.append(here)
        ahead = np.append(leg.to, here[2]) - here
        far = float(np.sqrt((ahead * ahead).sum()))
        if not far or not leg.speed:
            continue
        lasts = far / leg.speed
        share = 1.0 if following is None else min(1.0, (following.time - leg.time) / lasts)
        here = here + share * ahead
        if leg.time + share * lasts > LATEST:
            raise MeasuredError(
                f"line {leg.line}: at {leg.speed:g} m/s the way takes {lasts:.3g} s: give a higher speed"
            )
        times.append(leg.time + share * lasts)
        places.append(here)
    return Waypoints(np.array(times), np.array(places))
