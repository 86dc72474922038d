"""What a run leaves to judge it by: its plan, its faults where they came to lie, and its arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from affinet.planning.plan import Plan
from affinet.scenario.words import one_line
from affinet.verdicts.bites import Bite
from affinet.verdicts.outcome import Outcome
from analysis.models.arrays import Array, Mask
from netem.faults.timeline import Timeline
from world.books.history import Arrays

Kind = TypeVar("Kind", bound=np.generic)
_DIGITS = 12  # of a digest, where it is there to tell runs apart


@dataclass(frozen=True, eq=False, repr=False)
class Evidence:
    """A run, for checkers and tests.

    Parameters
    ----------
    plan
        What was flown.
    arrays
        What happened; every array begins with the ticks (docs/testing.md).
    outcome
        The run's own verdict.
    """

    plan: Plan
    arrays: Arrays
    outcome: Outcome

    def __post_init__(self) -> None:
        for values in self.arrays.values():
            _kept(values)

    def __repr__(self) -> str:
        source, digest = self.plan.scenario.source, self.outcome.digest or ""
        flown = f"{one_line(source.file)}, {self.outcome.verdict}, {digest[:_DIGITS]}, {self.ticks} ticks"
        return f"<{type(self).__name__}: {flown}>"

    @property
    def timeline(self) -> Timeline:
        """Its faults, where they came to lie."""
        return self.outcome.timeline

    @property
    def ticks(self) -> int:
        """How many were flown."""
        return len(self.arrays["error"])

    @property
    def dt(self) -> float:
        """Tick, in seconds."""
        return self.plan.world.dt

    @property
    def seconds(self) -> Array:
        """The time of each tick, shape (T,)."""
        times: Array = np.arange(self.ticks, dtype=np.float64) * self.dt
        return times

    @property
    def error(self) -> Array:
        """Tracking error (15), shape (T,), in square metres."""
        return self.arrays["error"]

    @property
    def position(self) -> Array:
        """Of the agents in each tick, shape (T, N, D), in metres."""
        return self.arrays["position"][: self.ticks]

    @property
    def bites(self) -> tuple[Bite, ...]:
        """What each fault took hold of."""
        return self.outcome.faults

    @cached_property
    def present(self) -> Mask:
        """Agents that take part, shape (T, N)."""
        return _kept(self.timeline.present(range(self.ticks)))

    @cached_property
    def embodied(self) -> Mask:
        """Agents that have a body in the air, shape (T, N)."""
        return _kept(self.timeline.each(range(self.ticks), lambda now: ~now.vanished))

    @cached_property
    def awake(self) -> Mask:
        """Agents whose processes live and run, shape (T, N)."""
        return _kept(self.timeline.each(range(self.ticks), lambda now: ~now.idle))

    @cached_property
    def located(self) -> Mask:
        """Ticks in which it is known where all agents were, shape (T,): all but in runs that were not simulated."""
        if not self.plan.may_have_gaps:
            return _kept(np.ones(self.ticks, dtype=bool))
        return _kept(np.asarray(~np.isnan(self.position).any(axis=(-2, -1))))

    def tick(self, seconds: float) -> int:
        """The tick of a time."""
        return round(seconds / self.dt)


def _kept(values: NDArray[Kind]) -> NDArray[Kind]:
    values.flags.writeable = False  # nobody who looks at a run changes what the next one sees
    return values
