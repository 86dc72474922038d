"""Limited rate: a token bucket and a queue on every link that has one.

Time passes in ticks and a message is as large as its numbers: what a queue does is the same in every runtime. Messages that are
lost never enter the queue, as in netem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

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
        sizes = bits[:, None] * offered
        owed, overflow = np.empty_like(sizes), np.empty_like(offered)
        for row, size in enumerate(sizes):
            after = debt + size
            refused = np.greater(after, self.queue, out=overflow[row])
            owed[row] = debt = np.where(refused, debt, after)
        return Admission(debt, overflow & offered, np.maximum(owed, 0.0) / self.rate)


class Admission(NamedTuple):
    """What queues made of messages: debt in bits (L,), which overflowed, and how long the others wait in seconds, (C, L)."""

    debt: Array
    overflow: Mask
    wait: Array
