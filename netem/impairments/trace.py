"""What links were worth over time, as measured in the field or in an earlier run: availability, delay or rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.core.listing import listed

# A time within this share of a tick from its beginning is meant to be there.
_SLACK = 1e-6
# Means over parts of a tick are exact where all parts say the same.
_DECIMALS = 12


class TraceError(ValueError):
    """What is missing in a trace, and the way out."""


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


@dataclass(frozen=True)
class DelayTrace:
    """A delay that changes at some ticks and holds in between; it is added to what other delays there are.

    Parameters
    ----------
    ticks
        When it changes, increasing from 0, shape (M,).
    seconds
        From then on, shape (M, L); 0 on links without a trace.
    """

    ticks: Integers
    seconds: Array

    def at(self, ticks: Integers) -> Array:
        """The delay in ticks (T,), in seconds, shape (T, L)."""
        held: Array = self.seconds[np.searchsorted(self.ticks, ticks, side="right") - 1]
        return held


class Measured(NamedTuple):
    """What links are worth at times: what was measured holds until the next of its link.

    Parameters
    ----------
    time, link, value
        In seconds, row of the link, and availability, delay (s) or rate (bit/s), shape (n,), in any order.
    """

    time: Array
    link: Integers
    value: Array

    def over(self, links: int, dt: float, ticks: int) -> tuple[Integers, Array]:
        """When what a run's links are worth changes, shape (M,), and to what, shape (M, links); NaN before the first.

        A tick has the mean over its time of what was measured, so that any clock meets the same losses.

        Parameters
        ----------
        links
            How many there are.
        dt, ticks
            Clock of the run, in seconds, and its length: what was measured after it is left out.
        """
        order = np.lexsort((self.time, self.link))
        begin, link, value = self._in_ticks(dt, ticks)[order], self.link[order], self.value[order]
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


def table(
    measured: Measured,
    links: Links,
    rows: Mask,
    dt: float,
    ticks: int,
    what: str = "availability",
    otherwise: float = 1.0,
) -> tuple[Integers, Array]:
    """When what links are worth in a run changes, shape (M,), and to what, shape (M, L).

    Parameters
    ----------
    measured
        What is known of the links.
    links, rows
        The links of the formation, and the ones that need a trace, shape (L,).
    dt, ticks
        Tick of the run, in seconds, and its length.
    what
        Was measured, for people.
    otherwise
        What links are worth that need no trace.

    Raises
    ------
    TraceError
        When a link that needs a trace has none from the start.
    """
    needs = rows[measured.link]
    needed = Measured(measured.time[needs], measured.link[needs], measured.value[needs])
    changes, value = needed.over(len(links), dt, ticks)
    if not len(changes) or changes[0] != 0:
        first = f"{needed.time.min():g} s" if len(needed.time) else "no time"
        raise TraceError(
            f"the trace must begin at time 0, its first row is of {first}; begins = ... says where to begin"
        )
    if (gaps := np.flatnonzero(np.isnan(value[0]) & rows)).size:
        missing = listed(f"{links.src[row]}->{links.dst[row]}" for row in gaps)
        raise TraceError(f"no {what} at time 0 for {missing}")
    return changes, np.where(rows, value, otherwise)


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
