"""Verdicts on what papers claim, from the numbers of many runs: each says what was found, whichever way it goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import special

from analysis.claims import intervals
from analysis.claims.intervals import CONFIDENCE, Decision, Interval, all_of
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log, whole_power

Span = tuple[float, float | None]

_MOST = 0.9  # of the runs
_DOUBLE = 2.0
_STRAIGHT = 0.99
_FEWEST_MOMENTS = 5  # of a line that is found, not drawn
_ROUNDING = 1e-9  # differences below this share are none


@dataclass(frozen=True)
class ClaimVerdict:
    """What becomes of a claim at the settings of a study, and the figures that decided it."""

    says: str
    decision: Decision
    found: str


def flat(says: str, mean_errors: Array, factor: float, unit: str) -> ClaimVerdict:
    """Over the cases (S, R), two at least, the mean over the runs varies by no more than a factor."""
    cases = range(len(mean_errors))
    pairs = [(one, other) for one in cases for other in cases if one != other]
    means = _list(_means(mean_errors))
    if not pairs:
        return ClaimVerdict(says, Decision.UNDECIDED, f"one case is not compared with any: {means} {unit}".rstrip())
    ratios = [
        intervals.ratio(mean_errors[one], mean_errors[other], paired=True, tests=len(pairs)) for one, other in pairs
    ]
    largest = max(ratios, key=lambda one: -np.inf if np.isnan(one.found) else one.found)
    found = f"largest over smallest {largest}, allowed {factor:g}: {means} {unit}".rstrip()
    return ClaimVerdict(says, all_of(one.decide(most=factor) for one in ratios), found)


def approaches(says: str, mean_errors: Array, others: Array, least: float) -> ClaimVerdict:
    """From the last case to the first of (S, R), the mean at least doubles, and comes nearest to the other's, to a share of it.

    The last case, where nothing is lost and both may be the same, is where it starts from; nearer counts among the others.

    Parameters
    ----------
    says
        The claim.
    mean_errors, others
        Of one and of the other, shape (S, R).
    least
        How near it comes, as a share of the other's.
    """
    count = len(mean_errors)
    if count < 2:
        return ClaimVerdict(says, Decision.UNDECIDED, "one case comes from none to another")
    ratios = [
        intervals.ratio(one, other, paired=True, tests=count) for one, other in zip(mean_errors, others, strict=True)
    ]
    growth = intervals.ratio(mean_errors[0], mean_errors[-1], paired=True, tests=count)
    nearer = (_nearer(mean_errors, others, 0, other, count).decide(least=0.0) for other in range(1, count - 1))
    decision = all_of([ratios[0].decide(least=least), growth.decide(least=_DOUBLE), *nearer])
    found = f"ratio to the other {_list_of(ratios)}, from the first case to the last; it grows by {growth}"
    return ClaimVerdict(says, decision, found)


def _nearer(mean_errors: Array, others: Array, one: int, other: int, tests: int) -> Interval:
    """By how much the ratio of a case is above that of another, at first order in the errors of the means."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        means, bases = mean_errors.mean(axis=1, keepdims=True), others.mean(axis=1, keepdims=True)
        linear = means / bases + (mean_errors - means / bases * others) / bases
        return intervals.difference(linear[one], linear[other], paired=True, tests=tests)


def lower(says: str, mean_errors: Array, others: Array, unit: str, *, paired: bool) -> ClaimVerdict:
    """In every case (S, R), the mean is below the other's, by more than rounding.

    Parameters
    ----------
    says
        The claim.
    mean_errors, others
        Of one and of the other, shape (S, R) each.
    unit
        Of both.
    paired
        Whether run r of the one meets the draws of run r of the other.
    """
    below = [
        intervals.difference(other, one, paired=paired, tests=len(mean_errors))
        for one, other in zip(mean_errors, others, strict=True)
    ]
    least = _ROUNDING * np.abs(_means(others))
    decisions = [
        Decision.DOES_NOT_HOLD if one.high <= rounding else one.decide(least=np.nextafter(rounding, np.inf))
        for one, rounding in zip(below, np.where(np.isfinite(least), least, 0.0), strict=True)
    ]
    apart = "" if paired else ", of runs with draws of their own"
    return ClaimVerdict(says, all_of(decisions), f"lower by {_list_of(below)} {unit}".rstrip() + apart)


def ratio(says: str, values: Array, others: Array, between: Sequence[float], *, paired: bool) -> ClaimVerdict:
    """The mean of runs (R,) over that of others lies between two numbers.

    Parameters
    ----------
    says
        The claim.
    values, others
        Of the runs, and of those they are compared with, shape (R,) each.
    between
        Two numbers.
    paired
        Whether run r of the one meets the draws of run r of the other.
    """
    found = intervals.ratio(values, others, paired=paired)
    apart = "" if paired else ", of runs with draws of their own"
    return ClaimVerdict(says, found.decide(*between), f"ratio {found}, asked {between[0]:g} to {between[1]:g}{apart}")


def value(says: str, values: Array, level: float, between: Sequence[float], unit: str) -> ClaimVerdict:
    """The mean of runs (R,) is a level, to factors between two numbers."""
    found = intervals.mean(values)
    least, most = sorted(level * factor for factor in between)
    return ClaimVerdict(says, found.decide(least, most), f"{found} {unit}, asked {least:.3g} to {most:.3g}")


