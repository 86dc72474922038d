"""Tables with a heading: time, src, dst, and what a link is worth: availability, delay, rate, or what a curve makes one of."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from affinet.traces.link_data import UNITS, LinkData, Quantity, Steps, once_each
from analysis.models.arrays import Array, Integers, Mask
from netem.impairments.measured import Lines, MeasuredError, shown

_WHO = ("time", "src", "dst")
_DELIMITERS = (";", "\t", ",")
_COUNTS = {4: "four", 5: "five", 6: "six"}


class _Cells(NamedTuple):
    """Names of nodes, and cells by column, those of src and dst as places among the nodes."""

    nodes: tuple[str, ...]
    columns: Mapping[str, Array]


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    heading, _ = _split(_without_sep(lines))
    return set(_WHO) <= set(heading)


def read(lines: Lines) -> LinkData:
    """What a table says, delimited by commas, semicolons or tabs; with these two, commas are decimal.

    Raises
    ------
    MeasuredError
        When a line is no such row, or a link has two values at one time.
    """
    lines = _without_sep(lines)
    heading, delimiter = _heading(lines)
    rows = lines.after(1)
    numbers = np.array(rows.numbers, dtype=np.int64)
    nodes, columns = _cells(rows, heading, delimiter)
    time = columns["time"]
    _refuse_values(numbers, columns)
    src, dst = (columns[end].astype(np.int64) for end in _WHO[1:])
    steps = {}
    for what in Quantity:
        if what in columns:
            said = ~np.isnan(columns[what])
            steps[what] = once_each(Steps(numbers, time, src, dst, columns[what]).at(said), nodes)
    return LinkData(nodes=nodes, ends=float(time.max(initial=0.0)), steps=steps)


def _without_sep(lines: Lines) -> Lines:
    """Without the first line of a file that is for a spreadsheet."""
    return lines.after(1) if lines.texts and lines.texts[0].strip().lower().startswith("sep=") else lines


def _split(lines: Lines) -> tuple[list[str], str]:
    first = lines.texts[0] if lines.texts else ""
    delimiter = next((one for one in _DELIMITERS if one in first), ",")
    return [name.strip().strip('"').strip().lower() for name in first.split(delimiter)], delimiter


def _heading(lines: Lines) -> tuple[list[str], str]:
    heading, delimiter = _split(lines)
    told = [name for name in heading if name not in _WHO]
    if (
        sorted({*heading}) != sorted(heading)
        or not set(_WHO) <= set(heading)
        or not told
        or not set(told) <= {*Quantity}
    ):
        line, first = (lines.numbers[0], shown(lines.texts[0])) if lines.texts else (1, "none")
        raise MeasuredError(
            f"line {line}: the columns must be time,src,dst and one or more of {', '.join(Quantity)}, got {first}"
        )
    return heading, delimiter


def _cells(lines: Lines, heading: Sequence[str], delimiter: str) -> _Cells:
    if delimiter != ",":  # where commas delimit nothing, they are decimal
        lines = lines._replace(texts=[text.replace(",", ".") for text in lines.texts])
    try:
        table = np.loadtxt(lines.texts, delimiter=delimiter, comments=None, ndmin=2) if lines.texts else None
    except ValueError:
        return _as_written(lines, heading, delimiter)
    if table is None or table.shape[1] != len(heading):
        return _as_written(lines, heading, delimiter)
    columns = dict(zip(heading, table.T, strict=True))
    numbers, place = np.unique(np.concatenate([columns["src"], columns["dst"]]), return_inverse=True)
    columns["src"], columns["dst"] = np.split(place, 2)
    return _Cells(tuple(f"{number:g}" for number in numbers), columns)


def _as_written(lines: Lines, heading: Sequence[str], delimiter: str) -> _Cells:
    for line, text in zip(*lines, strict=True):
        if text.count('"') % 2:
            raise MeasuredError(f"line {line}: a quote is opened and never closed; numbers need none")
    nodes: dict[str, int] = {}
    table, fields = np.empty((len(lines.texts), len(heading))), csv.reader(lines.texts, delimiter=delimiter)
    due = f"{_COUNTS.get(len(heading), len(heading))} numbers are due"
    for row, (line, text) in enumerate(zip(*lines, strict=True)):
        try:
            cells = next(fields)
            table[row] = [
                nodes.setdefault(_name(cell), len(nodes)) if name in _WHO[1:] else _value(name, cell, len(heading))
                for name, cell in zip(heading, cells, strict=True)
            ]
        except (ValueError, csv.Error) as error:
            raise MeasuredError(f"line {line}: {due}, got {shown(text)}") from error
    return _Cells(tuple(nodes), dict(zip(heading, table.T, strict=True)))


def _name(cell: str) -> str:
    """A node's name; numbers of a table of floats are as whole ones."""
    text = cell.strip()
    if not text:
        raise ValueError("no name")
    try:
        return f"{float(text):g}"
    except ValueError:
        return text


def _value(name: str, cell: str, columns: int) -> float:
    if not cell.strip() and name != "time" and columns > len(_WHO) + 1:
        return float("nan")  # of several quantities, one was not measured
    number, percent, rest = cell.partition("%")
    if rest.strip() or (percent and name != Quantity.AVAILABILITY):
        raise ValueError("more behind the number")
    return float(number) / 100.0 if percent else float(number)


def _refuse_values(numbers: Integers, columns: Mapping[str, Array]) -> None:
    time = columns["time"]
    bad_time = ~((time >= 0.0) & (time < np.inf))
    several = len(columns) > len(_WHO) + 1
    for what in Quantity:
        if what not in columns:
            continue
        value = columns[what]
        known = ~np.isnan(value) if several else np.ones(len(value), dtype=bool)
        if what is Quantity.AVAILABILITY:
            wrong = ~((value >= 0.0) & (value <= 1.0))
            why = "time must be at least 0 s, and availability lie in [0, 1], or be written with a % like 50 %"
        elif what in (Quantity.RSSI, Quantity.PATHLOSS):
            wrong, why = ~np.isfinite(value), f"time must be at least 0 s, and {what} a number, in {UNITS[what]}"
        else:
            wrong = ~((value >= 0.0) & (value < np.inf))
            why = f"time must be at least 0 s, and {what} at least 0 {UNITS[what]}"
        _refuse(numbers, bad_time | (wrong & known), why)


def _refuse(numbers: Integers, wrong: Mask, why: str) -> None:
    for place in np.flatnonzero(wrong)[:1]:
        raise MeasuredError(f"line {numbers[place]}: {why}")
