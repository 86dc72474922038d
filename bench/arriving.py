"""What arrives, message by message, where it is known what became of each: to be held against what did arrive."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Integers
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
    rows = np.concatenate([one, other])
    rows = rows - rows.min(axis=0)
    numbers, place = np.unique(np.ravel_multi_index(tuple(rows.T), tuple(rows.max(axis=0) + 1)), return_inverse=True)
    net = np.bincount(place, np.repeat([1.0, -1.0], [len(one), len(other)]), len(numbers))
    return int(np.abs(net).sum())
