"""Whether at least a share of all runs pass, asked after a few, and again after more: what is clear early is decided early.

Each look has an exact interval, and a part of the risk: the parts together are the risk of the whole, so that by Bonferroni
the interval at which one stops holds the true share with the confidence asked for, whatever the share, and whenever one stops.
"""

from __future__ import annotations

from typing import NamedTuple

from analysis.claims import intervals
from analysis.claims.intervals import Interval

_FRACTIONS = (2, 4, 8)  # of the runs, after which one looks before the end


class Look(NamedTuple):
    """After so many runs, with this confidence in each end of the interval."""

    runs: int
    confidence: float


def looks(most: int, confidence: float) -> list[Look]:
    """After how many runs one looks, up to the most: each time after twice as many, and half of the risk at the last.

    Parameters
    ----------
    most
        Runs there are, at least 1.
    confidence
        With which the interval at which one stops holds the true share.
    """
    numbers = sorted({most, *(-(-most // fraction) for fraction in _FRACTIONS)})
    parts = [1.0 / fraction for fraction in (*_FRACTIONS, 2 * _FRACTIONS[-1])[len(numbers) - 1 :: -1]]
    parts[0] *= 2.0  # what is left, so that all of it is spent
    return [Look(runs, 1.0 - (1.0 - confidence) * part / 2.0) for runs, part in zip(numbers, parts, strict=True)]


def found(passed: int, told: int, look: Look) -> Interval:
    """The share of those that passed, of those that told anything, with its exact interval at a look."""
    if not told:
        return Interval(float("nan"), 0.0, 1.0)
    return intervals.share(passed, 0, told, look.confidence)
