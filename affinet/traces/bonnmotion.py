"""Movements of BonnMotion: a line for each node, `t x y t x y ...`; in space, `t x y z ...`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from affinet.traces.fields import FARTHEST, LATEST, MOST_NODES, numbers_only
from affinet.traces.link_data import LinkData, Waypoints
from analysis.models.arrays import Array
from netem.impairments.measured import Lines, MeasuredError, shown

_WIDEST = 4  # numbers of a place and its time


def recognised(lines: Lines) -> bool:
    """Whether it is such a file: a row of one place is of a node at rest, and of such rows all begin at one time."""
    rows = [numbers_only(text) for text in lines.texts[:50]]
    if not rows or any(not row for row in rows) or any("," in text for text in lines.texts) or not _widths(lines):
        return False
    return any(row and len(row) > _WIDEST for row in rows) or len({row[0] for row in rows if row}) == 1


def read(lines: Lines) -> LinkData:
    """The ways of the nodes: straight from place to place, each reached at its time.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    if not lines.texts:
        raise MeasuredError("line 1: no node in it: a line of times and places is due for each")
    for line, text in zip(*lines, strict=True):
        values = numbers_only(text)
        if values is None or not np.isfinite(values).all():
            raise MeasuredError(
                f"line {line}: only numbers are due, t x y or t x y z, again and again; got {shown(text)}"
            )
        if len(values) % 3 and len(values) % 4:
            raise MeasuredError(f"line {line}: {len(values)} numbers are no whole triples (t x y), nor t x y z")
    widths = _widths(lines)
    if not widths:
        raise MeasuredError(_why_none(lines))
    if len(lines.texts) > MOST_NODES:
        raise MeasuredError(
            f"line {lines.numbers[MOST_NODES]}: more than {MOST_NODES} nodes: leave out those that are no agents"
        )
    paths = [_path(text, widths[0]) for text in lines.texts]
    _refuse_far(lines.numbers, paths)
    in_space = "taken as t x y" if widths[0] == 3 else "taken as t x y z"
    return LinkData(
        nodes=tuple(str(number) for number in range(1, len(paths) + 1)),
        ends=max(float(path.time[-1]) for path in paths),
        paths=paths,
        everybody=True,
        assumed=(f"a node is called by the number of its line, from 1; a line is {in_space}, again and again",),
    )


def _refuse_far(numbers: Sequence[int], paths: Sequence[Waypoints]) -> None:
    for line, path in zip(numbers, paths, strict=True):
        if path.time[-1] > LATEST:
            raise MeasuredError(
                f"line {line}: a time of {path.time[-1]:g} s: at most {LATEST:g} s: is its unit another?"
            )
        if (far := float(np.abs(path.position).max())) > FARTHEST:
            raise MeasuredError(f"line {line}: a place {far:g} m away: at most {FARTHEST:g} m")


def _table(text: str, width: int) -> Array | None:
    values = numbers_only(text) or []
    return None if len(values) % width else np.array(values).reshape(-1, width)


def _widths(lines: Lines) -> list[int]:
    """How many numbers a place has, 3 or 4, by which times go up on every line."""
    return [width for width in (3, 4) if all(_goes_up(_table(text, width)) for text in lines.texts)]


def _goes_up(table: Array | None) -> bool:
    return table is not None and len(table) > 0 and table[0, 0] >= 0.0 and bool((np.diff(table[:, 0]) >= 0.0).all())


def _why_none(lines: Lines) -> str:
    for line, text in zip(*lines, strict=True):
        if not any(_goes_up(_table(text, width)) for width in (3, 4)):
            return f"line {line}: its times do not go up, neither as t x y nor as t x y z"
    return "some lines are t x y and others t x y z: make them alike"


def _path(text: str, width: int) -> Waypoints:
    table = _table(text, width)
    assert table is not None  # as it was looked at
    return Waypoints(table[:, 0], table[:, 1:])