def stays_below(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error stays below a level all through a span of seconds."""
    below, above = _either_side(seconds, error, level, span)
    return _of_most(says, below, ~(below | above), f"stay below {level:g} {unit}")


def leaves(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error comes above a level at some time in a span of seconds."""
    below, above = _either_side(seconds, error, level, span)
    return _of_most(says, above, ~(below | above), f"come above {level:g} {unit}")


def exponential(says: str, seconds: Array, error: Array, span: Span) -> ClaimVerdict:
    """In most runs (R, T) the logarithm of the error falls along a straight line over a span of seconds, by one at least."""
    inside = within(seconds, span)
    if inside.sum() < _FEWEST_MOMENTS:
        return ClaimVerdict(says, Decision.UNDECIDED, f"{inside.sum()} moments are no line: {_FEWEST_MOMENTS} are")
    # Runs may diverge, stand still, or end at 0.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        time, logarithm = seconds[inside] - seconds[inside].mean(), log(error[:, inside])
        slope = product(logarithm, time) / product(time, time)
        total = logarithm - logarithm.mean(axis=1, keepdims=True)
        explained = 1.0 - whole_power(total - slope[:, None] * time, 2).sum(axis=1) / whole_power(total, 2).sum(axis=1)
        straight = (explained >= _STRAIGHT) & (slope < 0.0)
        short = straight & (-slope * (time[-1] - time[0]) < 1.0)
    nowhere = np.isnan(error[:, inside]).any(axis=1)
    rate = f", by {-slope[straight].mean():.3g} 1/s" if straight.any() else ""
    return _of_most(
        says,
        straight & ~short,
        short | nowhere,
        f"fall along a line (R² at least {_STRAIGHT:g}), to 1/e at least{rate}",
    )


def never_above(says: str, values: Array, bounds: Array) -> ClaimVerdict:
    """No value (n,) lies above its bound."""
    above, unknown = values > bounds, np.isnan(values) | np.isnan(bounds)
    count = len(values) - above.sum() - unknown.sum()
    with np.errstate(invalid="ignore"):
        means = f"in the mean {values.mean():.4g} against {bounds.mean():.4g}" if len(values) else "there is none"
    found = f"{count} of {len(values)} are not above{_untold(int(unknown.sum()))}; {means}"
    if above.any():
        return ClaimVerdict(says, Decision.DOES_NOT_HOLD, found)
    sure = len(values) > 0 and not unknown.any()
    return ClaimVerdict(says, Decision.HOLDS if sure else Decision.UNDECIDED, found)


def below_in_mean(says: str, seconds: Array, values: Array, bound: Array) -> ClaimVerdict:
    """Values (R, T, N) lie below a bound (R, T, 1) in the mean over the runs, at all moments at once."""
    runs, excess = len(values), values - bound
    mean = excess.mean(axis=0)
    reach = np.full_like(mean, np.inf)
    if runs > 1:
        quantile = -special.stdtrit(runs - 1, (1.0 - CONFIDENCE) / (2.0 * mean.size))
        reach = quantile * excess.std(axis=0, ddof=1) / np.sqrt(runs)
    above = np.argwhere(mean - reach > 0.0)
    if len(above):
        tick, which = above[0]
        found = f"above at {len(above) / mean.size:.1%} of the moments, first at {seconds[tick]:g} s by {mean[tick, which]:.3g}"
        return ClaimVerdict(says, Decision.DOES_NOT_HOLD, found)
    below = mean + reach <= 0.0
    found = (
        f"at {below.all(axis=1).sum()} of {len(seconds)} moments, for all {values.shape[-1]}; closest {mean.max():.3g}"
    )
    return ClaimVerdict(says, Decision.HOLDS if below.all() else Decision.UNDECIDED, found)


def _either_side(seconds: Array, error: Array, level: float, span: Span) -> tuple[Mask, Mask]:
    """Which runs (R, T) are below a level at all moments of a span, and which are above at one; of others nothing is known."""
    inside = error[:, within(seconds, span)]
    return np.all(inside < level, axis=1), np.any(inside >= level, axis=1)


def _of_most(says: str, those: Mask, unknown: Mask, do: str) -> ClaimVerdict:
    """Whether most runs do it, from which did, and of which it cannot be told."""
    found = intervals.share(int(those.sum()), int(unknown.sum()), len(those))
    told = f"{those.sum()} of {len(those)} runs {do}{_untold(int(unknown.sum()))}"
    reach = f"{found.low:.0%} to {found.high:.0%} of all, asked {_MOST:.0%} at least"
    return ClaimVerdict(says, found.decide(least=_MOST), f"{told}; {reach}")


def _untold(number: int) -> str:
    return f", of {number} it cannot be told" if number else ""


def within(seconds: Array, span: Span) -> Mask:
    """Which moments lie in a span.

    Raises
    ------
    ValueError
        When none does.
    """
    since, until = span
    inside = (seconds >= since) & (seconds <= (np.inf if until is None else until))
    if not inside.any():
        raise ValueError(f"no moment lies in its span from {since:g} s on: the runs end at {seconds[-1]:g} s")
    return inside


def _means(runs: Array) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):
        means: Array = runs.mean(axis=1)
    return means


def _list(values: Array) -> str:
    return ", ".join(f"{value:.3g}" for value in values.tolist())


def _list_of(found: Sequence[Interval]) -> str:
    return ", ".join(map(str, found))
