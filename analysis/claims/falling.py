"""How errors fall: along which line their logarithm does, and how far from a power law that is.

A power law of order a, error ~ (t + tau)^-a, has the same curvature in its logarithm everywhere, and whenever it began: its
second derivative is 1 / a of the square of its first. An exponential is the power law of order infinity. So 1 / a tells them
apart, the worse the less an error falls, and what falls too little or too noisily to tell has a wide interval.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import special

from analysis.claims.intervals import CONFIDENCE
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log, whole_power

_PARAMETERS = 3  # of a parabola


class Fall(NamedTuple):
    """How the logarithm of each run (R,) falls over a span.

    Parameters
    ----------
    rate
        Of the line through it, per second.
    times
        By how many times e it falls along this line, over all of the span.
    explained
        Which share of its variance the line explains (R²).
    low, high
        The ends between which 1 / the order of the power law is, with the confidence of all intervals: 0 of an exponential,
        below 0 where it falls ever faster.
    """

    rate: Array
    times: Array
    explained: Array
    low: Array
    high: Array

    def exceeds(self, order: float) -> tuple[Mask, Mask]:
        """Which fall by a power law of a higher order for sure, or exponentially, and of which it cannot be told."""
        surely = np.maximum(np.abs(self.low), np.abs(self.high)) <= 1.0 / order
        never = (self.low > 1.0 / order) | (self.high < -1.0 / order)
        return surely, ~(surely | never)


def fall(seconds: Array, error: Array) -> Fall:
    """How errors (R, T) fall over their moments (T,), more than three; runs may stand still, or have no number.

    A line and a parabola are laid through the logarithm by least squares. What they miss is taken to be correlated from moment
    to moment, as it is without noise: the variance of a mean is then (1 + r) / (1 - r) as large, by its correlation r. That is
    enough where a span is long for what is correlated: of a noise that lasts a tenth of it, an interval of 99 % has 90 % of the
    runs.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        logarithm = log(error)
        middle = logarithm - logarithm.mean(axis=1, keepdims=True)
        line = seconds - seconds.mean()
        bow = whole_power(line, 2) - whole_power(line, 2).mean()
        bow -= line * (product(bow, line) / product(line, line))
        slope, bend = (product(middle, shape) / product(shape, shape) for shape in (line, bow))
        off_line = middle - slope[:, None] * line
        missed = off_line - bend[:, None] * bow
        unsure = np.sqrt(_variance(missed) / product(bow, bow)) * _reach(len(seconds) - _PARAMETERS)
        return Fall(
            rate=-slope,
            times=-slope * (line[-1] - line[0]),
            explained=1.0 - whole_power(off_line, 2).sum(axis=1) / whole_power(middle, 2).sum(axis=1),
            low=2.0 * (bend - unsure) / whole_power(slope, 2),
            high=2.0 * (bend + unsure) / whole_power(slope, 2),
        )


def _variance(missed: Array) -> Array:
    """Of as many moments (R, T) as would tell as much if they were independent."""
    squares = whole_power(missed, 2).sum(axis=1)
    correlation = (missed[:, 1:] * missed[:, :-1]).sum(axis=1) / np.where(squares > 0.0, squares, 1.0)
    alike = np.maximum(correlation, 0.0)
    return squares / (missed.shape[1] - _PARAMETERS) * (1.0 + alike) / (1.0 - alike)


def _reach(freedom: int) -> float:
    return float(-special.stdtrit(freedom, (1.0 - CONFIDENCE) / 2.0))
