"""Where a run left the numbers: in which tick, and of which agent."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from analysis.models.arrays import Mask
from world.books.history import Arrays, by_span


class Place(NamedTuple):
    """A tick, and an agent, by its number."""

    tick: int
    agent: int


def diverged(plan: Plan, arrays: Arrays) -> str | None:
    """Of which agent a position is first no number, and what its estimator said before, in words; None of none."""
    found = _first(arrays, lambda span: np.asarray(~np.isfinite(span["position"][: len(span["error"])]).all(axis=-1)))
    if found is None:
        found = _last(arrays)
    if found is None:
        return None
    says = f"the swarm diverged: the position of agent {found.agent} is not a number any more {_when(plan, found.tick)}"
    believed = _estimate(arrays)
    if believed is not None and believed.tick <= found.tick:
        return f"{says}, after {_said(plan, believed)}"
    return says


def unknown(plan: Plan, arrays: Arrays) -> str | None:
    """Of which agent an estimate is first no number, in words; None of none."""
    believed = _estimate(arrays)
    return None if believed is None else f"{_said(plan, believed)} is not a number any more"


def _said(plan: Plan, place: Place) -> str:
    return f"an estimate of agent {place.agent} {_when(plan, place.tick)}"


def _when(plan: Plan, tick: int) -> str:
    return f"in tick {tick} ({tick * plan.world.dt:g} s)"


def _estimate(arrays: Arrays) -> Place | None:
    def wrong(span: Arrays) -> Mask:
        return np.asarray((~np.isfinite(span["estimate"]).all(axis=-1) & span["known"]).any(axis=-1))

    return _first(arrays, wrong)


def _last(arrays: Arrays) -> Place | None:
    """Where the last tick led to."""
    ticks = len(arrays["error"])
    (rows,) = np.nonzero(~np.isfinite(arrays["position"][-1]).all(axis=-1))
    return Place(ticks, int(rows[0]) + 1) if len(rows) else None


def _first(arrays: Arrays, wrong: Callable[[Arrays], Mask]) -> Place | None:
    first = 0
    for span in by_span(arrays):
        ticks, rows = np.nonzero(wrong(span))
        if len(ticks):
            return Place(first + int(ticks[0]), int(rows[0]) + 1)
        first += len(span["error"])
    return None
