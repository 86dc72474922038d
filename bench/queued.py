"""A queue computed again by another hand, in whole units and with no seconds in it, against the verdicts of the medium."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from against import Against, Row

from analysis.models.arrays import Integers, Mask
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict


def rows(against: Against, made: Verdicts, drained: Integers, sizes: Sequence[int], room: int) -> Iterator[Row]:
    """Verdicts of ticks (T, C, L) on messages that are lost or come to the queue, as `queued` has them."""
    lost = made.kind == Verdict.LOST
    overflow, due = queued(~lost, drained, sizes, room)
    kind = np.where(lost, Verdict.LOST, np.where(overflow, Verdict.OVERFLOW, Verdict.DELAYED))
    yield against.exactly("verdicts other than computed again", 0.0, float((made.kind != kind).sum()))
    waited = kind == Verdict.DELAYED
    yield against.exactly("due in other ticks", 0.0, float((made.due != due)[waited].sum()))
    yield against.exactly("of so many that waited", float(waited.sum()), float((made.due == due)[waited].sum()))


def queued(passing: Mask, drained: Integers, sizes: Sequence[int], room: int) -> tuple[Mask, Integers]:
    """What a queue makes of the messages of a link: which overflow, and the ticks in which the others are due.

    Parameters
    ----------
    passing
        Which messages come to it, on each channel one in each tick, shape (T, C, L).
    drained
        How many units can pass from each tick to the next, and longer than the messages may wait, shape (T + more,).
    sizes, room
        Units of a message on each channel, and those that may wait.
    """
    able = np.concatenate([[0], np.cumsum(drained)])
    debt = np.zeros(passing.shape[-1], dtype=np.int64)
    overflow, due = np.zeros_like(passing), np.zeros(passing.shape, dtype=np.int64)
    for tick, come in enumerate(passing):
        debt = np.maximum(debt - (drained[tick - 1] if tick else 0), 0)
        for channel, (comes, size) in enumerate(zip(come, sizes, strict=True)):
            overflow[tick, channel] = comes & (debt + size > room)
            debt += np.where(comes & ~overflow[tick, channel], size, 0)
            due[tick, channel] = np.maximum(tick, np.searchsorted(able, able[tick] + debt))
    return overflow, due
