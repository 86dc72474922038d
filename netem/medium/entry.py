"""What is written down of a tick of the medium: verdicts, and whatever became of a message out of the ordinary."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Integers, Mask
from netem.impairments.corrupt import Marks
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict, VerdictCodes, passed

# Columns of `Entry.odd` and `Entry.dropped`.
_COPY_DUE, _WHY = 4, 4

_DELIVERED = int(Verdict.DELIVERED)
_NOTHING_ODD = np.empty((0, 5), dtype=np.int64)


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


def by_part(entry: Entry, parts: int, links: int) -> tuple[Integers, Integers, Integers]:
    """How many messages were doubled, arrived late, and were dropped under way, of parts of so many links each.

    Parameters
    ----------
    entry
        Of all parts.
    parts, links
        How many there are, one after the other, and how many links each has.

    Returns
    -------
    tuple
        Shapes (parts,), (parts,) and (parts, verdicts).
    """
    channel, link, _, mark, copy_due = entry.odd.T
    on_time = entry.odd[(mark != 0) & (entry.verdicts[channel, link] == _DELIVERED), 1]

    def counted(of_links: Integers) -> Integers:
        return np.bincount(of_links // links, minlength=parts)

    reasons = len(Verdict)
    cells = entry.dropped[:, 2] // links * reasons + entry.dropped[:, _WHY]
    dropped = np.bincount(cells, minlength=parts * reasons).reshape(parts, reasons)
    return counted(link[copy_due >= 0]), counted(entry.apart[:, 1]) - counted(on_time), dropped


def out_of_the_ordinary(tick: int, verdicts: Verdicts) -> Integers:
    """Messages that passed late, twice or corrupted: rows of (channel row, link row, due, mark, copy due), shape (m, 5)."""
    odd, number = _odd(tick, *verdicts)
    if not number:
        return _NOTHING_ODD
    channel, link = np.nonzero(odd)
    details = [field[channel, link] for field in (verdicts.due, verdicts.mark, verdicts.copy_due)]
    return np.stack([channel, link, *details], axis=-1).astype(np.int64)


@kernel("(),(c,l),(c,l),(c,l),(c,l)->(c,l),()", "lBlBl->?l")
def _odd() -> Plain:
    """Where a message passed late, twice or corrupted, and how often."""

    def plain(
        tick: int,
        kind: VerdictCodes,
        due: Integers,
        mark: Marks,
        copy_due: Integers,
        odd: Mask,
        number: Integers,
    ) -> None:
        number[0] = 0
        for channel in range(kind.shape[0]):
            for link in range(kind.shape[1]):
                late, twice = due[channel, link] != tick, copy_due[channel, link] >= 0
                strange = late or twice or mark[channel, link] != 0
                odd[channel, link] = strange and passed(kind[channel, link])
                number[0] += int(odd[channel, link])

    return plain
