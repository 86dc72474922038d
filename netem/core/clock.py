"""What time it is: the ticks of a run, one after the other. Nobody else counts them, or asks a wall clock."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol


class Clock(Protocol):
    """Says when the next tick begins."""

    def __iter__(self) -> Iterator[int]:
        """The ticks, each when its time has come."""


@dataclass(frozen=True)
class Lockstep:
    """Time goes on when everybody has answered, however long that takes.

    Parameters
    ----------
    ticks
        How many there are.
    """

    ticks: int

    def __iter__(self) -> Iterator[int]:
        return iter(range(self.ticks))
