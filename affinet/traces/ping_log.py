"""What a log of ping comes to, whichever system wrote it: round trips by number, as data of one link."""

from __future__ import annotations

from collections.abc import Mapping, Set
from typing import NamedTuple

import numpy as np

from affinet.traces.link_data import LinkData, Messages, Quantity, Steps
from analysis.models.arrays import Array
from netem.impairments.measured import MeasuredError

MOST = 10_000_000  # messages of a log
WIDEST = 500  # of a line, what is looked at
_HALF = "ping tells of round trips: half of one is taken as the delay one way, and what is lost on either way"


class Log(NamedTuple):
    """Messages by their number.

    Parameters
    ----------
    took
        Round trips of those that were answered, in ms.
    stamp, line
        Of those whose answer has a time before it: when they were sent, in seconds, and where that stands.
    late, doubled
        Those that were answered after one that was sent later, and how often which were answered once more.
    first, last
        Between what numbers all were sent.
    target
        Who was asked.
    assumed
        What is taken to be so.
    """

    took: Mapping[int, float]
    stamp: Mapping[int, float]
    line: Mapping[int, int]
    late: Set[int]
    doubled: Mapping[int, int]
    first: int
    last: int
    target: str
    assumed: tuple[str, ...]


def link_data(log: Log) -> LinkData:
    """The link that a log tells of.

    Raises
    ------
    MeasuredError
        When the times of its answers do not go up.
    """
    count = log.last - log.first + 1
    delay = np.full(count, np.nan)
    delay[_places(log.took, log.first)] = np.fromiter(log.took.values(), dtype=np.float64) / 2000.0
    lost, late = np.isnan(delay), np.zeros(count, dtype=bool)
    late[_places(log.late, log.first)] = True
    doubled = np.zeros(count, dtype=np.int64)
    doubled[_places(log.doubled, log.first)] = list(log.doubled.values())
    time = _times(np.arange(log.first, log.last + 1, dtype=np.float64), log)
    nowhere = np.zeros(count, dtype=np.int64)
    pace = float(time[-1] / (count - 1)) if count > 1 else 1.0
    return LinkData(
        nodes=("here", log.target),
        ends=float(time[-1]) + pace,
        steps={
            Quantity.AVAILABILITY: Steps(nowhere, time, nowhere, nowhere + 1, 1.0 - lost),
            Quantity.DELAY: Steps(nowhere, time, nowhere, nowhere + 1, delay).at(~lost),
        },
        messages=Messages(time, lost, delay, late, doubled),
        one_link=True,
        paced=not log.stamp,
        assumed=(_HALF, *log.assumed),
    )


def _places(
    numbers: Mapping[int, float] | Mapping[int, int] | Set[int], first: int
) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    return np.fromiter(numbers, dtype=np.int64, count=len(numbers)) - first


def _times(numbers: Array, log: Log) -> Array:
    """When each message was sent: in seconds by the stamps of the log, or how many went before it."""
    if not log.stamp:
        return np.asarray(numbers - numbers[0])
    known = np.array(sorted(log.stamp))
    at = np.array([log.stamp[one] for one in known.tolist()])
    for place in np.flatnonzero(np.diff(at) <= 0.0)[:1]:
        raise MeasuredError(
            f"line {log.line[int(known[place + 1])]}: the times in brackets do not go up with icmp_seq: of which log are they?"
        )
    pace = (at[-1] - at[0]) / (known[-1] - known[0]) if len(known) > 1 else 1.0
    time = np.interp(numbers, known, at)
    time = time + np.minimum(numbers - known[0], 0) * pace + np.maximum(numbers - known[-1], 0) * pace
    return np.asarray(time - time[0])
