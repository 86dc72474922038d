"""Limited rate: a token bucket and a queue on every link that has one.

Time passes in ticks and a message is as large as its numbers: what a queue does is the same in every runtime. Messages that are
lost never enter the queue, as in netem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask


@dataclass(frozen=True)
class Rate:
    """The rate of every link; without a limit, rate and queue are infinite.

    Parameters
    ----------
    rate
        In bits per second, shape (L,).
    burst
        Bits that may pass at once after an idle time, shape (L,).
    queue
        Bits that may wait, shape (L,).
    """

    rate: Array
    burst: Array
    queue: Array

    def at(self, tick: int) -> Rate:  # noqa: ARG002
        """The limits in a tick: always these."""
        return self

    def begin(self) -> Array:
        """Full buckets, empty queues: debt in bits, shape (L,); negative while tokens are left."""
        return -self.burst

    def rest(self, debt: Array, seconds: float) -> Array:
        """The debt after a time in which nothing was sent."""
        return np.maximum(debt - self.rate * seconds, -self.burst)

    def admit(self, debt: Array, bits: Array, offered: Mask) -> Admission:
        """Messages of all channels offered in one tick, one channel after the other.

        Parameters
        ----------
        debt
            Shape (L,).
        bits
            Size of a message on each channel, shape (C,).
        offered
            Shape (C, L).
        """
        return Admission(*_admitted(debt, bits, offered, self.queue, self.rate))


class Admission(NamedTuple):
    """What queues made of messages: debt in bits (L,), which overflowed, and how long the others wait in seconds, (C, L)."""

    debt: Array
    overflow: Mask
    wait: Array


@kernel("(l),(c),(c,l),(l),(l)->(l),(c,l),(c,l)", "dd?dd->d?d")
def _admitted() -> Plain:
    def plain(
        debt: Array, bits: Array, offered: Mask, queue: Array, rate: Array, owed: Array, overflow: Mask, wait: Array
    ) -> None:
        for link in range(len(debt)):
            owed[link] = debt[link]
            for channel in range(len(bits)):
                after = owed[link] + bits[channel] if offered[channel, link] else owed[link]
                refused = after > queue[link]
                overflow[channel, link] = refused and offered[channel, link]
                if not refused:
                    owed[link] = after
                wait[channel, link] = (owed[link] if owed[link] > 0.0 else 0.0) / rate[link]

    return plain
