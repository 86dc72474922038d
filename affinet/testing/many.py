"""A run as a test builds it, flown with many seeds: which share of its runs pass, and how sure one may be of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.scenario.sections import Scenario
from affinet.verdicts.checkers import summed_up
from affinet.verdicts.checking import Checker, CheckResult, as_checker
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.flown import Broken
from analysis.claims import sequential
from analysis.claims.intervals import Decision, Interval
from analysis.claims.sequential import Look
from netem.core.plain import shown
from netem.processes.user_code import UserCodeError

SeedsVerdict = Literal["holds", "fails", "undecided", "vacuous"]

_AT_ONCE = 50
_MOST = 2**64  # seeds are below
_DECIDED: dict[Decision, SeedsVerdict | None] = {
    Decision.HOLDS: "holds",
    Decision.DOES_NOT_HOLD: "fails",
    Decision.UNDECIDED: None,
}
_NAMED = 10  # seeds in a line, where there may be thousands


@dataclass(frozen=True)
class FailedSeed:
    """A run that does not pass.

    Parameters
    ----------
    seed
        Of its draws.
    says
        What failed, and why.
    at
        When, in seconds, where a checker names a tick.
    worst
        Its largest tracking error, in square metres; infinite where it left the numbers.
    """

    seed: int
    says: str
    at: float | None
    worst: float


@dataclass(frozen=True)
class OverSeeds:
    """What became of the runs of many seeds.

    Parameters
    ----------
    name
        Of what was checked.
    verdict
        Holds, fails, is undecided, or vacuous.
    asked
        The share of the runs that has to pass; None where all of them have to.
    confidence
        Of the interval.
    share
        Of the runs that told anything, those that pass, with the interval.
    passed, failed, vacuous
        The seeds of those that passed, which failed, and the seeds of those that put nothing to the test.
    most
        How many there are: it may have been decided before all had flown.
    """

    name: str
    verdict: SeedsVerdict
    asked: float | None
    confidence: float
    share: Interval
    passed: tuple[int, ...]
    failed: tuple[FailedSeed, ...]
    vacuous: tuple[int, ...]
    most: int

    @property
    def flown(self) -> int:
        """How many runs were flown."""
        return len(self.passed) + len(self.failed) + len(self.vacuous)

    @property
    def worst(self) -> FailedSeed | None:
        """Of those that failed, the one with the largest error."""
        return max(self.failed, key=lambda one: one.worst, default=None)

    def __str__(self) -> str:
        told, early = len(self.passed) + len(self.failed), self.flown < self.most
        low, high = (f"{100 * end:.4g}" for end in (self.share.low, self.share.high))
        wanted = "all have to" if self.asked is None else f"{100 * self.asked:g} % have to"
        says = [
            f"{self.name}: {self.verdict}: {len(self.passed)} of {told} runs pass, {low} to {high} % "
            f"with {100 * self.confidence:g} % confidence, and {wanted}",
            *([f"decided after {self.flown} of {self.most} runs"] if early else []),
            *([f"{len(self.vacuous)} runs put nothing to the test: {_seeds(self.vacuous)}"] if self.vacuous else []),
            *([f"those that fail: {_seeds([one.seed for one in self.failed])}"] if self.failed else []),
            *([f"the worst, seed {self.worst.seed}: {self.worst.says}"] if self.worst else []),
        ]
        return "\n  ".join(says)


class FlownSeeds:
    """The runs of a swarm with many seeds; they fly as something is asked of them, and no more of them than it takes.

    Parameters
    ----------
    scenario
        What is flown.
    seeds
        Of the draws of each run.
    launch
        Flies plans, and returns what came of each.
    """

    def __init__(
        self, scenario: Scenario, seeds: Sequence[int], launch: Callable[[Sequence[Plan]], Sequence[Evidence]]
    ) -> None:
        self._scenario, self._seeds, self._launch = scenario, seeds, launch
        self.asked: list[OverSeeds] = []

    def check(
        self,
        *checkers: Callable[[Evidence], CheckResult],
        share: float | None = None,
        confidence: float = 0.95,
    ) -> OverSeeds:
        """What becomes of the runs, if enough of them pass: the run itself, and every checker.

        It is looked at after an eighth, a quarter and half of the runs, and at the end; it stops where it is decided. The
        interval is exact (Clopper and Pearson), and holds the true share with the confidence, whenever it stops.

        Parameters
        ----------
        checkers
            Each a `Checker`, or a function that is to be one under its own name.
        share
            Of the runs that put it to the test, those that have to pass, above 0 and below 1; None asks it of every run, and
            stops at the first that fails.
        confidence
            With which the interval at which it stops holds the true share.

        Raises
        ------
        Broken
            When it does not hold, or cannot be decided: how many pass, and which seeds fail.
        UserCodeError
            When an estimator, a law or a checker does something wrong.
        TypeError, ValueError
            When a checker, the share or the confidence is none.
        """
        __tracebackhide__ = True
        _refuse(share, confidence)
        result = self._result([as_checker(one) for one in checkers], share, confidence)
        self.asked.append(result)
        if result.verdict != "holds":
            raise Broken(str(result))
        return result

    def _result(self, checkers: Sequence[Checker], share: float | None, confidence: float) -> OverSeeds:
        tally, looks = _Tally(), sequential.looks(len(self._seeds), confidence)
        for flown, look in zip([0, *(look.runs for look in looks)], looks, strict=False):
            for first in range(flown, look.runs, _AT_ONCE):
                for run in self._flown(self._seeds[first : min(first + _AT_ONCE, look.runs)]):
                    tally.add(run, [one(run) for one in checkers])
            verdict, interval = tally.judged(share, look, last=look is looks[-1])
            if verdict is not None:
                break
        return OverSeeds(
            name=", ".join(one.name for one in checkers) or "the run itself",
            verdict=verdict or "undecided",
            asked=share,
            confidence=confidence,
            share=interval,
            passed=tuple(tally.passed),
            failed=tuple(tally.failed),
            vacuous=tuple(tally.vacuous),
            most=len(self._seeds),
        )

    def plan(self, seed: int) -> Plan:
        """That of the run of a seed."""
        return planning.make(self._scenario.model_copy(update={"seed": seed}))

    def _flown(self, seeds: Sequence[int]) -> Sequence[Evidence]:
        plans = [self.plan(seed) for seed in seeds]
        try:
            return self._launch(plans)
        except UserCodeError:  # of which seed is told by one after the other
            for plan in plans:
                _alone(self._launch, plan)
            raise


def _alone(launch: Callable[[Sequence[Plan]], Sequence[Evidence]], plan: Plan) -> None:
    try:
        launch([plan])
    except UserCodeError as error:
        raise Broken(f"seed {plan.scenario.seed}: {error}") from error


@dataclass
class _Tally:
    """What runs came to so far."""

    passed: list[int] = field(default_factory=list)
    failed: list[FailedSeed] = field(default_factory=list)
    vacuous: list[int] = field(default_factory=list)

    def add(self, run: Evidence, findings: Sequence[CheckResult]) -> None:
        """Count a run, with what checkers found in it."""
        seed, verdict = run.plan.scenario.seed, summed_up(run, findings)
        if verdict == "fail":
            self.failed.append(FailedSeed(seed, _why(run, findings), _when(run, findings), _worst(run)))
        elif verdict == "vacuous":
            self.vacuous.append(seed)
        else:
            self.passed.append(seed)

    def judged(self, share: float | None, look: Look, *, last: bool) -> tuple[SeedsVerdict | None, Interval]:
        """What is decided at a look, or None where it has to be looked at again; and the share of those that pass."""
        told = len(self.passed) + len(self.failed)
        interval = sequential.found(len(self.passed), told, look)
        if not told:
            return "vacuous" if last else None, interval
        if share is None:
            return "fails" if self.failed else "holds" if last else None, interval
        return _DECIDED[interval.decide(least=share)], interval


def seeds_of(first: int, given: int | Sequence[int]) -> Sequence[int]:
    """So many seeds from the first on, or those that are given.

    Raises
    ------
    ValueError, TypeError
        When these are none.
    """
    if isinstance(given, int) and not isinstance(given, bool):
        if not 1 <= given <= _MOST - first:
            raise ValueError(f"seeds={given}: give how many runs, at least 1, or the seeds themselves")
        return range(first, first + given)
    if not isinstance(given, Sequence):
        raise TypeError(f"seeds is {shown(given)}: give how many runs, or the seeds themselves")
    if odd := [seed for seed in given if type(seed) is not int or not 0 <= seed < _MOST]:
        raise ValueError(f"seeds: {shown(odd[0])} is none: give different whole numbers from 0 to 2**64 - 1")
    if not given or len(set(given)) < len(given):
        raise ValueError("seeds: give different whole numbers, at least one")
    return tuple(given)


def _why(run: Evidence, findings: Sequence[CheckResult]) -> str:
    wrong = [str(finding) for finding in findings if finding.verdict == "fail"]
    return "; ".join(wrong or run.outcome.reasons)


def _when(run: Evidence, findings: Sequence[CheckResult]) -> float | None:
    ticks = [finding.tick for finding in findings if finding.verdict == "fail" and finding.tick is not None]
    return min(ticks) * run.dt if ticks else None


def _worst(run: Evidence) -> float:
    error = run.error
    return float(error.max(initial=0.0)) if np.isfinite(error).all() else np.inf


def _seeds(seeds: Sequence[int]) -> str:
    more = f", and {len(seeds) - _NAMED} more" if len(seeds) > _NAMED else ""
    return ", ".join(map(str, seeds[:_NAMED])) + more


def _refuse(share: float | None, confidence: float) -> None:
    for name, value in (("share", share), ("confidence", confidence)):
        if value is not None and not 0.0 < value < 1.0:
            raise ValueError(f"{name} is {value!r}: give a number between 0 and 1, like 0.95")
