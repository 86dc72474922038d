"""Two methods that meet the same draws, run by run: which is better, by how much, and when one may say that neither is."""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from scipy import special

from analysis.claims import intervals
from analysis.claims.intervals import Interval
from analysis.models import elementary
from analysis.models.arrays import Array

_LEAST = 1e-12  # an error below is none, and has no logarithm


class Comparison(StrEnum):
    """How one compares with another: the same where they differ by less than matters, undecided where it cannot be told."""

    BETTER = "better"
    WORSE = "worse"
    SAME = "no difference"
    UNDECIDED = "undecided"


def ratio(values: Array, others: Array, worst: float, tests: int, confidence: float) -> Interval:
    """By which factor errors of runs (R,) are those of others (R,) of the same draws: the ratio of geometric means.

    Logarithms have an interval by Student's t where errors of runs that went astray leave means without any; errors beyond the
    worst, and those that are no number, count as the worst.

    Parameters
    ----------
    values, others
        Errors, above 0.
    worst
        Beyond which one error is as bad as another.
    tests
        How many intervals are to hold at once (Bonferroni).
    confidence
        With which they do.
    """
    found = intervals.difference(
        _logs(values, worst), _logs(others, worst), paired=True, tests=tests, confidence=confidence
    )
    back = elementary.exp(np.array([found.found, found.low, found.high]))
    return Interval(float(back[0]), float(back[1]), float(back[2]))


def compared(factor: Interval, matters: float) -> Comparison:
    """What a ratio of errors decides, where a factor up to `matters`, above 1, matters to nobody."""
    if 1.0 / matters <= factor.low and factor.high <= matters:
        return Comparison.SAME
    if factor.high < 1.0:
        return Comparison.BETTER
    return Comparison.WORSE if factor.low > 1.0 else Comparison.UNDECIDED


def median(values: Array, confidence: float) -> Interval:
    """The median of runs (R,), infinite ones among them, with the exact interval of order statistics.

    Its ends are the two values next outside of which the median of all is by chance in no more than what the confidence leaves;
    infinite where there are too few runs.

    Parameters
    ----------
    values
        Of the runs, shape (R,); an infinite one is larger than any.
    confidence
        With which the interval holds the median of all runs.
    """
    runs, ordered = len(values), np.sort(values)
    below = np.arange(runs)
    # Fewer than so many of the runs lie below the median of all with this probability, by the binomial distribution of a coin.
    chance = special.bdtr(below, runs, 0.5)
    kept = int((chance <= (1.0 - confidence) / 2.0).sum())
    middle = float((ordered[(runs - 1) // 2] + ordered[runs // 2]) / 2.0) if runs else np.nan
    if kept == 0:
        return Interval(middle, -np.inf, np.inf)
    return Interval(middle, float(ordered[kept - 1]), float(ordered[runs - kept]))


def larger(values: Array, others: Array, tests: int, confidence: float) -> Comparison:
    """Whether values of runs (R,) are larger than others (R,) of the same draws, by the exact test of signs; larger is better.

    Parameters
    ----------
    values, others
        Of the runs; infinite ones are larger than any, and as large as each other.
    tests
        How many comparisons are to be right at once (Bonferroni).
    confidence
        With which they are.
    """
    above, below = int((values > others).sum()), int((values < others).sum())
    if above == below == 0:
        return Comparison.SAME
    chance = 2.0 * float(special.bdtr(min(above, below), above + below, 0.5))
    if chance * tests > 1.0 - confidence:
        return Comparison.UNDECIDED
    return Comparison.BETTER if above > below else Comparison.WORSE


def _logs(values: Array, worst: float) -> Array:
    return np.asarray(elementary.log(np.clip(np.where(values < worst, values, worst), _LEAST, None)))
