"""Planted runs of which a known share passes: what is decided of them, and whether the interval has the share."""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from analysis.claims.intervals import Decision, Interval
from analysis.claims.sequential import Look, found, looks

EXPERIMENTS, MOST, ASKED, CONFIDENCE = 1000, 200, 0.95, 0.95
TRUE = (0.5, 0.8, 0.9, 0.93, 0.95, 0.97, 0.99, 1.0)


class Rates(NamedTuple):
    """Of a true share: how often it holds and does not, how often the interval has it, and after how many runs one stops."""

    holds: float
    fails: float
    covered: float
    runs: float


def stopped(passes: np.ndarray, planned: list[Look], share: float) -> tuple[Decision, Interval, int]:
    """What is decided of runs that pass so, the interval at which it stops, and after how many runs."""
    for look in planned:
        interval = found(int(passes[: look.runs].sum()), look.runs, look)
        if (decision := interval.decide(least=share)) is not Decision.UNDECIDED:
            break
    return decision, interval, look.runs


@cache
def rates() -> dict[float, Rates]:
    """Of each true share, in so many experiments."""
    rng, planned, of = np.random.default_rng(20), looks(MOST, CONFIDENCE), {}
    for share in TRUE:
        results = [stopped(passes, planned, ASKED) for passes in rng.random((EXPERIMENTS, MOST)) < share]
        decisions = [decision for decision, _, _ in results]
        of[share] = Rates(
            decisions.count(Decision.HOLDS) / EXPERIMENTS,
            decisions.count(Decision.DOES_NOT_HOLD) / EXPERIMENTS,
            sum(interval.low <= share <= interval.high for _, interval, _ in results) / EXPERIMENTS,
            sum(runs for _, _, runs in results) / EXPERIMENTS,
        )
    return of


def table() -> Iterator[str]:
    """The lines of docs/accuracy.md."""
    yield "| true share | holds | undecided | fails | the interval has it | runs, in the mean |"
    yield "|---|---|---|---|---|---|"
    for share, of in rates().items():
        undecided = 1.0 - of.holds - of.fails
        shares = " | ".join(f"{100 * each:.1f} %" for each in (of.holds, undecided, of.fails, of.covered))
        yield f"| {100 * share:g} % | {shares} | {of.runs:.0f} |"
