"""Verdicts on what papers claim, from the numbers of many runs: each says what was found, whichever way it goes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.claims import intervals
from analysis.claims.falling import fall
from analysis.claims.intervals import Decision, Interval, all_of
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import whole_power

Span = tuple[float, float | None]

_MOST = 0.9  # of the runs
_DOUBLE = 2.0
_STRAIGHT = 0.99
_HIGHEST_ORDER = 10.0  # of the power laws that an exponential is told from
_FEWEST_MOMENTS = 5  # of a line that is found, not drawn
_PARTS = 10  # of the runs, for what only means over runs show
_HIGH = 0.9  # a correlation
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
    return ClaimVerdict(says, all_of(one.decide(least=0.0, most=factor) for one in ratios), found)


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
    higher = all(one.found < 0.0 for one in below)
    found = f"higher by {_list_of([one.negated for one in below])}" if higher else f"lower by {_list_of(below)}"
    return ClaimVerdict(says, all_of(decisions), f"{found} {unit}".rstrip() + _drawn(paired))


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
    asked = f"asked {between[0]:g} to {between[1]:g}"
    return ClaimVerdict(says, found.decide(*between), f"ratio {found}, {asked}{_drawn(paired)}")


def value(says: str, values: Array, level: float, between: Sequence[float], unit: str) -> ClaimVerdict:
    """The mean of runs (R,) is a level, to factors between two numbers."""
    found = intervals.mean(values)
    least, most = sorted(level * factor for factor in between)
    return ClaimVerdict(says, found.decide(least, most), f"{_of(found, unit)}, asked {least:.3g} to {most:.3g}")


def stays_below(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error stays below a level all through a span of seconds."""
    below, above = _either_side(seconds, error, level, span)
    return _of_most(says, below, ~(below | above), f"stay below {_of(level, unit)}")


