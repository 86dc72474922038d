"""The verdict of a study on each of its claims."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from affinet.scenario.wrong import ScenarioError
from affinet.studies.quantities import Quantity, over_time, said
from affinet.studies.study import Claim, Result, Study, selected
from analysis.claims import checks, random_graphs
from analysis.claims.checks import ClaimVerdict
from analysis.models.arrays import Array

_GRAPHS = 1000  # random ones, for claims on all graphs


def graph_rates() -> Array:
    """Convergence rates on random graphs of ten agents, with the weighted centroid and with an anchor, shape (n, 2)."""
    return random_graphs.rates(_GRAPHS, 10, 0.49)


def judge(study: Study, results: list[Result]) -> list[ClaimVerdict]:
    """The verdict on each of its claims.

    Raises
    ------
    ScenarioError
        When a claim looks at what was not flown.
    """
    verdicts = []
    for claim in all_spelled_out(study):
        try:
            verdicts.append(_judge(claim, results, claim.quantity or study.quantity))
        except ValueError as error:
            raise ScenarioError(f"claim {claim.says!r}: {error}") from error
    return verdicts


def all_spelled_out(study: Study) -> Iterator[Claim]:
    """Every claim for each label of the axes it is for."""
    return itertools.chain.from_iterable(spelled_out(study, claim) for claim in study.claims)


def spelled_out(study: Study, claim: Claim) -> Iterator[Claim]:
    """A claim for each label of the axes it is for; what it says ends in its level, where a comma leaves room for it."""
    for where in claim.settings(study.axes):
        labels = list(where.values())
        other = None if claim.to is None else claim.to | where
        says, level = ", ".join(labels) + ": " * bool(labels) + claim.says, claim.level
        if claim.levels is not None:
            level = claim.levels[labels[0]]
            if says.endswith(","):
                says += f" {level:g} {said(claim.quantity or study.quantity)[1]}".rstrip()
        yield claim.model_copy(update={"says": says, "of": claim.of | where, "to": other, "level": level})


def _judge(claim: Claim, results: list[Result], quantity: Quantity) -> ClaimVerdict:
    chosen = [one for one in results if selected(one, claim.of)]
    if not chosen:
        raise ValueError(f"no case has the labels {claim.of}")
    span, unit = (claim.since, claim.until), said(quantity)[1]
    level, between = claim.level or 0.0, claim.between or []  # checks that want them have been given them

    def means(of: list[Result], what: Quantity = quantity) -> Array:
        return np.array([over_time(one.runs, what, span) for one in of])

    other = [one for one in results if selected(one, claim.to or {})]
    others, paired = claim.to_quantity or quantity, _paired([*chosen, *other])
    seconds = chosen[0].runs.seconds
    values = np.concatenate([one.runs.quantities[quantity] for one in chosen])
    match claim.check:
        case "flat":
            return checks.flat(claim.says, means(chosen), level, unit)
        case "approaches":
            return checks.approaches(claim.says, means(chosen), means(other), level)
        case "lower":
            compared = np.broadcast_to(means(other, others), (len(chosen), len(other[0].runs.mean_error)))
            return checks.lower(claim.says, means(chosen), compared, unit, paired=paired)
        case "ratio":
            (one,), (another,) = means(chosen), means(other, others)
            return checks.ratio(claim.says, one, another, between, paired=paired)
        case "stays_below":
            return checks.stays_below(claim.says, seconds, values, level, span, unit)
        case "leaves":
            return checks.leaves(claim.says, seconds, values, level, span, unit)
        case "exponential":
            return checks.exponential(claim.says, seconds, values, span)
        case "value":
            (one,) = means(chosen)
            return checks.value(claim.says, one, level, between, unit)
        case "slower_with_anchor":
            return checks.never_above(claim.says, *graph_rates().T)
        case "indicator_below_error":
            (one,) = chosen
            slope, offset = (each[..., one.followers] for each in one.runs.bounds)
            excess, bound = one.runs.psi[..., one.followers] - offset, slope * one.runs.quantities["error"][..., None]
            return checks.below_in_mean(claim.says, seconds, excess, bound, np.isfinite(slope))
        case "indicator_follows_error":
            (one,) = chosen
            psi, slope = one.runs.psi[..., one.followers], one.runs.bounds.slope[..., one.followers]
            return checks.follows(claim.says, seconds, psi, one.runs.quantities["error"], np.isfinite(slope), span)


def _paired(results: Sequence[Result]) -> bool:
    """Whether runs of the same number meet the same draws: of noise, disturbances, losses and a target, tick by tick."""
    flown = [one.plan.scenario for one in results]
    alike = ("seed", "formation", "sensing", "dynamics", "target")
    ticks = {one.time.dt for one in flown}
    return len(ticks) == 1 and all(getattr(one, name) == getattr(flown[0], name) for one in flown for name in alike)
