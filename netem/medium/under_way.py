"""Kernels over messages under way: how they set out, which wait, arrive or are dropped, and in which order they arrive.

A message is a column; its rows are those of `in_flight.MediumState.under_way`.
"""

from __future__ import annotations

from analysis.kernels.kernel import Part, Plain, kernel
from analysis.models.arrays import Integers, Mask
from netem.impairments.corrupt import Mark, Marks
from netem.medium.verdict import PASSED, Verdict, VerdictCodes

FIELDS = 6
DUE, SENT, CELL, _CONTENT, _MARK, NUMBER = range(FIELDS)
_MARK_BITS = 3
_WAITS, _ARRIVES, _LOST = range(3)
_DELIVERED, _DELAYED, _STALE = int(Verdict.DELIVERED), int(Verdict.DELAYED), int(Mark.STALE)


@Part
def _written(column: Integers, due: int, sent: int, cell: int, mark: int, number: int) -> None:
    column[DUE], column[SENT], column[CELL], column[_MARK], column[NUMBER] = due, sent, cell, mark, number
    column[_CONTENT] = sent - 1 if mark == _STALE else sent


@kernel("(),(c,l),(c,l),(c,l),(c,l),(c,l),(F,n)->(F,n)", "lBlBlll->l")
def set_out(_: int) -> Plain:
    """Messages delayed, then copies, then messages that arrive corrupted, as columns: as many as there is room for."""

    def plain(
        tick: int,
        kind: VerdictCodes,
        due: Integers,
        mark: Marks,
        copy_due: Integers,
        offered: Integers,
        _room: Integers,
        columns: Integers,
    ) -> None:
        links, filled = kind.shape[1], 0
        columns[:] = 0
        for which in range(3):
            for channel in range(kind.shape[0]):
                for link in range(links):
                    now, how = kind[channel, link], mark[channel, link]
                    copy = copy_due[channel, link] >= 0
                    of_these = now == _DELAYED if which == 0 else copy if which == 1 else now == _DELIVERED and how != 0
                    if of_these and filled < columns.shape[1]:
                        arrives = copy_due[channel, link] if which == 1 else due[channel, link]
                        how = 0 if which == 1 else int(how)
                        number = offered[channel, link] - 1
                        _written(columns[:, filled], arrives, tick, channel * links + link, how, number)
                        filled += 1

    return plain


@Part
def _fate(tick: int, due: int, doomed: int, held: bool) -> int:
    if doomed != PASSED:
        return _LOST
    return _WAITS if held or due > tick else _ARRIVES


@kernel("(),(F,m),(l),(l)->(F,m),(m),(),(),()", "llB?->lllll")
def parted(_: int) -> Plain:
    """Messages under way: those that wait, those that arrive, and those that are dropped; of the first two, how many.

    And how many of those that arrive were held until now.
    """

    def plain(
        tick: int,
        columns: Integers,
        doom: VerdictCodes,
        holds: Mask,
        sorted_out: Integers,
        fates: Integers,
        waiting: Integers,
        arriving: Integers,
        held: Integers,
    ) -> None:
        filled, waiting[0], arriving[0], held[0] = 0, 0, 0, 0
        for column in range(len(fates)):
            due, link = columns[DUE, column], columns[CELL, column] % len(doom)
            fates[column] = _fate(tick, due, doom[link], holds[link])
            waiting[0] += int(fates[column] == _WAITS)
            arriving[0] += int(fates[column] == _ARRIVES)
            held[0] += int(fates[column] == _ARRIVES and due < tick)
        for which in (_WAITS, _ARRIVES, _LOST):
            for column in range(len(fates)):
                if fates[column] == which:
                    for field in range(len(columns)):
                        sorted_out[field, filled] = columns[field, column]
                    filled += 1

    return plain


@kernel("(c,l),(f,m)->(c,l),(c,l),(m)", "ll->lBl")
def newest_in() -> Plain:
    """What is newest in each cell, how it is corrupted, and one number for each that arrives, in the order of `apart`."""

    def plain(plain: Integers, arriving: Integers, newest: Integers, mark: Marks, order: Integers) -> None:
        channels, links = plain.shape
        for channel in range(channels):
            for link in range(links):
                newest[channel, link], mark[channel, link] = plain[channel, link], 0
        for n in range(arriving.shape[1]):
            content, how = arriving[_CONTENT, n], arriving[_MARK, n]
            channel, link = arriving[CELL, n] // links, arriving[CELL, n] % links
            order[n] = ((content * links + link) * channels + channel) << _MARK_BITS | how
            newer = content > newest[channel, link]
            if newer or (content == newest[channel, link] and how > mark[channel, link]):
                newest[channel, link], mark[channel, link] = content, how

    return plain


@kernel("(m),(),(),(A)->(m,A)", "llll->l")
def in_order(_: int) -> Plain:
    """Rows of `Delivery.apart`, from their numbers in order."""

    def plain(order: Integers, channels: int, links: int, _room: Integers, rows: Integers) -> None:
        for n in range(len(order)):
            cell = order[n] >> _MARK_BITS
            rows[n, 0], rows[n, 1] = cell // channels // links, cell // channels % links
            rows[n, 2], rows[n, 3] = cell % channels, order[n] & ((1 << _MARK_BITS) - 1)

    return plain