def leaves(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error comes above a level at some time in a span of seconds."""
    below, above = _either_side(seconds, error, level, span)
    return _of_most(says, above, ~(below | above), f"come above {_of(level, unit)}")


def exponential(says: str, seconds: Array, error: Array, span: Span) -> ClaimVerdict:
    """In most runs (R, T) the logarithm of the error falls along a line over a span of seconds, by one at least.

    Over a short span that of any power law does too: its curvature must tell it from those up to the tenth order, whenever they
    began.

    Parameters
    ----------
    says, seconds, error
        The claim, the moments, shape (T,), and the error, shape (R, T).
    span
        In seconds.
    """
    inside = within(seconds, span)
    if inside.sum() < _FEWEST_MOMENTS:
        return ClaimVerdict(says, Decision.UNDECIDED, f"{inside.sum()} moments are no line: {_FEWEST_MOMENTS} are")
    falls = fall(seconds[inside], error[:, inside])
    above, unsure = falls.exceeds(_HIGHEST_ORDER)
    straight = (falls.explained >= _STRAIGHT) & (falls.rate > 0.0)
    those = straight & above & (falls.times >= 1.0)
    open_still = straight & (above | unsure) & ~those
    nowhere = np.isnan(error[:, inside]).any(axis=1) | (error[:, inside] == 0.0).any(axis=1)  # 0 has no logarithm
    rate = f", by {falls.rate[those].mean():.3g} 1/s" if those.any() else ""
    do = f"fall along a line (R² at least {_STRAIGHT:g}), to 1/e at least, by no power law below order {_HIGHEST_ORDER:g}{rate}"
    return _of_most(says, those, open_still | nowhere, do)


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


def below_in_mean(says: str, seconds: Array, values: Array, bound: Array, defined: Mask) -> ClaimVerdict:
    """Values (R, T, N) lie below a bound (R, T, N) in the mean over the runs, at all moments at once.

    Parameters
    ----------
    says, seconds
        The claim, and the moments, shape (T,).
    values, bound
        Of the runs, shape (R, T, N).
    defined
        Where there is a value at all, shape (R, T, N): the mean is over these; two runs at a moment are the fewest.
    """
    number = defined.sum(axis=0)
    with np.errstate(invalid="ignore", over="ignore"):
        excess = np.where(defined, values - bound, 0.0)
        mean = excess.sum(axis=0) / np.maximum(number, 1)
        variance = np.where(defined, whole_power(excess - mean, 2), 0.0).sum(axis=0) / np.maximum(number - 1, 1)
    error = np.where(number > 1, np.sqrt(variance / np.maximum(number, 1)), 1.0)
    reach = intervals.student(number, mean.size) * error
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


def follows(says: str, seconds: Array, values: Array, others: Array, defined: Mask, span: Span) -> ClaimVerdict:
    """Over a span of seconds, values rise and fall with others: the rank correlation of their means over runs is high.

    It is that over each of ten parts of the runs, so that it has an interval.

    Parameters
    ----------
    says, seconds
        The claim, and the moments, shape (T,).
    values, others
        Of the runs, shapes (R, T, N) and (R, T).
    defined
        Where there is a value at all, shape (R, T, N): means are over these.
    span
        In seconds.
    """
    if len(values) < 2 * _PARTS:
        return ClaimVerdict(says, Decision.UNDECIDED, f"{len(values)} runs are not ten parts of two or more")
    inside = within(seconds, span)
    parts = [np.arange(part, len(values), _PARTS) for part in range(_PARTS)]
    counted = np.where(defined, values, 0.0)[:, inside]
    number = np.stack([defined[part][:, inside].sum(axis=0) for part in parts])
    total = np.stack([counted[part].sum(axis=0) for part in parts])
    one = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    other = np.stack([others[part][:, inside].mean(axis=0) for part in parts])
    with np.errstate(invalid="ignore"):
        found = [intervals.mean(_rank_correlation(one[..., which], other)) for which in range(one.shape[-1])]
    least = min(found, key=lambda each: each.low)
    decision = all_of(each.decide(least=_HIGH) for each in found)
    return ClaimVerdict(says, decision, f"least rank correlation {least}, asked {_HIGH:g}")


def _rank_correlation(values: Array, others: Array) -> Array:
    """Spearman's, of series (P, T), shape (P,); NaN where a value is none."""
    from scipy.stats import rankdata  # takes half a second, in every process that flies cases

    ranks = [rankdata(each, axis=1) for each in (values, others)]  # what is equal shares its ranks
    one, other = (each - each.mean(axis=1, keepdims=True) for each in ranks)
    with np.errstate(invalid="ignore"):  # what is the same all the time rises and falls with nothing
        correlation = (one * other).sum(axis=1) / np.sqrt(
            whole_power(one, 2).sum(axis=1) * whole_power(other, 2).sum(axis=1)
        )
    return np.where(np.isfinite(values).all(axis=1) & np.isfinite(others).all(axis=1), correlation, np.nan)


def _either_side(seconds: Array, error: Array, level: float, span: Span) -> tuple[Mask, Mask]:
    """Which runs (R, T) are below a level at all moments of a span, and which are above at one; of others nothing is known."""
    inside = error[:, within(seconds, span)]
    return np.all(inside < level, axis=1), np.any(inside >= level, axis=1)


def _of_most(says: str, those: Mask, unknown: Mask, do: str) -> ClaimVerdict:
    """Whether most runs do it, from which did, and of which it cannot be told."""
    found = intervals.share(int(those.sum()), int(unknown.sum()), len(those))
    told = f"{those.sum()} of {len(those)} runs {do}{_untold(int(unknown.sum()))}"
    reach = f"{found.low:.0%} to {found.high:.0%} of all, asked {_MOST:.0%} at least"
    decision = found.decide(least=_MOST)
    if decision is Decision.UNDECIDED and those.all():
        reach += f", which {_enough()} such runs would show"
    return ClaimVerdict(says, decision, f"{told}; {reach}")


def _enough() -> int:
    """How few runs that all do it show that most do."""
    return next(runs for runs in itertools.count(1) if intervals.share(runs, 0, runs).low >= _MOST)


def _of(value: float | Interval, unit: str) -> str:
    said = f"{value:g}" if isinstance(value, float) else str(value)
    return f"{said} {unit}".rstrip()


def _drawn(paired: bool) -> str:
    return "" if paired else " (the runs compared do not meet the same draws)"


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
