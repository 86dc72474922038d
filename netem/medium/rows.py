"""The rows of a journal: what became of every message of a batch of ticks, at once.

A message has a row with its verdict when it is offered, a row `copied` if it is doubled, and a row more if it is dropped or
released under way.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Integers
from netem.medium.entry import Entry
from netem.medium.verdict import Verdict, VerdictCodes

VERDICTS = ("delivered", "delayed", "dropped", "copied", "released")
_DELIVERED, _DELAYED, _DROPPED, _COPIED, _RELEASED = range(len(VERDICTS))
_SILENT, _PASSED_NOW, _PASSED_LATER = (int(kind) for kind in (Verdict.SILENT, Verdict.DELIVERED, Verdict.DELAYED))


class Rows(NamedTuple):
    """Rows of a journal, shape (m,) each.

    Parameters
    ----------
    tick
        Of which they speak.
    channel, link, seq
        Which message: its channel and link, and its number on them.
    verdict
        Its place in `VERDICTS`.
    kind
        The `Verdict`: why it was dropped, if it was.
    deliver_tick
        When it arrives, -1 for never.
    mark
        How it is corrupted.
    """

    tick: Integers
    channel: Integers
    link: Integers
    seq: Integers
    verdict: Integers
    kind: Integers
    deliver_tick: Integers
    mark: Integers


def rows_of(first: int, verdicts: VerdictCodes, entries: Sequence[Entry], offered: Integers) -> tuple[Rows, Integers]:
    """The rows of consecutive ticks, in their order; and how many messages there were of each channel and link after them.

    Parameters
    ----------
    first
        The first tick.
    verdicts
        The verdicts of the entries, shape (T, C, L).
    entries
        What is written down of each tick.
    offered
        How many messages were offered before, shape (C, L).
    """
    spoke = verdicts != _SILENT
    after = offered + np.cumsum(spoke, axis=0)
    number = after - spoke
    odd, dropped, released = (
        _listed(first, [getattr(entry, name) for entry in entries]) for name in ("odd", "dropped", "released")
    )
    parts = [_offered(first, verdicts, number, odd)]
    if len(odd):
        parts.append(_copies(first, number, odd))
    if len(dropped):
        tick, _, channel, link, seq, why = dropped.T
        parts.append(_under_way(tick, channel, link, seq, _DROPPED, why, np.full_like(tick, -1)))
    if len(released):
        tick, _, channel, link, seq = released.T
        parts.append(_under_way(tick, channel, link, seq, _RELEASED, np.full_like(tick, _PASSED_LATER), tick))
    if len(parts) == 1:
        return parts[0], after[-1]
    rows = Rows(*map(np.concatenate, zip(*parts, strict=True)))
    in_order = np.argsort(rows.tick, kind="stable")
    return Rows(*(column[in_order] for column in rows)), after[-1]


def _listed(first: int, lists: Sequence[Integers]) -> Integers:
    """What entries list, with the tick of each in the first column."""
    tick = np.repeat(np.arange(first, first + len(lists)), [len(rows) for rows in lists])
    return np.column_stack([tick, np.concatenate(lists)])


def _offered(first: int, verdicts: VerdictCodes, number: Integers, odd: Integers) -> Rows:
    """Messages offered: all that passed arrive in their tick and as they are, but for those that are odd."""
    place = np.flatnonzero(verdicts)
    row, channel, link = np.unravel_index(place, verdicts.shape)
    tick, kind = first + row, verdicts.ravel()[place].astype(np.int64)
    passed = kind <= _PASSED_LATER
    verdict = np.where(passed, kind - _PASSED_NOW + _DELIVERED, _DROPPED)
    due, mark = np.where(passed, tick, -1), np.zeros_like(tick)
    if len(odd):
        when, of_channel, on_link, odd_due, odd_mark, _ = odd.T
        at = np.searchsorted(place, np.ravel_multi_index((when - first, of_channel, on_link), verdicts.shape))
        due[at], mark[at] = odd_due, odd_mark
    return Rows(tick, channel, link, number.ravel()[place], verdict, kind, due, mark)


def _copies(first: int, number: Integers, odd: Integers) -> Rows:
    tick, channel, link, _, _, due = odd[odd[:, -1] >= 0].T
    seq = number[tick - first, channel, link]
    return _under_way(tick, channel, link, seq, _COPIED, np.full_like(tick, _PASSED_LATER), due)


def _under_way(
    tick: Integers, channel: Integers, link: Integers, seq: Integers, verdict: int, kind: Integers, due: Integers
) -> Rows:
    return Rows(tick, channel, link, seq, np.full_like(tick, verdict), kind, due, np.zeros_like(tick))
