"""Trials flown side by side, in this process: what invariants find in each, and what it covers."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

from affinet.planning import making as planning
from affinet.planning.plan import Plan, PlanError
from affinet.runtimes.rehearsing import rehearse, rehearse_all
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.testing import covered
from affinet.testing.covered import Item
from affinet.testing.trial import Trial
from affinet.verdicts import invariants
from affinet.verdicts.checking import Checker, CheckResult
from affinet.verdicts.evidence import Evidence
from netem.processes.user_code import UserCodeError

Make = Callable[[], Sequence[Checker]]  # checkers cannot be pickled: each process makes its own


class Case(NamedTuple):
    """A trial, in the scenario that has its settings."""

    given: Scenario
    trial: Trial


@dataclass(frozen=True)
class Flown:
    """What came of a trial.

    Parameters
    ----------
    findings
        Of each invariant; of none where a user's own code did something wrong.
    vacuous
        Whether a fault touched nothing.
    digest
        Of the run.
    covered
        What it covers.
    """

    findings: tuple[CheckResult, ...]
    vacuous: bool
    digest: str
    covered: frozenset[Item]

    @property
    def raised(self) -> bool:
        """Whether a user's own code did something wrong."""
        return not self.findings

    def breaks(self, number: int) -> bool:
        """Whether it breaks the invariant of this number."""
        return self.raised or (not self.vacuous and self.findings[number].verdict == "fail")

    @property
    def untold(self) -> bool:
        """Whether it could not tell: something was vacuous."""
        return self.vacuous or any(finding.verdict == "vacuous" for finding in self.findings)


Chunk = Sequence[Case]
Made = list[Flown | None]
Work = Callable[[Chunk], Made]
Each = Callable[[Work, Sequence[Chunk]], Generator[tuple[int, Made], None, None]]


def in_this_process(work: Work, chunks: Sequence[Chunk]) -> Generator[tuple[int, Made], None, None]:
    """What comes of each chunk with its number, one after the other."""
    for number, chunk in enumerate(chunks):
        yield number, work(chunk)


def said(texts: Sequence[str]) -> Make:
    """What makes the checkers that these texts say, in whatever process.

    Raises
    ------
    ScenarioError
        When one says none.
    """
    made = partial(_parsed, tuple(texts))
    made()
    return made


def fly(make: Make, cases: Chunk) -> Made:
    """Fly trials; None of those that are no schedule of their scenario, like a selector that matches nothing."""
    checkers = make()
    plans = [_plan(case) for case in cases]
    there = [plan for plan in plans if plan is not None]
    evidence = iter(_flown(there))
    return [
        None if plan is None else _judged(case.trial, plan, next(evidence), checkers)
        for case, plan in zip(cases, plans, strict=True)
    ]


def in_order(found: Iterable[tuple[int, Made]]) -> Generator[Made, None, None]:
    """What came of chunks, in the order of their numbers, as soon as those before are there."""
    waiting: dict[int, Made] = {}
    due = 0
    for number, flown in found:
        waiting[number] = flown
        while due in waiting:
            yield waiting.pop(due)
            due += 1


def _parsed(texts: Sequence[str]) -> list[Checker]:
    return [invariants.parse(text) for text in texts]


def _plan(case: Case) -> Plan | None:
    try:
        return planning.make(case.trial.in_scenario(case.given))
    except (ScenarioError, PlanError):
        return None


def _flown(plans: Sequence[Plan]) -> list[Evidence | None]:
    """The runs; None of one in which a user's own code does something wrong."""
    try:
        return [*rehearse_all(plans)]
    except UserCodeError:
        return [_alone(plan) for plan in plans]


def _alone(plan: Plan) -> Evidence | None:
    try:
        return rehearse(plan)
    except UserCodeError:
        return None


def _judged(trial: Trial, plan: Plan, evidence: Evidence | None, checkers: Sequence[Checker]) -> Flown:
    items = covered.of(trial, plan)
    if evidence is None:
        return Flown((), False, "", items)
    findings = tuple(checker(evidence) for checker in checkers)
    return Flown(findings, evidence.outcome.verdict == "vacuous", str(evidence.outcome.digest), items)
