"""How far apart the monotonic clocks of two machines are, by asking for the time over there."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

_ROUNDS = 16


@dataclass(frozen=True)
class ClockOffset:
    """How much the clock of another machine shows more than that of this one, in seconds, give or take `uncertainty_s`.

    What it says holds for the moment it was measured: clocks run at rates of their own, some 10 us a second apart.
    """

    offset_s: float
    uncertainty_s: float

    def then(self, further: ClockOffset) -> ClockOffset:
        """The offset to a third machine, given that of the third to the second."""
        return ClockOffset(self.offset_s + further.offset_s, self.uncertainty_s + further.uncertainty_s)

    @property
    def back(self) -> ClockOffset:
        """The offset of this machine, as the other one sees it."""
        return ClockOffset(-self.offset_s, self.uncertainty_s)


SAME = ClockOffset(0.0, 0.0)  # of processes on one machine


def measured(
    ask: Callable[[], float], clock: Callable[[], float] = time.monotonic, rounds: int = _ROUNDS
) -> ClockOffset:
    """The offset of the clock that answers, by the quickest of some round trips.

    The answer was given at some moment of its round trip, and nothing says at which: the middle is off by half of it at most,
    however unlike the two ways are.

    Parameters
    ----------
    ask
        Asks for the time over there, in seconds, and waits for the answer.
    clock
        The time here.
    rounds
        How often to ask.
    """
    best: ClockOffset | None = None
    for _ in range(rounds):
        sent_s = clock()
        there_s = ask()
        trip_s = clock() - sent_s
        if best is None or trip_s / 2 < best.uncertainty_s:
            best = ClockOffset(there_s - sent_s - trip_s / 2, trip_s / 2)
    assert best is not None, "ask at least once"
    return best
