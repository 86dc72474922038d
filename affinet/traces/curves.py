"""Curves from a distance, a signal or a pathloss to the availability of a link."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol

import numpy as np
from scipy.special import ndtr

from analysis.models.arrays import Array


class Curve(Protocol):
    """How probable it is that a message passes."""

    def __call__(self, at: Array) -> Array:
        """The availability at distances, signals or pathlosses."""
        ...


class Points(NamedTuple):
    """Straight between points, and level before the first and after the last."""

    points: Sequence[Sequence[float]]

    def __call__(self, at: Array) -> Array:
        """The availability at distances, signals or pathlosses."""
        x, share = np.array(self.points).T
        return np.asarray(np.interp(at, x, share), dtype=np.float64)


class Ramp(NamedTuple):
    """All passes up to `inner` metres, nothing from `outer` on, straight between."""

    inner: float
    outer: float

    def __call__(self, at: Array) -> Array:
        """The availability at distances; at `outer` itself nothing passes, where it is not `inner` too."""
        if self.inner == self.outer:
            return np.asarray(at <= self.outer, dtype=np.float64)
        return np.asarray(np.clip((self.outer - at) / (self.outer - self.inner), 0.0, 1.0), dtype=np.float64)


class LogDistance(NamedTuple):
    """Phi(10 n log10(range / d) / shadowing): half passes at `range` metres."""

    range: float
    exponent: float
    shadowing: float

    def __call__(self, at: Array) -> Array:
        """The availability at distances."""
        with np.errstate(divide="ignore"):
            margin = 10.0 * self.exponent * np.log10(self.range / at)  # infinite where both are in one place
        if not self.shadowing:
            return np.asarray(margin >= 0.0, dtype=np.float64)
        return np.asarray(ndtr(margin / self.shadowing), dtype=np.float64)
