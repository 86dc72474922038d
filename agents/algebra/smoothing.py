"""From estimates that jump to outputs that do not: the transition function of (7), a spline, and a low-pass filter (remark 3).

All of paper 002. What comes out has m continuous derivatives, where m is the order of the target.
"""

from __future__ import annotations

from functools import reduce
from math import comb, factorial
from typing import NamedTuple

import numpy as np

from analysis.models import jets
from analysis.models.arrays import Array
from analysis.models.elementary import exp, whole_power


def passed_over(passed: Array, rate: Array, alpha: float, order: int) -> Array:
    """The jet of eta (appendix B), shape (m + 1, ...): how far the smooth output has passed to the newer prediction.

    Parameters
    ----------
    passed
        The share of the detection's latency that has passed, shape (...).
    rate
        Of that share, per second, shape (...).
    alpha
        The smaller, the sooner the newer prediction counts.
    order
        m.
    """
    exponent = orders = order + 1
    rising = jets.power(passed, exponent, rate, orders)
    falling = whole_power(alpha, exponent) * jets.power(1.0 - passed, exponent, -rate, orders)
    return jets.quotient(rising, rising + falling)


def mixed(older: Array, newer: Array, share: Array) -> Array:
    """The jet of information (7), in which the newer prediction has a share; all of shape (m + 1, ...)."""
    rest = np.concatenate([1.0 - share[:1], -share[1:]])
    return jets.scaled(rest, older) + jets.scaled(share, newer)


class Counts(NamedTuple):
    """By how much derivative number k of a sample counts in the jet of the spline: (m + 1, m + 1, ...), by k and by order."""

    older: Array
    newer: Array


def counts(passed: Array, seconds: Array, order: int) -> Counts:
    """What counts for how much in the polynomial from one sample to the next, with m derivatives alike at both (remark 3).

    Parameters
    ----------
    passed
        How much of the way has passed, shape (...).
    seconds
        How long the way takes, shape (...).
    order
        m.
    """
    orders, rate = order + 1, 1.0 / seconds
    begun = [jets.power(passed, exponent, rate, orders) for exponent in range(orders)]
    left = [jets.power(1.0 - passed, exponent, -rate, orders) for exponent in range(orders)]
    begins, ends = (
        _at_one_end(from_it, jets.power(to_it, orders, way, orders))
        for from_it, to_it, way in ((begun, 1.0 - passed, -rate), (left, passed, rate))
    )
    units = [whole_power(seconds, held) / factorial(held) for held in range(orders)]
    return Counts(
        older=np.stack([begins[held] * unit for held, unit in enumerate(units)]),
        newer=np.stack([ends[held] * (-unit if held % 2 else unit) for held, unit in enumerate(units)]),
    )


def splined(older: Array, newer: Array, by: Counts) -> Array:
    """The jet of the spline from one sample to the next.

    Parameters
    ----------
    older, newer
        Jets of information where the samples were taken, shape (m + 1, ..., r, c).
    by
        What counts for how much.
    """
    terms = []
    for held in range(len(older)):
        terms.append(by.older[held][..., None, None] * older[held])
        terms.append(by.newer[held][..., None, None] * newer[held])
    return reduce(np.add, terms)


def lagging(stages: Array, entering: Array, ticks: float) -> Array:
    """What a chain of equal first-order lags holds a tick later; what enters it is kept for that long.

    Parameters
    ----------
    stages
        Shape (..., stages, C), from the first to the last.
    entering
        Shape (..., C).
    ticks
        A tick, by the time constant of a stage.
    """
    held = exp(-ticks)
    left = [held * whole_power(ticks, number) / factorial(number) for number in range(stages.shape[-2])]
    passed = [
        reduce(np.add, [left[stage - source] * stages[..., source, :] for source in range(stage + 1)])
        + (1.0 - sum(left[: stage + 1])) * entering
        for stage in range(stages.shape[-2])
    ]
    return np.stack(passed, axis=-2)


def last_of(stages: Array, rate: float) -> Array:
    """The jet of what leaves a chain of lags (..., stages, C), shape (stages, ..., C); `rate` is 1 / its time constant."""
    falling, found = stages, [stages[..., -1, :]]
    for _ in range(stages.shape[-2] - 1):
        falling = rate * (falling[..., :-1, :] - falling[..., 1:, :])
        found.append(falling[..., -1, :])
    return np.stack(found)


def _at_one_end(near: list[Array], far: Array) -> list[Array]:
    """The jets of the polynomials that have one derivative at this end, and none at the other (Hermite).

    `near` are those of the powers of the way from this end, `far` that of as many powers of the way to the other as there are.
    """
    orders = len(near)
    basis = []
    for held in range(orders):
        series = [comb(orders - 1 + number, number) * near[held + number] for number in range(orders - held)]
        summed = reduce(np.add, series)
        basis.append(jets.scaled(far, summed[..., None, None])[..., 0, 0])
    return basis
