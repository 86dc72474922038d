"""When an agent acts by its own clock, in a run in real time.

An agent wakes at moments of its own: it senses and speaks, listens for a while, and acts on what has arrived by then. All of
this is counted in simulated seconds of its own clock, which may run fast or slow.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import floor
from typing import NamedTuple

import numpy as np

from netem.core.draws import Purpose, uniform

_AHEAD = 256


@dataclass(frozen=True)
class Timer:
    """The moments at which an agent wakes.

    Parameters
    ----------
    period
        From one to the next, in seconds of its own clock.
    phase
        Of the first, in seconds after the start of the run.
    jitter
        By which each may come too early or too late, in seconds: uniform, drawn for each.
    drift
        By which its clock gains, in seconds per second.
    listens
        How long it listens after it has spoken, in seconds.
    factor
        Simulated seconds in a second.
    seed, agent
        What the jitter is drawn by.
    """

    period: float
    phase: float
    jitter: float
    drift: float
    listens: float
    factor: float
    seed: int
    agent: int

    def moment(self, number: int) -> float:
        """When it wakes for the n-th time, from 0, in seconds of its own clock."""
        return self.phase + number * self.period + self.jitter * self._swing(number)

    def after(self, own_s: float, number: int) -> int:
        """The first time it wakes later than this, in seconds of its own clock, and no earlier than time `number`."""
        following = max(number, floor((own_s - self.phase - self.jitter) / self.period))
        while self.moment(following) <= own_s:
            following += 1
        return following

    def _swing(self, number: int) -> float:
        if not self.jitter:
            return 0.0
        block, place = divmod(number, _AHEAD)
        return _swings(self.seed, self.agent, block)[place]


class OwnClock(NamedTuple):
    """What a clock says by the seconds of the run.

    Parameters
    ----------
    true_s, own_s
        A moment of the run, and what the clock said then, in seconds.
    speed
        How fast it runs, in seconds per second.
    """

    true_s: float
    own_s: float
    speed: float

    @classmethod
    def right(cls, drift: float) -> OwnClock:
        """A clock that was right when the run began, and gains so many seconds per second."""
        return cls(0.0, 0.0, 1.0 + drift)

    def says(self, true_s: float) -> float:
        """What it says at a moment of the run, in seconds."""
        return self.own_s + (true_s - self.true_s) * self.speed

    def when(self, own_s: float) -> float:
        """The moment of the run at which it says this, in seconds."""
        return self.true_s + (own_s - self.own_s) / self.speed

    def running(self, true_s: float, speed: float) -> OwnClock:
        """The clock, running at another speed from a moment of the run on."""
        return OwnClock(true_s, self.says(true_s), speed)


@lru_cache(maxsize=4)
def _swings(seed: int, agent: int, block: int) -> list[float]:
    numbers = np.arange(block * _AHEAD, (block + 1) * _AHEAD)
    swings: list[float] = (2.0 * uniform(seed, Purpose.TIMER, tick=numbers, src=agent)[..., 0] - 1.0).tolist()
    return swings
