"""Conditions that set off faults: how well the swarm does, for how long."""

from __future__ import annotations

from dataclasses import dataclass

from analysis.models.arrays import Array


@dataclass(frozen=True)
class Trigger:
    """Fires once, in the tick after the tracking error has been beyond a level for some ticks in a row.

    Parameters
    ----------
    level
        Of the tracking error, in square metres.
    above
        Whether the error must be above the level, or below it.
    ticks
        For how many ticks in a row, at least 1.
    """

    level: float
    above: bool
    ticks: int

    def fires(self, errors: Array) -> bool:
        """Whether it fires in the tick that follows these tracking errors, shape (T,), in square metres."""
        last = errors[-self.ticks :]
        return len(last) == self.ticks and bool((last > self.level if self.above else last < self.level).all())
