"""How the time of a run goes that flies in real time."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Pace:
    """How simulated time goes with time.

    Parameters
    ----------
    dt
        Tick, in simulated seconds.
    factor
        Simulated seconds in a second.
    late
        By how many seconds a process may be late; beyond, the run fails.
    """

    dt: float
    factor: float
    late: float

    @property
    def grace(self) -> int:
        """For how many ticks more may be said in a tick that is over: as long as somebody may be late."""
        return 1 + int(self.late * self.factor / self.dt)
