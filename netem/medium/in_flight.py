"""Messages in flight: what is under way, and how it arrives.

A loss acts on a message when it is offered. What happens to messages under way afterwards is decided here: those whose receiver
dies or departs are dropped, and a cut or partition drops, delivers or holds them, as it says. The kernels that sort messages
under way are in `under_way.py`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from netem.impairments.corrupt import Marks
from netem.medium.under_way import CELL, DUE, FIELDS, NUMBER, SENT, in_order, newest_in, parted, set_out
from netem.medium.verdict import Verdict, VerdictCodes

# Looking up the members of an enumeration costs as much as an operation on a small array.
_DELIVERED, _DELAYED = int(Verdict.DELIVERED), int(Verdict.DELAYED)

_NO_DROPPED = np.empty((0, 5), dtype=np.int64)
_NO_RELEASED = np.empty((0, 4), dtype=np.int64)
_A_ROW = np.empty(4, dtype=np.int64)
_NOTHING = (np.empty((0, 4), dtype=np.int64), 0, _NO_DROPPED, _NO_RELEASED)


class Waits(NamedTuple):
    """How long messages that are no measurements wait in the air, where that is not counted in ticks.

    Parameters
    ----------
    seconds, copy_seconds
        Of a message, and of its copy, shape (C, L) or (1, L).
    ordered
        Which of them wait for those sent before them, shape (C, L).
    """

    seconds: Array
    copy_seconds: Array
    ordered: Mask


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
    waits
        How long what was offered in the last tick waits; None where its verdicts were recorded.
    """

    under_way: Integers
    offered: Integers
    spoke: Mask
    last_due: Integers
    memories: tuple[Any, ...]
    waits: Waits | None = None

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

    def over_links(self) -> Integers:
        """How many messages are under way on each link, shape (L,)."""
        links = self.offered.shape[1]
        return np.bincount(self.under_way[CELL] % links, minlength=links)

    def oldest_sent(self, tick: int) -> int:
        """When the oldest message under way was sent, or now."""
        return int(self.under_way[SENT].min()) if self.in_flight else tick


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
    plain, newest, late, marked = _plainly(tick, verdicts.kind, verdicts.mark, verdicts.copy_due)
    if not (late or marked or state.in_flight):
        return state, Delivery(newest, verdicts.mark, plain, *_NOTHING)
    apart = set_out(tick, *verdicts, state.offered, np.empty((FIELDS, late + marked), dtype=np.int64))
    under_way = np.concatenate([state.under_way, apart[:, :late]], axis=1)
    columns, _, waiting, arriving, held = parted(tick, under_way, doom, holds)
    arrived, lost = columns[:, waiting : waiting + arriving], columns[:, waiting + arriving :]
    dropped, released = _NO_DROPPED, _NO_RELEASED
    if lost.size:
        dropped = np.column_stack([_messages(lost, len(doom)), doom[lost[CELL] % len(doom)]])
        state = state._replace(last_due=_without(state.last_due, dropped))
    if held:
        released = _messages(arrived[:, arrived[DUE] < tick], len(doom))
    if marked:
        arrived = np.concatenate([arrived, apart[:, late:]], axis=1)
    newest, mark, order = newest_in(newest, arrived)
    rows = in_order(np.sort(order), *newest.shape, _A_ROW)
    return state._replace(under_way=columns[:, :waiting]), Delivery(
        newest, mark, plain, rows, int(arriving), dropped, released
    )


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


def _without(last_due: Integers, dropped: Integers) -> Integers:
    """When the last message arrives, where nobody waits for one that was dropped: with it went all others of its link."""
    after = last_due.copy()
    after[dropped[:, 1], dropped[:, 2]] = -1
    return after


def _messages(columns: Integers, links: int) -> Integers:
    """Rows of (sent tick, channel row, link row, number)."""
    channel, link = np.divmod(columns[CELL], links)
    return np.stack([columns[SENT], channel, link, columns[NUMBER]], axis=-1)


@kernel("(),(c,l),(c,l),(c,l)->(c,l),(c,l),(),()", "lBBl->?lll")
def _plainly() -> Plain:
    """What arrives as it is; how many messages and copies set out for later, and how many arrive corrupted."""

    def plain(
        tick: int,
        kind: VerdictCodes,
        mark: Marks,
        copy_due: Integers,
        plain: Mask,
        newest: Integers,
        late: Integers,
        marked: Integers,
    ) -> None:
        late[0], marked[0] = 0, 0
        for channel in range(kind.shape[0]):
            for link in range(kind.shape[1]):
                on_time = kind[channel, link] == _DELIVERED
                as_it_is = on_time and mark[channel, link] == 0
                plain[channel, link] = as_it_is
                newest[channel, link] = tick if as_it_is else -1
                late[0] += int(kind[channel, link] == _DELAYED) + int(copy_due[channel, link] >= 0)
                marked[0] += int(on_time and not as_it_is)

    return plain
