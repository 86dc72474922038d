"""Availability read from a file: what a link was worth at the time, as measured in the field or in an earlier run."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from netem.draws import Array
from netem.links import Integers, Links, Mask


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


def read(lines: Iterable[str], links: Links, rows: Mask, dt: float) -> tuple[Integers, Array]:
    """A CSV of `time,src,dst,availability` (s, agents, probability): when availability changes, and to what.

    Parameters
    ----------
    lines
        Of the file, with the header.
    links, rows
        The links of the formation, and the ones that need a trace, shape (L,).
    dt
        Tick, in seconds.

    Raises
    ------
    TraceError
        When a line is not such a row, a link is strange, or a link that needs a trace has none from the start.
    """
    reader = csv.DictReader(lines)
    if (reader.fieldnames or []) != ["time", "src", "dst", "availability"]:
        raise TraceError(f"line 1: the columns must be time,src,dst,availability, got {reader.fieldnames}")
    given = [_row(reader.line_num, row, links, dt) for row in reader]
    ticks = np.array(sorted({tick for tick, _, _ in given}), dtype=np.int64)
    if not len(ticks) or ticks[0] != 0:
        raise TraceError("the trace must begin at time 0")
    table = np.full((len(ticks), len(links)), np.nan)
    for tick, link, availability in given:
        cell = np.searchsorted(ticks, tick), link
        if not np.isnan(table[cell]):
            raise TraceError(f"{links.src[link]}->{links.dst[link]} has two values at {tick * dt:g} s")
        table[cell] = availability
    table = _held(table)
    if (gaps := np.flatnonzero(np.isnan(table[0]) & rows)).size:
        missing = ", ".join(f"{links.src[row]}->{links.dst[row]}" for row in gaps[:6])
        raise TraceError(f"no availability at time 0 for {missing}{' and more' if len(gaps) > 6 else ''}")
    return ticks, np.where(rows, table, 1.0)


def _row(line: int, row: dict[str, str], links: Links, dt: float) -> tuple[int, int, float]:
    if None in row:
        raise TraceError(f"line {line}: four numbers are due, and there are more")
    try:
        time, pair = float(row["time"]), (int(row["src"]), int(row["dst"]))
        availability = float(row["availability"])
    except (TypeError, ValueError) as error:
        raise TraceError(f"line {line}: four numbers are due, got {list(row.values())}") from error
    if not 0.0 <= availability <= 1.0 or not 0.0 <= time < np.inf:
        raise TraceError(f"line {line}: time must be at least 0 s, and availability lie in [0, 1]")
    if pair not in links.index:
        raise TraceError(f"line {line}: {pair[0]}->{pair[1]} is not a link of the formation")
    return round(time / dt), links.index[pair], availability


def _held(table: Array) -> Array:
    """Each value until the next."""
    last = np.where(np.isnan(table), 0, np.arange(len(table))[:, None])
    held: Array = np.take_along_axis(table, np.maximum.accumulate(last, axis=0), axis=0)
    return held
