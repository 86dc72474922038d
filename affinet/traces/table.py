"""Tables with a heading: time, src, dst, and what a link is worth: availability, delay, rate, or what a curve makes one of."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from affinet.traces.fields import FARTHEST, FASTEST, LARGEST_DB, LATEST, node
from affinet.traces.link_data import UNITS, LinkData, Quantity, Steps, once_each
from analysis.models.arrays import Array, Integers, Mask
from netem.impairments.measured import LONGEST, Lines, MeasuredError, shown

_WHO = ("time", "src", "dst")
_DELIMITERS = (";", "\t", ",")
_LARGEST: Mapping[Quantity, float] = {
    Quantity.DELAY: LONGEST,
    Quantity.RATE: FASTEST,
    Quantity.RSSI: LARGEST_DB,
    Quantity.PATHLOSS: LARGEST_DB,
    Quantity.DISTANCE: FARTHEST,
}
_COUNTS = {4: "four", 5: "five", 6: "six"}


class _Cells(NamedTuple):
    """Names of nodes, and cells by column, those of src and dst as places among the nodes; and which of them say nothing."""

    nodes: tuple[str, ...]
    columns: Mapping[str, Array]
    blank: Mapping[str, Mask]


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    heading, _ = _split(_without_sep(lines))
    return set(_WHO) <= set(heading)


def read(lines: Lines) -> LinkData:
    """What a table says, delimited by commas, semicolons or tabs; with these two, commas are decimal.

    Raises
    ------
    MeasuredError
        When there is no row, a line is no such row, or a link has two values at one time.
    """
    lines = _without_sep(lines)
    heading, delimiter = _heading(lines)
    rows = lines.after(1)
    if not rows.texts:
        raise MeasuredError(
            f"line {lines.numbers[0]}: a heading and no row below it: what was each link worth at time 0?"
        )
    numbers = np.array(rows.numbers, dtype=np.int64)
    nodes, columns, blank = _cells(rows, heading, delimiter)
    time = columns["time"]
    _refuse_values(numbers, columns, blank)
    src, dst = (columns[end].astype(np.int64) for end in _WHO[1:])
    for place in np.flatnonzero(src == dst)[:1]:
        name = nodes[src[place]]
        raise MeasuredError(f"line {numbers[place]}: {name}->{name} is not a link: two nodes are due")
    told = [what for what in Quantity if what in columns]
    empty = [what for what in told if blank[what].all()]
    if len(empty) == len(told):
        raise MeasuredError(
            f"line {numbers[0]}: no value of {', '.join(told)} here or below: what was each link worth?"
        )
    steps = {
        what: once_each(Steps(numbers, time, src, dst, columns[what]).at(~blank[what]), nodes)
        for what in told
        if what not in empty
    }
    assumed = tuple(f"it has a column of {what} and no value in it: it says nothing of that" for what in empty)
    return LinkData(nodes=nodes, ends=float(time.max(initial=0.0)), steps=steps, assumed=assumed)


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
    nothing = np.zeros(len(table), dtype=bool)  # a blank cell is no number
    return _Cells(tuple(node(str(number)) for number in numbers.tolist()), columns, dict.fromkeys(heading, nothing))


def _as_written(lines: Lines, heading: Sequence[str], delimiter: str) -> _Cells:
    for line, text in zip(*lines, strict=True):
        if text.count('"') % 2:
            raise MeasuredError(f"line {line}: a quote is opened and never closed; numbers need none")
    nodes: dict[str, int] = {}
    table, fields = np.empty((len(lines.texts), len(heading))), csv.reader(lines.texts, delimiter=delimiter)
    blank = np.zeros(table.shape, dtype=bool)
    optional = np.array([name in {*Quantity} and len(heading) > len(_WHO) + 1 for name in heading])
    due = f"{_COUNTS.get(len(heading), len(heading))} numbers are due"
    for row, (line, text) in enumerate(zip(*lines, strict=True)):
        try:
            cells = next(fields)
            blank[row] = optional & [not cell.strip() for cell in cells]
            table[row] = [
                np.nan
                if nothing
                else nodes.setdefault(_name(cell), len(nodes))
                if name in _WHO[1:]
                else _value(name, cell)
                for name, cell, nothing in zip(heading, cells, blank[row].tolist(), strict=True)
            ]
        except (ValueError, csv.Error) as error:
            raise MeasuredError(f"line {line}: {due}, got {shown(text)}") from error
    return _Cells(tuple(nodes), dict(zip(heading, table.T, strict=True)), dict(zip(heading, blank.T, strict=True)))


def _name(cell: str) -> str:
    if not cell.strip():
        raise ValueError("no name")
    return node(cell)


def _value(name: str, cell: str) -> float:
    number, percent, rest = cell.partition("%")
    if rest.strip() or (percent and name != Quantity.AVAILABILITY):
        raise ValueError("more behind the number")
    return float(number) / 100.0 if percent else float(number)


def _refuse_values(numbers: Integers, columns: Mapping[str, Array], blank: Mapping[str, Mask]) -> None:
    time = columns["time"]
    bad_time = ~((time >= 0.0) & (time < np.inf))
    _refuse_large(numbers, "time", time, LATEST, "s")
    for what in Quantity:
        if what not in columns:
            continue
        value = columns[what]
        if (most := _LARGEST.get(what)) is not None:
            _refuse_large(numbers, what, value, most, UNITS[what])
        if what is Quantity.AVAILABILITY:
            wrong = ~((value >= 0.0) & (value <= 1.0))
            why = "time must be at least 0 s, and availability lie in [0, 1], or be written with a % like 50 %"
        elif what in (Quantity.RSSI, Quantity.PATHLOSS):
            wrong, why = ~np.isfinite(value), f"time must be at least 0 s, and {what} a number, in {UNITS[what]}"
        else:
            wrong = ~((value >= 0.0) & (value < np.inf))
            why = f"time must be at least 0 s, and {what} at least 0 {UNITS[what]}"
        _refuse(numbers, bad_time | (wrong & ~blank[what]), why)


def _refuse_large(numbers: Integers, what: str, value: Array, most: float, unit: str) -> None:
    for place in np.flatnonzero((np.abs(value) > most) & (np.abs(value) < np.inf))[:1]:
        raise MeasuredError(
            f"line {numbers[place]}: {what} is {value[place]:g} {unit}: at most {most:g} {unit}; is its unit another?"
        )


def _refuse(numbers: Integers, wrong: Mask, why: str) -> None:
    for place in np.flatnonzero(wrong)[:1]:
        raise MeasuredError(f"line {numbers[place]}: {why}")
