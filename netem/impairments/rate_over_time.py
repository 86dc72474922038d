"""Limited rate that changes over time: what waits in a queue passes when so many bits have been able to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from netem.impairments.rate import Admission, Rate

_NEVER = 1e300  # s
# What passes up to when a rate falls has passed, however times are rounded: so much of a message is nothing.
_SLACK = 1e-9


@dataclass(frozen=True)
class RateOverTime:
    """The rate of every link over time; without a limit, rate and queue are infinite.

    Parameters
    ----------
    dt
        Tick, in seconds.
    ticks
        When a rate changes, increasing from 0, shape (M,); the last holds.
    rate
        From then on, in bits per second, shape (M, L).
    burst, queue
        Bits that may pass at once after an idle time, and that may wait, shape (L,).
    """

    dt: float
    ticks: Integers
    rate: Array
    burst: Array
    queue: Array

    def begin(self) -> Array:
        """Full buckets, empty queues: debt in bits, shape (L,); negative while tokens are left."""
        return -self.burst

    def at(self, tick: int) -> Rate:
        """The limits in a tick: the rate is that since the tick before, by which debts have shrunk."""
        return _InATick(self._held(tick - 1), self.burst, self.queue, self, tick)

    def seconds(self, tick: int, bits: Array) -> Array:
        """How long it takes from a tick on until so many bits (C, L) have been able to pass, shape (C, L)."""
        place = int(np.searchsorted(self.ticks, tick, side="right")) - 1
        waits: Array = _until(self._begins, self.rate, bits, tick * self.dt, place)
        return waits

    def _held(self, tick: int) -> Array:
        held: Array = self.rate[max(0, int(np.searchsorted(self.ticks, tick, side="right")) - 1)]
        return held

    @cached_property
    def _begins(self) -> Array:
        return np.asarray(self.ticks * self.dt, dtype=np.float64)


@dataclass(frozen=True)
class _InATick(Rate):
    whole: RateOverTime
    tick: int

    def admit(self, debt: Array, bits: Array, offered: Mask) -> Admission:
        """As of a rate that never changes, but each message waits until the rates to come have let it pass."""
        every = Rate(np.ones(len(debt)), self.burst, self.queue).admit(debt, bits, offered)
        return every._replace(wait=self.whole.seconds(self.tick, every.wait))


@kernel("(m),(m,l),(c,l),(),()->(c,l)", "ddddl->d")
def _until() -> Plain:
    def plain(begins: Array, rates: Array, bits: Array, now: float, first: int, seconds: Array) -> None:
        for channel in range(bits.shape[0]):
            for link in range(bits.shape[1]):
                left, at, place = bits[channel, link], now, first
                while left > 0.0 and place + 1 < len(begins):
                    room = (begins[place + 1] - at) * rates[place, link]
                    if left <= room + _SLACK * bits[channel, link]:
                        break
                    left -= room
                    at = begins[place + 1]
                    place += 1
                if left <= 0.0:
                    seconds[channel, link] = max(0.0, at - now) if bits[channel, link] > 0.0 else 0.0
                elif rates[place, link] > 0.0:
                    seconds[channel, link] = at - now + left / rates[place, link]
                else:
                    seconds[channel, link] = _NEVER

    return plain
