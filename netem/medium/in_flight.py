"""Messages in flight: what is under way, and how it arrives.

A loss acts on a message when it is offered. What happens to messages under way afterwards is decided here: those whose receiver
dies or departs are dropped, and a cut or partition drops, delivers or holds them, as it says.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Integers, Mask
from netem.impairments.corrupt import Mark, Marks
from netem.medium.verdict import PASSED, Verdict, VerdictCodes

# Rows of `MediumState.under_way`.
_DUE, _SENT, _CELL, _CONTENT, _MARK, _NUMBER = range(6)
_MARK_BITS = 3
# Columns of `Entry.odd` and `Entry.dropped`.
_COPY_DUE, _WHY = 4, 4

# Looking up the members of an enumeration costs as much as an operation on a small array.
_DELIVERED, _DELAYED, _STALE = int(Verdict.DELIVERED), int(Verdict.DELAYED), int(Mark.STALE)

_NO_CELLS = np.empty(0, dtype=np.int64)
_NO_DROPPED = np.empty((0, 5), dtype=np.int64)
_NOTHING_ODD = np.empty((0, 5), dtype=np.int64)
_NO_RELEASED = np.empty((0, 4), dtype=np.int64)
_NOTHING = (np.empty((0, 4), dtype=np.int64), 0, _NO_DROPPED, _NO_RELEASED)


class Verdicts(NamedTuple):
    """What is decided of the messages offered in a tick; every array has shape (C, L).

    Parameters
    ----------
    kind
        DELIVERED, DELAYED, or why it was dropped.
    due
        The tick in whose exchange it arrives; of no meaning where it was dropped.
    mark
        How it is corrupted.
    copy_due
        When its copy arrives, -1 where there is none.
    """

    kind: VerdictCodes
    due: Integers
    mark: Marks
    copy_due: Integers


class MediumState(NamedTuple):
    """What the medium remembers from tick to tick.

    Parameters
    ----------
    under_way
        Messages, a column each: due tick, sent tick, cell, content tick, mark, number; shape (6, m). A cell is a place in
        (C, L), counted through.
    offered
        How many messages each (channel, link) has been offered, shape (C, L): the number of the next.
    spoke
        Where one was offered in the last tick, shape (C, L).
    last_due
        When the last message that passed arrives, shape (C, L).
    memories
        What each profile remembers.
    """

    under_way: Integers
    offered: Integers
    spoke: Mask
    last_due: Integers
    memories: tuple[Any, ...]

    @classmethod
    def empty(cls, shape: tuple[int, int], memories: tuple[Any, ...]) -> MediumState:
        """Nothing in flight, over (channels, links)."""
        return cls(
            under_way=np.empty((6, 0), dtype=np.int64),
            offered=np.zeros(shape, dtype=np.int64),
            spoke=np.zeros(shape, dtype=bool),
            last_due=np.full(shape, -1),
            memories=memories,
        )

    @property
    def in_flight(self) -> int:
        """How many messages are under way."""
        return self.under_way.shape[1]

    def oldest_sent(self, tick: int) -> int:
        """When the oldest message under way was sent, or now."""
        return int(self.under_way[_SENT].min(initial=tick))


class Delivery(NamedTuple):
    """What arrives in one exchange.

    Parameters
    ----------
    newest
        Tick of which the newest content arriving on (channel, link) speaks, -1 for none, shape (C, L).
    mark
        How that message is corrupted, shape (C, L).
    plain
        True where the message offered in this tick arrives as it is, shape (C, L).
    apart
        All other messages that arrive: rows of (content tick, link row, channel row, mark) in that order, shape (m, 4).
    late
        How many of those were under way: from earlier ticks, or copies.
    dropped
        Messages dropped under way: rows of (sent tick, channel row, link row, number, verdict), shape (d, 5).
    released
        Messages that were held and arrive now: rows of (sent tick, channel row, link row, number), shape (r, 4).
    """

    newest: Integers
    mark: Marks
    plain: Mask
    apart: Integers
    late: int
    dropped: Integers
    released: Integers


class Entry(NamedTuple):
    """What is written down of one tick of the medium.

    Parameters
    ----------
    verdicts
        What was decided of each message, shape (C, L).
    odd
        Messages that passed late, twice or corrupted, rows of `out_of_the_ordinary`.
    apart, late, dropped, released
        What became of messages under way, as in `Delivery`.
    injected
        All faults injected so far, in plain form, when one was injected or healed.
    """

    verdicts: VerdictCodes
    odd: Integers
    apart: Integers
    late: int
    dropped: Integers
    released: Integers
    injected: list[Any] | None

    @property
    def copies(self) -> int:
        """How many messages were doubled."""
        return int(np.count_nonzero(self.odd[:, _COPY_DUE] >= 0))

    @property
    def dropped_by_verdict(self) -> Integers:
        """How many messages under way were dropped, by verdict, shape (verdicts,)."""
        return np.bincount(self.dropped[:, _WHY], minlength=len(Verdict))


def deliver(
    state: MediumState, tick: int, verdicts: Verdicts, doom: VerdictCodes, holds: Mask
) -> tuple[MediumState, Delivery]:
    """What arrives in a tick: the messages just passed, and those under way that are due.

    Parameters
    ----------
    state
        After the verdicts of this tick.
    tick, verdicts
        Now, and what was decided.
    doom, holds
        Why messages under way on each link are dropped, or PASSED, and where they wait, shape (L,).
    """
    on_time = verdicts.kind == _DELIVERED
    plain = on_time & (verdicts.mark == 0)
    delayed, copied = np.flatnonzero(verdicts.kind == _DELAYED), np.flatnonzero(verdicts.copy_due >= 0)
    marked = np.flatnonzero(on_time & ~plain)
    if not (state.in_flight or len(delayed) or len(copied) or len(marked)):
        return state, Delivery(np.where(plain, tick, -1), verdicts.mark, plain, *_NOTHING)
    rows = np.concatenate([state.under_way, _setting_out(tick, state, verdicts, delayed, copied)], axis=1)
    dropped, rows = _drop(rows, doom)
    arrives = rows[_DUE] <= tick
    if holds.any():
        arrives &= ~holds[rows[_CELL] % len(holds)]
    arriving, waiting = (rows.take(np.flatnonzero(which), axis=1) for which in (arrives, ~arrives))
    held = arriving[_DUE] < tick
    released = _messages(arriving[:, held], len(doom)) if held.any() else _NO_RELEASED
    late = arriving.shape[1]
    if len(marked):
        corrupted = _setting_out(tick, state, verdicts, marked, _NO_CELLS)
        arriving = np.concatenate([arriving, corrupted], axis=1)
    newest, mark, apart = _sorted_in(np.where(plain, tick, -1), arriving)
    if len(dropped):
        state = state._replace(last_due=_without(state.last_due, dropped))
    return state._replace(under_way=waiting), Delivery(newest, mark, plain, apart, late, dropped, released)


def newest_of(plain: Integers, apart: Integers) -> Integers:
    """The tick of which the newest arriving content speaks, shape (C, L).

    Parameters
    ----------
    plain
        The tick, where this tick's message arrives as it is, else -1, shape (C, L).
    apart
        What else arrives, rows as in `Delivery`.
    """
    newest = plain.copy()
    np.maximum.at(newest, (apart[:, 2], apart[:, 1]), apart[:, 0])
    return newest


def out_of_the_ordinary(tick: int, verdicts: Verdicts) -> Integers:
    """Messages that passed late, twice or corrupted: rows of (channel row, link row, due, mark, copy due), shape (m, 5)."""
    passed = (verdicts.kind == _DELIVERED) | (verdicts.kind == _DELAYED)
    odd = passed & ((verdicts.due != tick) | (verdicts.mark != 0) | (verdicts.copy_due >= 0))
    if not odd.any():
        return _NOTHING_ODD
    channel, link = np.nonzero(odd)
    details = [field[channel, link] for field in (verdicts.due, verdicts.mark, verdicts.copy_due)]
    return np.stack([channel, link, *details], axis=-1).astype(np.int64)


def _setting_out(tick: int, state: MediumState, verdicts: Verdicts, passed: Integers, copied: Integers) -> Integers:
    """Messages that passed, and copies, by their cells, as columns of `MediumState.under_way`."""
    whole = len(passed)
    rows = np.zeros((6, whole + len(copied)), dtype=np.int64)
    rows[_CELL, :whole], rows[_CELL, whole:] = passed, copied
    rows[_DUE, :whole], rows[_DUE, whole:] = verdicts.due.take(passed), verdicts.copy_due.take(copied)
    rows[_MARK, :whole] = verdicts.mark.take(passed)
    rows[_SENT] = tick
    rows[_CONTENT] = tick - (rows[_MARK] == _STALE)
    rows[_NUMBER] = state.offered.take(rows[_CELL]) - 1
    return rows


def _drop(rows: Integers, doom: VerdictCodes) -> tuple[Integers, Integers]:
    """The messages dropped, as rows of `Delivery.dropped`, and the columns of the others."""
    if doom.min() == PASSED:
        return _NO_DROPPED, rows
    why = doom[rows[_CELL] % len(doom)]
    lost = why != PASSED
    return np.column_stack([_messages(rows[:, lost], len(doom)), why[lost]]), rows[:, ~lost]


def _without(last_due: Integers, dropped: Integers) -> Integers:
    """When the last message arrives, where nobody waits for one that was dropped: with it went all others of its link."""
    after = last_due.copy()
    after[dropped[:, 1], dropped[:, 2]] = -1
    return after


def _messages(columns: Integers, links: int) -> Integers:
    """Rows of (sent tick, channel row, link row, number)."""
    channel, link = np.divmod(columns[_CELL], links)
    return np.stack([columns[_SENT], channel, link, columns[_NUMBER]], axis=-1)


def _sorted_in(plain: Integers, arriving: Integers) -> tuple[Integers, Marks, Integers]:
    """What is newest in each cell, how it is corrupted, and all that arrives apart, sorted, as rows of `Delivery.apart`."""
    channels, links = plain.shape
    content, cell, how = arriving[_CONTENT], arriving[_CELL], arriving[_MARK]
    channel, link = np.divmod(cell, links)
    # One number each, in the order of content, link, channel and mark.
    order = np.argsort(((content * links + link) * channels + channel) << _MARK_BITS | how)
    newest = np.where(plain >= 0, plain << _MARK_BITS, -1)
    np.maximum.at(newest.reshape(-1), cell, content << _MARK_BITS | how)
    mark = np.where(newest >= 0, newest & (1 << _MARK_BITS) - 1, 0).astype(np.uint8)
    apart = np.stack([content, link, channel, how], axis=-1)[order]
    return newest >> _MARK_BITS, mark, apart
