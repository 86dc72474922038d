"""Probabilities of hidden chains by maximum likelihood, with intervals by the profile of the likelihood."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import optimize, stats
from scipy.special import expit, logit

from analysis.models.arrays import Array, Mask
from netem.impairments.chain import Chain
from netem.impairments.likelihood import log_likelihood

CONFIDENCE = 0.95
_DROP = float(stats.chi2.ppf(CONFIDENCE, 1)) / 2.0  # of the log-likelihood, at the ends of an interval
_FARTHEST = 12.0  # logits of probabilities: 6e-6 to 1 - 6e-6
_STRIDE = 0.3  # logits
_BETWEEN = 3  # looks for an end of an interval, once it is bracketed
_OUT_OF_ORDER = 1e3  # what it costs for each squared logit


class Interval(NamedTuple):
    """A parameter, and between what it lies with a confidence of 95 %."""

    value: float
    low: float
    high: float


class Hidden(NamedTuple):
    """A chain whose states are hidden.

    Parameters
    ----------
    names
        Of its parameters.
    build
        The chain of them.
    starts
        Where to look from.
    leaving
        Pairs of parameters whose sum is at most 1.
    ordered
        Pairs of which the first is the larger: else states could take each other's names.
    """

    names: tuple[str, ...]
    build: Callable[..., Chain]
    starts: Sequence[tuple[float, ...]]
    leaving: Sequence[tuple[int, ...]] = ()
    ordered: Sequence[tuple[int, int]] = ()


def maximal(hidden: Hidden, sequences: Sequence[Mask], *, sure: bool) -> Mapping[str, Interval]:
    """The parameters by which a chain makes sequences most probable.

    Parameters
    ----------
    hidden, sequences
        Which chain, and of messages, lost or not, shape (n,) each.
    sure
        Whether to find their intervals too, which takes its time; else they are NaN.
    """
    found = [_lowest(_cost(hidden, sequences), _logits(hidden, start), None) for start in hidden.starts]
    lowest = min(found, key=lambda one: one.cost)
    chances = _inside(hidden, lowest.at)
    parameters = {}
    for place, name in enumerate(hidden.names):
        led = hidden._replace(leaving=tuple(pair[::-1] if pair[1] == place else pair for pair in hidden.leaving))
        there = _Lowest(_logits(led, chances.tolist()), lowest.cost)
        ends = _ends(led, _cost(led, sequences), there, place) if sure else (np.nan, np.nan)
        parameters[name] = Interval(float(chances[place]), *ends)
    return parameters


def _cost(hidden: Hidden, sequences: Sequence[Mask]) -> Callable[[Array], float]:
    def cost(at: Array) -> float:
        chain = hidden.build(*_inside(hidden, at).tolist())
        disorder = sum(max(0.0, float(at[less] - at[more])) for more, less in hidden.ordered)
        return _OUT_OF_ORDER * disorder * disorder - sum(log_likelihood(chain, one) for one in sequences)

    return cost


class _Lowest(NamedTuple):
    at: Array
    cost: float


def _lowest(cost: Callable[[Array], float], start: Array, fixed: int | None) -> _Lowest:
    """The least cost about a start, where one coordinate may stay what it is."""
    free = np.arange(len(start)) != (-1 if fixed is None else fixed)

    def at(given: Array) -> Array:
        whole = start.copy()
        whole[free] = given
        return whole

    def cost_at(given: Any) -> float:
        return cost(at(given))

    inside = np.clip(start[free], -_FARTHEST, _FARTHEST).tolist()
    found = optimize.minimize(
        cost_at, np.array(inside), method="L-BFGS-B", bounds=optimize.Bounds(-_FARTHEST, _FARTHEST)
    )
    return _Lowest(at(found.x), float(found.fun))


def _ends(hidden: Hidden, cost: Callable[[Array], float], best: _Lowest, place: int) -> tuple[float, float]:
    """Between what a parameter lies: where the likelihood, at its highest over the others, has dropped by so much."""
    low, high = (_end(cost, best, place, way) for way in (-1.0, 1.0))
    return (
        0.0 if low is None else float(_inside(hidden, low)[place]),
        1.0 if high is None else float(_inside(hidden, high)[place]),
    )


def _end(cost: Callable[[Array], float], best: _Lowest, place: int, way: float) -> Array | None:
    """One end, None where the likelihood never drops: outwards in growing strides, then between by regula falsi.

    The square root of the drop is all but straight.
    """

    def beyond(near: Array, value: float) -> tuple[float, Array]:
        start = near.copy()
        start[place] = value
        there = _lowest(cost, start, place)
        return float(np.sqrt(max(0.0, there.cost - best.cost)) - np.sqrt(_DROP)), there.at

    inside, (below, near), stride = float(best.at[place]), (-float(np.sqrt(_DROP)), best.at), way * _STRIDE
    while True:
        outside = float(np.clip(inside + stride, -_FARTHEST, _FARTHEST))
        above, at = beyond(near, outside)
        if above > 0.0:
            break
        if abs(outside) >= _FARTHEST:
            return None
        inside, below, near, stride = outside, above, at, 2.0 * stride
    for _ in range(_BETWEEN):
        middle = inside - below * (outside - inside) / (above - below)
        there, at = beyond(near, middle)
        if there > 0.0:
            outside, above = middle, there
        else:
            inside, below, near = middle, there, at
    found = near.copy()
    found[place] = inside - below * (outside - inside) / (above - below)
    return found


def _inside(hidden: Hidden, at: Array) -> Array:
    """Probabilities from any numbers: logistic, and of two that share a state the second is of what the first leaves."""
    chances = np.asarray(expit(at), dtype=np.float64)
    for first, second in hidden.leaving:
        chances[second] *= 1.0 - chances[first]
    return chances


def _logits(hidden: Hidden, chances: Sequence[float]) -> Array:
    of = np.array(chances)
    for first, second in hidden.leaving:
        of[second] /= max(1.0 - of[first], 1e-12)
    return np.clip(np.asarray(logit(np.clip(of, 0.0, 1.0)), dtype=np.float64), -_FARTHEST, _FARTHEST)
