"""Consecutive ticks, held back until the span of ticks in which they are is whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from world.books.history import Moments


class Spans:
    """Puts ticks together to whole spans; the first of a run begins with it.

    Parameters
    ----------
    ticks
        Of a span.
    """

    def __init__(self, ticks: int) -> None:
        self._ticks = ticks
        self._held: list[Moments] = []

    def whole(self, moments: Moments) -> Moments | None:
        """The spans that are whole with these next ticks; None if none is."""
        self._held.append(moments)
        known = sum(len(one.error) for one in self._held)
        ready = known - known % self._ticks
        if not ready:
            return None
        spans = joined(self._held)
        self._held = [] if ready == known else [_part(spans, slice(ready, None))]
        return spans if ready == known else _part(spans, slice(0, ready))

    def rest(self) -> Moments | None:
        """The ticks that are left once no more come; None if none are."""
        held, self._held = self._held, []
        return joined(held) if held else None


def joined(moments: Sequence[Moments]) -> Moments:
    """Ticks that follow each other."""
    if len(moments) == 1:
        return moments[0]
    reports = {name: np.concatenate([one.reports[name] for one in moments]) for name in moments[0].reports}
    arrays = {name: np.concatenate([getattr(one, name) for one in moments]) for name in _ARRAYS}
    return Moments(first=moments[0].first, reports=reports, **arrays)


def _part(moments: Moments, which: slice) -> Moments:
    reports = {name: array[which] for name, array in moments.reports.items()}
    arrays: dict[str, Any] = {name: getattr(moments, name)[which] for name in _ARRAYS}
    return Moments(first=moments.first + which.start, reports=reports, **arrays)


_ARRAYS = [field.name for field in fields(Moments) if field.name not in ("first", "reports")]
