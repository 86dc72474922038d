"""Availability read from a file: what a link was worth at the time, as measured in the field or in an earlier run."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.core.listing import listed
from netem.impairments.measured import Lines, MeasuredError, read, shown

_COLUMNS = ("time", "src", "dst", "availability")
_DELIMITERS = (";", "\t", ",")
# A time within this share of a tick from its beginning is meant to be there.
_SLACK = 1e-6
# Means over parts of a tick are exact where all parts say the same.
_DECIMALS = 12


class TraceError(ValueError):
    """What is wrong in a trace: the line, and what would be right."""


@dataclass(frozen=True)
class Trace:
    """Availability that changes at some ticks and holds in between.

    Parameters
    ----------
    ticks
        When it changes, increasing from 0, shape (M,).
    availability
        Probability that a message passes from then on, shape (M, L); 1 on links without a trace.
    sensing, comms
        The channel classes on which it acts.
    """

    ticks: Integers
    availability: Array
    sensing: bool
    comms: bool

    def lost(self, ticks: Integers, draw: Array) -> Mask:
        """True where a message is lost in ticks (T,), shape (T, C, L), for uniform draws (T, C, L)."""
        passing = self.availability[np.searchsorted(self.ticks, ticks, side="right") - 1]
        decided: Mask = draw >= passing[:, None]
        return decided


class MeasuredAvailability(NamedTuple):
    """Availability of links at times: what was measured holds until the next of its link.

    Parameters
    ----------
    time, link, availability
        In seconds, row of the link, and probability that a message passes, shape (n,), in any order.
    """

    time: Array
    link: Integers
    availability: Array

    def over(self, links: int, dt: float, ticks: int) -> tuple[Integers, Array]:
        """When the availability of a run's links changes, shape (M,), and to what, shape (M, links); NaN before the first.

        A tick has the mean over its time of what was measured, so that any clock meets the same losses.

        Parameters
        ----------
        links
            How many there are.
        dt, ticks
            Clock of the run, in seconds, and its length: what was measured after it is left out.
        """
        order = np.lexsort((self.time, self.link))
        begin, link, value = self._in_ticks(dt, ticks)[order], self.link[order], self.availability[order]
        last = np.append(link[1:] != link[:-1], np.ones(min(1, len(link)), dtype=bool))
        end = np.minimum(np.where(last, np.inf, np.append(begin[1:], np.inf)), ticks)
        reached = begin < end
        return _by_tick(begin[reached], end[reached], link[reached], value[reached], links)

    def splits_ticks(self, dt: float, ticks: int) -> bool:
        """Whether anything changes within a tick of a run of this clock (s) and length."""
        begin = self._in_ticks(dt, ticks)
        return bool((begin != np.round(begin)).any())

    def _in_ticks(self, dt: float, ticks: int) -> Array:
        begin = np.minimum(self.time, dt * (ticks + 1)) / dt
        whole = np.round(begin)
        return np.where(np.abs(begin - whole) <= _SLACK, whole, begin)


def from_csv(file: Path, links: Links) -> MeasuredAvailability:
    """A CSV of `time,src,dst,availability` (s, agents, probability), delimited by commas, semicolons or tabs.

    Parameters
    ----------
    file
        With a heading that names the columns, in any order.
    links
        Of the formation.

    Raises
    ------
    TraceError
        When a line is not such a row, a link is strange, or has two values at one time.
    OSError
        When it cannot be read.
    """
    try:
        lines = read(file)
    except MeasuredError as error:
        raise TraceError(str(error)) from error
    if lines.texts and lines.texts[0].strip().lower().startswith("sep="):  # for a spreadsheet
        lines = lines.after(1)
    heading, delimiter = _heading(lines)
    lines = lines.after(1)
    columns = dict(zip(heading, _columns(lines, delimiter).T, strict=True))
    time, src, dst, availability = (columns[name] for name in _COLUMNS)
    numbers = np.array(lines.numbers, dtype=np.int64)
    _refuse(numbers, (src % 1.0 != 0.0) | (dst % 1.0 != 0.0), "src and dst are numbers of agents")
    outside = ~((availability >= 0.0) & (availability <= 1.0) & (time >= 0.0) & (time < np.inf))
    _refuse(
        numbers, outside, "time must be at least 0 s, and availability lie in [0, 1], or be written with a % like 50 %"
    )
    link = _rows_of(links, src, dst)
    for place in np.flatnonzero(link < 0)[:1]:
        raise TraceError(f"line {numbers[place]}: {src[place]:g}->{dst[place]:g} is not a link of the formation")
    return _once_each(MeasuredAvailability(time, link, availability), links, numbers)


def table(measured: MeasuredAvailability, links: Links, rows: Mask, dt: float, ticks: int) -> tuple[Integers, Array]:
    """When the availability of a run changes, shape (M,), and to what, shape (M, L); 1 on links that need no trace.

    Parameters
    ----------
    measured
        What is known of the links.
    links, rows
        The links of the formation, and the ones that need a trace, shape (L,).
    dt, ticks
        Tick of the run, in seconds, and its length.

    Raises
    ------
    TraceError
        When a link that needs a trace has none from the start.
    """
    needs = rows[measured.link]
    needed = MeasuredAvailability(measured.time[needs], measured.link[needs], measured.availability[needs])
    changes, availability = needed.over(len(links), dt, ticks)
    if not len(changes) or changes[0] != 0:
        raise TraceError("the trace must begin at time 0")
    if (gaps := np.flatnonzero(np.isnan(availability[0]) & rows)).size:
        missing = listed(f"{links.src[row]}->{links.dst[row]}" for row in gaps)
        raise TraceError(f"no availability at time 0 for {missing}")
    return changes, np.where(rows, availability, 1.0)


def _heading(lines: Lines) -> tuple[list[str], str]:
    line, first = (lines.numbers[0], lines.texts[0]) if lines.texts else (1, "")
    delimiter = next((one for one in _DELIMITERS if one in first), ",")
    heading = [name.strip().strip('"').strip().lower() for name in first.split(delimiter)]
    if sorted(heading) != sorted(_COLUMNS):
        raise TraceError(
            f"line {line}: the columns must be {','.join(_COLUMNS)}, got {shown(first) if first else 'none'}"
        )
    return heading, delimiter


def _columns(lines: Lines, delimiter: str) -> Array:
    """The numbers in the lines, shape (n, 4)."""
    if not lines.texts:
        return np.empty((0, len(_COLUMNS)))
    if delimiter != ",":  # where commas delimit nothing, they are decimal
        lines = lines._replace(texts=[text.replace(",", ".") for text in lines.texts])
    try:
        table = np.loadtxt(lines.texts, delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        return _as_written(lines, delimiter)
    return table if table.shape[1] == len(_COLUMNS) else _as_written(lines, delimiter)


def _as_written(lines: Lines, delimiter: str) -> Array:
    for line, text in zip(*lines, strict=True):
        if text.count('"') % 2:
            raise TraceError(f"line {line}: a quote is opened and never closed; numbers need none")
    table, fields = np.empty((len(lines.texts), len(_COLUMNS))), csv.reader(lines.texts, delimiter=delimiter)
    for row, (line, text) in enumerate(zip(*lines, strict=True)):
        try:
            time, src, dst, availability = next(fields)
            table[row] = [_value(field) for field in (time, src, dst, availability)]
        except (ValueError, csv.Error) as error:
            raise TraceError(f"line {line}: four numbers are due, got {shown(text)}") from error
    return table


def _value(text: str) -> float:
    number, percent, rest = text.partition("%")
    if rest.strip():
        raise ValueError("more behind the %")
    return float(number) / 100.0 if percent else float(number)


def _refuse(numbers: Integers, wrong: Mask, why: str) -> None:
    for place in np.flatnonzero(wrong)[:1]:
        raise TraceError(f"line {numbers[place]}: {why}")


def _rows_of(links: Links, src: Array, dst: Array) -> Integers:
    """Row of each link, -1 where there is none."""
    known = (src >= 1) & (src <= links.agents) & (dst >= 1) & (dst <= links.agents)
    row_of = np.full((links.agents + 1, links.agents + 1), -1)
    row_of[links.src, links.dst] = np.arange(len(links))
    pair = (np.where(known, ends, 0).astype(np.int64) for ends in (src, dst))
    return np.where(known, row_of[*pair], -1)


def _once_each(measured: MeasuredAvailability, links: Links, numbers: Integers) -> MeasuredAvailability:
    """Without the rows that are there twice."""
    order = np.lexsort((measured.time, measured.link))
    time, link, availability = (field[order] for field in measured)
    again = np.append(False, (time[1:] == time[:-1]) & (link[1:] == link[:-1]))[: len(time)]
    other = again & np.append(False, availability[1:] != availability[:-1])[: len(time)]
    for place in np.flatnonzero(other)[:1]:
        pair, line = f"{links.src[link[place]]}->{links.dst[link[place]]}", numbers[order[place]]
        raise TraceError(f"line {line}: {pair} has two values at {time[place]:g} s")
    return MeasuredAvailability(time[~again], link[~again], availability[~again])


def _by_tick(begin: Array, end: Array, link: Integers, value: Array, links: int) -> tuple[Integers, Array]:
    """Values that hold from `begin` to `end`, in ticks, as the mean over each tick: changes (M,), availability (M, links)."""
    inside, first = np.floor(begin).astype(np.int64), np.ceil(begin).astype(np.int64)
    final = np.floor(end).astype(np.int64)
    split = inside < first
    cut = (end > final) & (final >= first)
    changes = np.unique(np.concatenate([inside, first[end > first], final[cut]]))
    table = np.full((len(changes), links), np.nan)
    entire = first + 1 <= end
    table[np.searchsorted(changes, first[entire]), link[entire]] = value[entire]
    parts = np.zeros_like(table)
    share = np.minimum(end, first) - begin
    np.add.at(parts, (np.searchsorted(changes, inside[split]), link[split]), (value * share)[split])
    np.add.at(parts, (np.searchsorted(changes, final[cut]), link[cut]), (value * (end - np.maximum(begin, final)))[cut])
    for place, of in ((inside[split], link[split]), (final[cut], link[cut])):
        cell = np.searchsorted(changes, place), of
        table[cell] = np.round(parts[cell], _DECIMALS)
    return changes, _held(table)


def _held(table: Array) -> Array:
    """Each value until the next."""
    last = np.where(np.isnan(table), 0, np.arange(len(table))[:, None])
    held: Array = np.take_along_axis(table, np.maximum.accumulate(last, axis=0), axis=0)
    return held
