"""Checkers of a pursuit: agents have found their target, and agree on where it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from affinet.verdicts.checking import Checker, CheckResult, above_zero, every, span_of, times
from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Array


def found(within: float, by: float = 0.0) -> Checker:
    """From a time on, in seconds, the target is within so many metres of where each agent takes it to be.

    That is where it steers for, with what others tell it; vacuous where nobody pursues a target.

    Parameters
    ----------
    within
        How far off an agent may be, in metres.
    by
        From when on, in seconds.
    """
    return _all_within("found", 1, within, by, lambda evidence, steered: steered - _target(evidence), "from the target")


def agreed(within: float, by: float = 0.0) -> Checker:
    """From a time on, in seconds, where each agent takes the target to be is within so many metres of the mean of all.

    Vacuous where nobody pursues a target, or in some tick nobody but one does.

    Parameters
    ----------
    within
        How far from the mean an agent may be, in metres.
    by
        From when on, in seconds.
    """
    return _all_within(
        "agreed",
        2,
        within,
        by,
        lambda _, steered: steered - np.nanmean(steered, axis=1, keepdims=True),
        "from what all agree on",
    )


def _all_within(
    word: str, least: int, within: float, by: float, off_of: Callable[[Evidence, Array], Array], says: str
) -> Checker:
    name = f"{word}({within:g}, by={by:g})"
    above_zero(name, within=within)
    times(name, by=by)

    def check(evidence: Evidence) -> CheckResult:
        if not evidence.plan.pursues:
            return CheckResult(name, "vacuous", None, "nobody pursued a target")
        span = span_of(evidence, by, None)
        steered = evidence.arrays["reference"][:, :, 0]
        told = np.asarray(~np.isnan(steered).any(axis=-1))[span.start : span.stop]
        fewest = int(told.sum(axis=1).min(initial=told.shape[1]))
        if fewest < least:
            who = "nobody" if fewest == 0 else "one agent alone"
            return CheckResult(name, "vacuous", None, f"in some tick {who} said where it is")
        off = np.linalg.norm(off_of(evidence, steered)[span.start : span.stop], axis=-1)
        farthest = np.where(told, off, 0.0)

        def why(tick: int) -> str:
            row = farthest[tick - span.start]
            return f"agent {np.argmax(row) + 1} is {row.max():.4g} m {says}"

        return every(name, evidence, span, farthest.max(axis=1, initial=0.0) < within, why)

    return Checker(name, check)


def _target(evidence: Evidence) -> Array:
    """Where the target is, from each agent's place about it, shape (T, N, D), in metres."""
    target: Array = evidence.arrays["target"] - evidence.plan.world.formation.nominal
    return target
