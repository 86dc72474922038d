"""Figures of interleaved rounds, with intervals, and whether they have become worse. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import comb, exp, hypot, log
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array

WORSE = 0.2  # as a share: from here on a ratio is worse
_CONFIDENCE = 0.95
_FEWEST = 5  # rounds that tell how noisy the machine is


class Measured(NamedTuple):
    """A median over rounds, and an interval of it."""

    median: float
    low: float
    high: float
    rounds: int

    @property
    def is_steady(self) -> bool:
        """Whether enough rounds lie within 20 % of their median."""
        return self.rounds >= _FEWEST and max(self.high / self.median, self.median / self.low) <= 1.0 + WORSE

    def __str__(self) -> str:
        return f"{self.median:.3g} ({self.low:.3g} to {self.high:.3g})"


def over_rounds(values: Sequence[float]) -> Measured:
    """The median, and the narrowest pair of order statistics that hold it with 95 %; of few rounds the least and the largest.

    The least and the largest of 5 rounds hold the median with 94 %, those of 3 with 75 %.

    Parameters
    ----------
    values
        One of each round.
    """
    ordered, rounds = sorted(values), len(values)
    outside = 0
    while 2 * (outside + 1) < rounds and 1.0 - 2.0 * _tail(rounds, outside + 1) >= _CONFIDENCE:
        outside += 1
    return Measured(float(np.median(ordered)), ordered[outside], ordered[rounds - 1 - outside], rounds)


def _tail(rounds: int, outside: int) -> float:
    """The chance that no more than so many of the values are below the median."""
    return sum(comb(rounds, few) for few in range(outside + 1)) / 2.0**rounds


def ratio(ours: Sequence[float], theirs: Sequence[float]) -> Measured:
    """Our cost by theirs, round by round: below 1 ours is the lower.

    Parameters
    ----------
    ours, theirs
        Costs of each round, in its order.
    """
    return over_rounds([own / other for own, other in zip(ours, theirs, strict=True)])


def exponent(sizes: Sequence[float], costs: Array) -> Measured:
    """The power of its size with which a cost grows: least squares over logarithms, in each round.

    Parameters
    ----------
    sizes
        Shape (S,).
    costs
        Shape (rounds, S).
    """
    at = np.log(sizes) - np.log(sizes).mean()
    return over_rounds((np.log(costs) @ at / (at @ at)).tolist())


def of_twice_the_size(power: Measured) -> Measured:
    """By how much what grows with this exponent costs more at twice the size."""
    return Measured(2.0**power.median, 2.0**power.low, 2.0**power.high, power.rounds)


def worsened(before: Measured, now: Measured) -> float:
    """By which share a ratio has certainly become worse, 0.2 for 20 %; below 0 where it may be no worse.

    The lower end of the change: its logarithm less the distances of `now` to its lower and of `before` to its upper end, which
    add as independent errors do.

    Parameters
    ----------
    before, now
        The same ratio of costs, in two runs.
    """
    doubt = hypot(log(now.median / now.low), log(before.high / before.median))
    return exp(log(now.median / before.median) - doubt) - 1.0


def worse(before: Mapping[str, Measured], now: Mapping[str, Measured]) -> list[str]:
    """The ratios that are 20 % worse than before, beyond their intervals.

    Parameters
    ----------
    before, now
        By name. What is only in one of them is not compared.
    """
    return [name for name, old in before.items() if name in now and worsened(old, now[name]) > WORSE]
