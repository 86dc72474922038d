"""Delays: how long a message takes, one way, as a quantile function of a uniform draw, with its mean.

Delays are seconds until the tick they end in is computed: a message offered in tick k with delay d arrives in the first
exchange at or after k dt + d. Correlation is that of an underlying Gaussian sequence (a copula), so the stated distribution
holds exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.elementary import exp, log, power, whole_power

# A delay of exactly three ticks must not become four by rounding.
_SLACK = 1e-9
# Ticks beyond the end of every run, far from where integers wrap.
_NEVER = 2.0**30


class DelayLaw(StrEnum):
    """Distributions of a delay."""

    CONSTANT = "constant"
    UNIFORM = "uniform"
    NORMAL = "normal"
    EXPONENTIAL = "exponential"
    PARETO = "pareto"
    TABLE = "table"


@dataclass(frozen=True)
class MessageDelay:
    """The delay of some links.

    Parameters
    ----------
    law
        Its distribution.
    rows
        True on the links it acts on, shape (L,).
    mean
        In seconds; of NORMAL and UNIFORM, before delays below zero are counted as zero.
    jitter
        In seconds: half-width of UNIFORM, standard deviation of NORMAL and PARETO, not used by the others.
    table
        TABLE: measured delays in seconds, ascending; each comes with the same probability, and no other does.
    correlation
        Of the underlying Gaussian sequence from tick to tick, in [0, 1).
    ordered
        Whether a message waits for those sent before it.
    """

    law: DelayLaw
    rows: Mask
    mean: float
    jitter: float
    table: Array
    correlation: float
    ordered: bool

    def quantile(self, u: Array) -> Array:
        """The delay below which a share u of all messages lies, in seconds, not negative."""
        match self.law:
            case DelayLaw.CONSTANT:
                seconds = np.full(u.shape, self.mean)
            case DelayLaw.UNIFORM:
                seconds = self.mean + self.jitter * (2.0 * u - 1.0)
            case DelayLaw.NORMAL:
                seconds = self.mean + self.jitter * ndtri(u)
            case DelayLaw.EXPONENTIAL:
                seconds = -self.mean * log(1.0 - u)
            case DelayLaw.PARETO:
                shape = self._shape
                seconds = self.mean * (shape - 1.0) / shape * power(1.0 - u, -1.0 / shape)
            case DelayLaw.TABLE:
                place = (u * len(self.table)).astype(np.int64)
                seconds = self.table[np.minimum(place, len(self.table) - 1)]
        return np.maximum(seconds, 0.0)

    @property
    def mean_delay(self) -> float:
        """In seconds, in closed form, with delays below zero counted as zero."""
        mean, jitter = self.mean, self.jitter
        match self.law:
            case DelayLaw.UNIFORM if jitter > mean:
                return (mean + jitter) * (mean + jitter) / (4.0 * jitter)
            case DelayLaw.NORMAL if jitter > 0.0:
                ratio = mean / jitter
                density = exp(-ratio * ratio / 2.0) / np.sqrt(2.0 * np.pi)
                return float(mean * ndtr(ratio) + jitter * density)
            case DelayLaw.TABLE:
                return float(self.table.mean())
        return mean

    @property
    def _shape(self) -> float:
        # Pareto (type I) with this mean and standard deviation: (sd / mean)^2 = 1 / (a (a - 2)).
        return 1.0 + float(np.sqrt(1.0 + whole_power(self.mean / self.jitter, 2)))


def ticks(seconds: Array, dt: float, least: int = 0) -> Integers:
    """Whole ticks until the first exchange at or after each delay, and no less than the least."""
    whole: Integers = _ticks(seconds, dt, least)
    return whole


@kernel("(),(),()->()", "ddl->l")
def _ticks() -> Plain:
    def plain(seconds: float, dt: float, least: int, whole: Integers) -> None:
        ahead = seconds / dt - _SLACK
        if ahead <= 0.0:
            whole[0] = 0
        elif not ahead < _NEVER:
            whole[0] = int(_NEVER)
        else:
            whole[0] = int(ahead)
            if whole[0] < ahead:
                whole[0] += 1
        whole[0] = max(whole[0], least)

    return plain


def correlated(before: Array, fresh: Array, correlation: float) -> Array:
    """The next values of Gaussian sequences: standard normal again, with this correlation to the last."""
    following: Array = correlation * before + np.sqrt(1.0 - correlation * correlation) * fresh
    return following
