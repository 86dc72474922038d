"""What arrives, message by message, where it is known what became of each: to be held against what did arrive."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Integers, Mask
from netem.impairments.corrupt import Mark
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict

_PASSED = (int(Verdict.DELIVERED), int(Verdict.DELAYED))


def expected(made: Verdicts) -> Integers:
    """The messages that verdicts of ticks (T, C, L) have arrive within these ticks, and their copies, which are whole.

    Returns
    -------
    Integers
        Rows of (tick, content tick, channel row, link row, mark), shape (m, 5).
    """
    tick, channel, link = np.nonzero(np.isin(made.kind, _PASSED))
    due, mark, copy = (field[tick, channel, link].astype(np.int64) for field in (made.due, made.mark, made.copy_due))
    first = np.stack([due, tick - (mark == Mark.STALE), channel, link, mark], axis=-1)
    again = np.stack([copy, tick, channel, link, np.zeros_like(mark)], axis=-1)[copy >= 0]
    rows = np.concatenate([first, again])
    return rows[rows[:, 0] < len(made.kind)]


def apart(one: Integers, other: Integers) -> int:
    """How many rows (m, k) are in one of two lists and not in the other, each as often as it comes."""
    rows, place = np.unique(np.concatenate([one, other]), axis=0, return_inverse=True)
    net = np.zeros(len(rows), dtype=np.int64)
    np.add.at(net, place.ravel(), np.repeat([1, -1], [len(one), len(other)]))
    return int(np.abs(net).sum())


def queued(passing: Mask, drained: Integers, size: int, room: int) -> tuple[Mask, Integers]:
    """What a queue makes of the messages of a link, in whole units: which overflow, and the ticks in which the others are due.

    Parameters
    ----------
    passing
        Which messages come to it, one in each tick, shape (T, L).
    drained
        How many units can pass from each tick to the next, and longer than the messages may wait, shape (T + more,).
    size, room
        Units of a message, and those that may wait.
    """
    able = np.concatenate([[0], np.cumsum(drained)])
    debt = np.zeros(passing.shape[1], dtype=np.int64)
    overflow, due = np.zeros_like(passing), np.zeros(passing.shape, dtype=np.int64)
    for tick, comes in enumerate(passing):
        debt = np.maximum(debt - (drained[tick - 1] if tick else 0), 0)
        overflow[tick] = comes & (debt + size > room)
        debt += np.where(comes & ~overflow[tick], size, 0)
        due[tick] = np.maximum(tick, np.searchsorted(able, able[tick] + debt))
    return overflow, due
