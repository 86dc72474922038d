"""Verdicts on what papers claim, from the numbers of many runs: each says what was found, whichever way it goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log, whole_power

Span = tuple[float, float | None]

_STANDARD_ERRORS = 3.0
_MOST = 0.9  # of the runs
_DOUBLE = 2.0
_STRAIGHT = 0.99


@dataclass(frozen=True)
class ClaimVerdict:
    """Whether a claim holds at the settings of a study, and the figures that decided it."""

    says: str
    holds: bool
    found: str


def flat(says: str, mean_errors: Array, factor: float, unit: str) -> ClaimVerdict:
    """Over the cases (S, R), the mean over the runs varies by no more than a factor."""
    means = _mean(mean_errors)
    ratio = float(means.max() / means.min())
    return ClaimVerdict(
        says, ratio <= factor, f"largest over smallest {ratio:.2f} (allowed {factor:g}): {_list(means)} {unit}"
    )


def approaches(says: str, mean_errors: Array, others: Array, share: float) -> ClaimVerdict:
    """From the last case to the first of (S, R), the mean at least doubles, and comes nearest to the other's, to a share of it.

    The last case, where nothing is lost and both may be the same, is where it starts from; nearer counts among the others.

    Parameters
    ----------
    says
        The claim.
    mean_errors, others
        Of one and of the other, shape (S, R).
    share
        How near it comes, as a share of the other's.
    """
    means = _mean(mean_errors)
    ratio, growth = means / _mean(others), float(means[0] / means[-1])
    found = f"ratio to the other {_list(ratio)}, from the first case to the last; it grows by {growth:.3g}"
    nearest = bool((ratio[0] >= ratio[:-1]).all())
    return ClaimVerdict(says, bool(ratio[0] >= share and growth >= _DOUBLE and nearest), found)


def lower(says: str, mean_errors: Array, others: Array, unit: str) -> ClaimVerdict:
    """In every case (S, R), the mean is below the other's by three standard errors; runs are paired by their draws."""
    difference = others - mean_errors
    mean, error = _mean(difference), difference.std(axis=1, ddof=1) / np.sqrt(difference.shape[1])
    return ClaimVerdict(
        says, bool((mean > _STANDARD_ERRORS * error).all()), f"lower by {_list(mean)} {unit} (one s.e. {_list(error)})"
    )


def ratio(says: str, values: Array, others: Array, between: Sequence[float]) -> ClaimVerdict:
    """The mean of runs (R,) over that of others lies in an interval, and so does its 95 % confidence interval in part.

    Runs are paired by their draws; the confidence interval is the delta method's.

    Parameters
    ----------
    says
        The claim.
    values, others
        Of the runs, and of those they are paired with, shape (R,).
    between
        The ends of the interval.
    """
    found = float(values.mean() / others.mean())
    deviation = (values - found * others).std(ddof=1) / np.sqrt(len(values)) / abs(others.mean())
    low, high = found - 1.96 * deviation, found + 1.96 * deviation
    holds = bool(low <= between[1] and high >= between[0])
    return ClaimVerdict(
        says,
        holds,
        f"ratio {found:.3g}, 95 % confidence {low:.3g} to {high:.3g} (asked {between[0]:g} to {between[1]:g})",
    )


def stays_below(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error stays below a level all through a span of seconds."""
    inside = within(seconds, span)
    below = (error[:, inside] < level).all(axis=1)
    return ClaimVerdict(
        says, bool(below.mean() >= _MOST), f"{below.mean():.0%} of the runs stay below {level:g} {unit}"
    )


def leaves(says: str, seconds: Array, error: Array, level: float, span: Span, unit: str) -> ClaimVerdict:
    """In most runs (R, T) the error comes above a level at some time in a span of seconds, or is no number any more."""
    inside = within(seconds, span)
    above = ~(error[:, inside] < level).all(axis=1)
    return ClaimVerdict(
        says, bool(above.mean() >= _MOST), f"{above.mean():.0%} of the runs come above {level:g} {unit}"
    )


def exponential(says: str, seconds: Array, error: Array, span: Span) -> ClaimVerdict:
    """In most runs (R, T) the logarithm of the error falls along a straight line over a span of seconds."""
    inside = within(seconds, span)
    # Runs may diverge, stand still, or end at 0.
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        time, logarithm = seconds[inside] - seconds[inside].mean(), log(error[:, inside])
        slope = product(logarithm, time) / product(time, time)
        total = logarithm - logarithm.mean(axis=1, keepdims=True)
        explained = 1.0 - whole_power(total - slope[:, None] * time, 2).sum(axis=1) / whole_power(total, 2).sum(axis=1)
        straight = (explained >= _STRAIGHT) & (slope < 0.0)
    rate = f", by {-slope[straight].mean():.3g} 1/s" if straight.any() else ""
    found = f"{straight.mean():.0%} of the runs fall along a line (R² at least {_STRAIGHT:g}){rate}"
    return ClaimVerdict(says, bool(straight.mean() >= _MOST), found)


def never_above(says: str, values: Array, bounds: Array) -> ClaimVerdict:
    """No value (n,) lies above its bound."""
    above = values > bounds
    found = (
        f"{(~above).sum()} of {len(values)} are not above; in the mean {values.mean():.4g} against {bounds.mean():.4g}"
    )
    return ClaimVerdict(says, not above.any(), found)


def below_in_mean(says: str, seconds: Array, values: Array, bound: Array) -> ClaimVerdict:
    """Values (R, T, N) lie below a bound (R, T, 1) in the mean over the runs at all times, within three standard errors."""
    excess = values - bound
    mean = excess.mean(axis=0)
    error = excess.std(axis=0, ddof=1) / np.sqrt(len(excess))
    above = np.argwhere(mean > _STANDARD_ERRORS * error)
    if not len(above):
        return ClaimVerdict(
            says, True, f"at all of {len(seconds)} moments, for all {values.shape[-1]}; closest {mean.max():.3g}"
        )
    tick, which = above[0]
    share = len(above) / mean.size
    return ClaimVerdict(
        says, False, f"above at {share:.1%} of the moments, first at {seconds[tick]:g} s by {mean[tick, which]:.3g}"
    )


def _mean(runs: Array) -> Array:
    with np.errstate(invalid="ignore", over="ignore"):
        means: Array = np.where(np.isfinite(runs).all(axis=1), runs.mean(axis=1), np.inf)
    return means


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


def _list(values: Array) -> str:
    return ", ".join(f"{value:.3g}" for value in values.tolist())
