"""How a process of a run in real time kept its time."""

from __future__ import annotations

from typing import NamedTuple


class Kept(NamedTuple):
    """How a process kept its time in a tick.

    Parameters
    ----------
    tick, process
        When, and which.
    late
        By how many seconds it was late, at the worst.
    missed
        How many deadlines it missed.
    """

    tick: int
    process: str
    late: float
    missed: int
