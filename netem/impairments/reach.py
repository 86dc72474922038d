"""Loss by distance, from the true positions of the tick."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.elementary import power


class ReachLaw(StrEnum):
    """How availability falls with distance."""

    RAMP = "ramp"
    LOG_DISTANCE = "log-distance"


@dataclass(frozen=True)
class Reach:
    """How far the links of some rows reach; each row is a link, shape (L,); the others reach everywhere.

    Parameters
    ----------
    law
        Of all its links.
    rows
        True on the links it acts on.
    inner, outer
        RAMP: availability 1 up to `inner` metres, 0 from `outer` on, straight between; a disk has inner = outer.
        LOG_DISTANCE: `outer` is the distance in metres at which half of the messages pass; `inner` is not used.
    exponent
        Path loss exponent n of LOG_DISTANCE: the signal falls by 10 n log10(d) dB.
    shadowing
        Standard deviation of the shadowing in dB.
    coherence
        Ticks over which a shadow stays; both directions of a link share it.
    sensing, comms
        The channel classes on which it acts.
    """

    law: ReachLaw
    rows: Mask
    inner: float
    outer: float
    exponent: float
    shadowing: float
    coherence: int
    sensing: bool
    comms: bool

    def limit(self, draw: Array, shadow: Array) -> Array:
        """The distance in metres up to which each message passes, shape (..., L); infinite on other links.

        So availability at distance d is: of RAMP, (outer - d) / (outer - inner) between the two; of LOG_DISTANCE, over the
        shadows, Phi(10 n log10(outer / d) / shadowing).

        Parameters
        ----------
        draw
            Uniform, shape (..., L); decides RAMP.
        shadow
            Standard normal, shape (..., L); decides LOG_DISTANCE.
        """
        if self.law is ReachLaw.RAMP:
            farthest = self.outer - draw * (self.outer - self.inner)
        else:
            farthest = self.outer * power(10.0, self.shadowing * shadow / (10.0 * self.exponent))
        limited: Array = np.where(self.rows, farthest, np.inf)
        return limited


def squared_distances(src: Integers, dst: Integers, position: Array) -> Array:
    """Squared length of links between rows `src` and `dst` (L,) of positions (..., N, D), in square metres, shape (..., L)."""
    squared: Array = _squared(src, dst, position)
    return squared


@kernel("(l),(l),(n,D)->(l)", "lld->d")
def _squared(dimension: int) -> Plain:
    def plain(src: Integers, dst: Integers, position: Array, squared: Array) -> None:
        for link in range(len(src)):
            squared[link] = 0.0
            for axis in range(dimension):
                apart = position[src[link], axis] - position[dst[link], axis]
                squared[link] += apart * apart

    return plain
