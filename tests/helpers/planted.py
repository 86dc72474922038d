"""Claims on planted data: true by a margin, false by as much, and just false; how often each check decides how."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from analysis.claims import checks
from analysis.claims.checks import ClaimVerdict
from analysis.claims.intervals import Decision

RUNS = 50
_SECONDS = np.linspace(0.0, 10.0, 50)
_ALL = (0.0, None)
_Rng = np.random.Generator


class Planted(NamedTuple):
    """A check of data that are drawn, as far inside (positive) or outside what is asked as `by` says."""

    name: str
    says: str
    check: Callable[[_Rng, float], ClaimVerdict]
    margin: float


class Rates(NamedTuple):
    """How many of a number of draws hold, are undecided, and do not hold."""

    holds: int
    undecided: int
    fails: int


def _means(rng: _Rng, *levels: float) -> np.ndarray:
    """Errors of runs (S, R), skewed as squares are, a third of it in common."""
    common, own = rng.gamma(4.0, 1 / 4.0, RUNS), rng.gamma(4.0, 1 / 4.0, (len(levels), RUNS))
    return np.array(levels)[:, None] * (common / 3 + own * 2 / 3)


def _flat(rng: _Rng, by: float) -> ClaimVerdict:
    return checks.flat("", _means(rng, 1.0, 1.2, 2.0 * (1 - by)), 2.0, "m")


def _approaches(rng: _Rng, by: float) -> ClaimVerdict:
    both = _means(rng, 0.5 * (1 + by), 0.3, 0.1, 1.0, 1.0, 0.2)
    return checks.approaches("", both[:3], both[3:], 0.5)


def _lower(rng: _Rng, by: float) -> ClaimVerdict:
    one, other = _means(rng, 1.0, 1.0 + by)
    return checks.lower("", one[None], other[None], "m", paired=True)


def _lower_apart(rng: _Rng, by: float) -> ClaimVerdict:
    (one,), (other,) = _means(rng, 1.0), _means(rng, 1.0 + by)
    return checks.lower("", one[None], other[None], "m", paired=False)


def _ratio(rng: _Rng, by: float) -> ClaimVerdict:
    one, other = _means(rng, 1.5 * (1 - by), 1.0)
    return checks.ratio("", one, other, (0.5, 1.5), paired=True)


def _value(rng: _Rng, by: float) -> ClaimVerdict:
    (one,) = _means(rng, 1.5 * (1 - by))
    return checks.value("", one, 1.0, (0.5, 1.5), "m")


def _errors(rng: _Rng, share: float) -> np.ndarray:
    """Of runs (R, T), of which about this share comes above 1 at some moment."""
    error = 0.9 * rng.random((RUNS, len(_SECONDS)))
    error[rng.random(RUNS) < share, rng.integers(len(_SECONDS))] = 1.1
    return error


def _stays_below(rng: _Rng, by: float) -> ClaimVerdict:
    return checks.stays_below("", _SECONDS, _errors(rng, 0.1 - by), 1.0, _ALL, "m")


def _leaves(rng: _Rng, by: float) -> ClaimVerdict:
    return checks.leaves("", _SECONDS, _errors(rng, 0.9 + by), 1.0, _ALL, "m")


def _exponential(rng: _Rng, by: float) -> ClaimVerdict:
    falls, stands = np.exp(-0.7 * _SECONDS), np.exp(-0.7 * _SECONDS) + 0.05
    which = rng.random((RUNS, 1)) < 0.9 + by
    error = np.where(which, falls, stands) * (1.0 + 0.02 * rng.standard_normal((RUNS, len(_SECONDS))))
    return checks.exponential("", _SECONDS, error, _ALL)


def _below_in_mean(rng: _Rng, by: float) -> ClaimVerdict:
    noise = 0.2 * rng.standard_normal((2, RUNS, len(_SECONDS), 1))
    everywhere = np.ones(noise[0].shape, dtype=bool)
    return checks.below_in_mean("", _SECONDS, 1.0 - by + noise[0], 1.0 + noise[1], everywhere)


PLANTED = [
    Planted("flat", "largest over smallest at most 2", _flat, 0.4),
    Planted("approaches", "to half of the other", _approaches, 0.6),
    Planted("lower", "below the other, paired", _lower, 0.4),
    Planted("lower, apart", "below the other, of draws of its own", _lower_apart, 0.6),
    Planted("ratio", "0.5 to 1.5 of the other", _ratio, 0.3),
    Planted("value", "0.5 to 1.5 of a level", _value, 0.3),
    Planted("stays_below", "in 9 of 10 runs", _stays_below, 0.1),
    Planted("leaves", "in 9 of 10 runs", _leaves, 0.1),
    Planted("exponential", "in 9 of 10 runs", _exponential, 0.1),
    Planted("below_in_mean", "at all of 50 moments at once", _below_in_mean, 0.25),
]


def rates(planted: Planted, by: float, draws: int) -> Rates:
    """How a check decides on so many draws, inside or outside what is asked by this much."""
    decided = [planted.check(np.random.default_rng([draw, 7]), by).decision for draw in range(draws)]
    return Rates(*(decided.count(one) for one in (Decision.HOLDS, Decision.UNDECIDED, Decision.DOES_NOT_HOLD)))
