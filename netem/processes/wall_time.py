"""How a run in real time goes with the clock on the wall: its seconds, by the monotonic clock, which nobody sets."""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

# Long enough to reach everybody before the first tick.
_LEAD_S = 0.25


@dataclass(frozen=True)
class WallTime:
    """The simulated seconds of a run by the clock of this machine.

    Parameters
    ----------
    began
        When the run began, in seconds of the monotonic clock.
    factor
        Simulated seconds in a second.
    """

    began: float
    factor: float

    @classmethod
    def soon(cls, factor: float) -> WallTime:
        """The time of a run that is about to begin."""
        return cls(time.monotonic() + _LEAD_S, factor)

    def now(self) -> float:
        """Simulated seconds since the run began, negative before."""
        return (time.monotonic() - self.began) * self.factor

    def until(self, simulated_s: float) -> float:
        """How long it takes to this moment of the run, in seconds, 0 when it is over."""
        return max(0.0, simulated_s / self.factor - (time.monotonic() - self.began))

    def wait_until(self, simulated_s: float) -> None:
        """Sleep to this moment of the run."""
        while (left := self.until(simulated_s)) > 0.0:
            time.sleep(left)


@dataclass(frozen=True)
class RealTime:
    """A clock whose ticks begin when their time has come, whoever has answered by then.

    Parameters
    ----------
    ticks, dt
        How many there are, and how long each is, in simulated seconds.
    wall
        How the run goes with the clock on the wall.
    """

    ticks: int
    dt: float
    wall: WallTime

    def __iter__(self) -> Iterator[int]:
        for tick in range(self.ticks):
            self.wall.wait_until(tick * self.dt)
            yield tick


def interrupting() -> None:
    """Have this process, and all threads that it starts from now on, interrupt others as soon as their time has come."""
    if sys.platform == "linux" and os.sched_getscheduler(0) == os.SCHED_BATCH:  # as the nursery has it
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def freeze_garbage() -> None:
    """Collect no garbage that is not of the run itself."""
    gc.collect()
    gc.freeze()
