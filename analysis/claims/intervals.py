"""Confidence intervals of what many runs tell, and what an interval decides: inside what is asked, outside, or neither."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from scipy import special

from analysis.models.arrays import Array, Integers

CONFIDENCE = 0.99


class Decision(StrEnum):
    """What becomes of a claim: it is undecided where runs are too few, too noisy, too short, or have no numbers."""

    HOLDS = "holds"
    DOES_NOT_HOLD = "does not hold"
    UNDECIDED = "undecided"


def all_of(decisions: Iterable[Decision]) -> Decision:
    """Of parts that all have to hold, at least one: one that does not decides."""
    parts = set(decisions)
    if Decision.DOES_NOT_HOLD in parts:
        return Decision.DOES_NOT_HOLD
    return Decision.HOLDS if parts == {Decision.HOLDS} else Decision.UNDECIDED


@dataclass(frozen=True)
class Interval:
    """What a number is found to be, and the ends between which it is with some confidence."""

    found: float
    low: float
    high: float

    def decide(self, least: float = -np.inf, most: float = np.inf) -> Decision:
        """Whether it is from `least` to `most`, ends included."""
        if least <= self.low and self.high <= most:
            return Decision.HOLDS
        return Decision.DOES_NOT_HOLD if self.high < least or self.low > most else Decision.UNDECIDED

    @property
    def negated(self) -> Interval:
        """That of the number with the other sign."""
        return Interval(-self.found, -self.high, -self.low)

    def __str__(self) -> str:
        return f"{self.found:.3g} ({self.low:.3g} to {self.high:.3g})"


def mean(values: Array, tests: int = 1, confidence: float = CONFIDENCE) -> Interval:
    """The mean of runs (R,), by Student's t; of one run, or one that is no number, nothing is known.

    Parameters
    ----------
    values
        Of the runs, shape (R,); where some are infinite in one direction, so is the mean.
    tests
        How many intervals are to hold at once (Bonferroni).
    confidence
        With which they do.
    """
    return difference(values, np.zeros_like(values), paired=True, tests=tests, confidence=confidence)


def difference(
    values: Array, others: Array, *, paired: bool, tests: int = 1, confidence: float = CONFIDENCE
) -> Interval:
    """By how much the mean of runs (R,) is above that of others (S,).

    Parameters
    ----------
    values, others
        Of the runs; as many where they are paired by their draws.
    paired
        Whether run r of the one meets the draws of run r of the other.
    tests
        How many intervals are to hold at once (Bonferroni).
    confidence
        With which they do.
    """
    both = _Both.of(values, others, paired=paired, tests=tests, confidence=confidence)
    found = both.mean - both.other
    if not np.isfinite(found) or both.quantile == np.inf:
        return _unsure(found)
    reach = both.quantile * np.sqrt(max(both.variance + both.other_variance - 2.0 * both.covariance, 0.0))
    return Interval(found, found - reach, found + reach)


def ratio(values: Array, others: Array, *, paired: bool, tests: int = 1) -> Interval:
    """The mean of runs (R,) over that of others (S,), by Fieller's theorem: without ends where the other may be 0.

    Parameters
    ----------
    values, others
        Of the runs; as many where they are paired by their draws.
    paired
        Whether run r of the one meets the draws of run r of the other.
    tests
        How many intervals are to hold at once (Bonferroni).
    """
    both = _Both.of(values, others, paired=paired, tests=tests)
    if both.other == both.other_variance == 0.0:
        return _over_nothing(mean(values, tests))
    found = both.mean / both.other if both.other and np.isfinite(both.other) else np.nan
    if not np.isfinite(found) or both.quantile == np.inf:
        return _unsure(found)
    square = both.quantile * both.quantile
    divisor = both.other * both.other - square * both.other_variance
    if divisor <= 0.0:
        return Interval(found, -np.inf, np.inf)
    middle = both.mean * both.other - square * both.covariance
    under = middle * middle - (both.mean * both.mean - square * both.variance) * divisor
    reach = np.sqrt(max(under, 0.0))
    return Interval(found, (middle - reach) / divisor, (middle + reach) / divisor)


def _over_nothing(one: Interval) -> Interval:
    """What a number is over one that is 0 in all runs: infinite, if it is not 0 itself."""
    if one.low > 0.0 or one.high < 0.0:
        return _unsure(float(np.copysign(np.inf, one.found)))
    return _unsure(np.nan)


def student(runs: Integers, tests: int, confidence: float = CONFIDENCE) -> Array:
    """How many standard errors of means over so many runs reach a confidence (Student's t); infinite for fewer than two.

    Parameters
    ----------
    runs
        Any shape.
    tests
        How many intervals are to hold at once (Bonferroni).
    confidence
        With which they do.
    """
    quantile = -special.stdtrit(np.maximum(runs - 1, 1), (1.0 - confidence) / (2.0 * tests))
    return np.where(runs > 1, quantile, np.inf)


def share(those: int, unknown: int, runs: int, confidence: float = CONFIDENCE) -> Interval:
    """Which share of all runs does what `those` did, by Clopper and Pearson.

    Parameters
    ----------
    those, unknown, runs
        How many did, of how many it cannot be told, and of how many: none of them below, all of them above.
    confidence
        Of each end.
    """
    could = those + unknown
    low = float(special.betaincinv(those, runs - those + 1, 1.0 - confidence)) if those else 0.0
    high = float(special.betaincinv(could + 1, runs - could, confidence)) if could < runs else 1.0
    return Interval(those / runs, low, high)


@dataclass(frozen=True)
class _Both:
    """Means of two samples, the variances and covariance of these, and Student's quantile; infinite of a single run."""

    mean: float
    other: float
    variance: float
    other_variance: float
    covariance: float
    quantile: float

    @classmethod
    def of(cls, values: Array, others: Array, *, paired: bool, tests: int, confidence: float = CONFIDENCE) -> _Both:
        fewest = min(len(values), len(others))
        quantile = float(student(np.array(fewest), tests, confidence))
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            return cls(
                mean=float(values.mean()),
                other=float(others.mean()),
                variance=_covariance(values, values),
                other_variance=_covariance(others, others),
                covariance=_covariance(values, others) if paired else 0.0,
                quantile=quantile,
            )


def _covariance(values: Array, others: Array) -> float:
    """Of the means."""
    if len(values) < 2:
        return 0.0
    together = ((values - values.mean()) * (others - others.mean())).sum()
    return float(together / (len(values) - 1) / len(values))


def _unsure(found: float) -> Interval:
    """Of a number that is infinite for sure, or that may be any."""
    return Interval(found, found, found) if np.isinf(found) else Interval(found, -np.inf, np.inf)
