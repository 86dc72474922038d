"""A tick of a run in real time of which not all is known yet: what was decided of it, and what has come of that so far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.models.arrays import Integers
from netem.medium.entry import Entry, out_of_the_ordinary
from netem.medium.in_flight import Verdicts, Waits
from netem.medium.verdict import Verdict

_SILENT, _UNSAID = np.uint8(Verdict.SILENT), np.uint8(Verdict.UNSAID)
Voice = tuple[int, int]  # an agent, and the row of a channel


class OpenTick:
    """A tick in which something may still be said, or arrive.

    Attributes
    ----------
    tick
        Its number.
    decided, marks, doubled, wait_s, copy_wait_s, ordered
        What is decided of what is said in it, by channel and link: the verdict, how it is corrupted, whether it is doubled, how
        long it and its copy wait in seconds, and whether it waits for those sent before it.
    kind, due, mark, copy_due
        What has come of that so far, shape (C, L): the verdict on what was said, the ticks in which it and its copy arrive, and
        how it is corrupted.
    unsaid
        What agents are still to say.
    apart, dropped, released, late
        What else arrives or is dropped in it, as in `Entry`; messages are known by the tick in which they were sent.
    injected
        All faults injected so far, in plain form, when one was injected or healed.
    """

    def __init__(self, tick: int, verdicts: Verdicts, waits: Waits) -> None:
        shape = verdicts.kind.shape
        self.tick = tick
        self.decided, self.marks = verdicts.kind.tolist(), verdicts.mark.tolist()
        self.doubled = (verdicts.copy_due >= 0).tolist()
        self.wait_s, self.copy_wait_s, self.ordered = (np.broadcast_to(of, shape).tolist() for of in waits)
        self.kind = np.where(verdicts.kind == _SILENT, _SILENT, _UNSAID)
        self.kind[0] = verdicts.kind[0]
        self.due, self.copy_due = np.full(shape, tick), np.full(shape, -1)
        self.mark = np.zeros(shape, dtype=np.uint8)
        self.unsaid: set[Voice] = set()
        self.apart: list[tuple[int, int, int, int]] = []
        self.dropped: list[tuple[OpenTick, int, int, int]] = []
        self.released: list[tuple[OpenTick, int, int]] = []
        self.late = 0
        self.injected: list[Any] | None = None
        self.is_closed = False
        self._number = np.zeros(shape, dtype=np.int64)

    def close(self, offered: Integers) -> Entry:
        """What is written down of it, where so many messages were offered before, shape (C, L)."""
        self.is_closed, self._number = True, offered
        return Entry(
            verdicts=self.kind,
            odd=out_of_the_ordinary(self.tick, Verdicts(self.kind, self.due, self.mark, self.copy_due)),
            apart=_rows(sorted(self.apart), 4),
            late=self.late,
            dropped=_rows([(o.tick, c, link, o._number[c, link], why) for o, c, link, why in self.dropped], 5),
            released=_rows([(o.tick, c, link, o._number[c, link]) for o, c, link in self.released], 4),
            injected=self.injected,
        )


def _rows(listed: Sequence[tuple[int, ...]], columns: int) -> Integers:
    return np.array(listed, dtype=np.int64).reshape(-1, columns)
