"""The hunt for the smallest fault that breaks an invariant: draw schedules, fly them in process, shrink what fails."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

from hypothesis import HealthCheck, Phase, find, reject, settings
from hypothesis.errors import NoSuchExample

from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.loading import extended
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.testing import strategies
from affinet.testing.strategies import Entries
from affinet.verdicts.checking import Checker, CheckResult
from affinet.verdicts.evidence import Evidence
from netem.processes.user_code import UserCodeError


@dataclass
class Coverage:
    """What a hunt has tried.

    Parameters
    ----------
    schedules
        How many were flown.
    verbs, selectors
        How often each verb, and each kind of selector, was among them.
    vacuous
        How many could not tell: a fault touched nothing, or the invariant was not put to the test.
    """

    schedules: int = 0
    verbs: Counter[str] = field(default_factory=Counter)
    selectors: Counter[str] = field(default_factory=Counter)
    vacuous: int = 0

    def add(self, entries: Entries) -> None:
        """Count a schedule."""
        self.schedules += 1
        self.verbs.update(entry["verb"] for entry in entries)
        self.selectors.update(_kind(word) for entry in entries for word in _words(entry))


@dataclass(frozen=True)
class Counterexample:
    """The smallest schedule that breaks an invariant.

    Parameters
    ----------
    scenario
        With the schedule in its timeline.
    finding
        How it breaks.
    digest
        Of the run in process.
    """

    scenario: Scenario
    finding: CheckResult
    digest: str


def hunt(
    given: Scenario,
    invariant: Checker,
    *,
    budget: int,
    verbs: Sequence[str],
    seed: int,
    watch: Callable[[Coverage, Entries | None], None],
) -> tuple[Counterexample | None, Coverage]:
    """The smallest schedule of faults found that breaks an invariant, if one was, and what was tried.

    Parameters
    ----------
    given
        The scenario to which the faults are added.
    invariant
        What must not fail.
    budget
        Schedules to draw before giving up; shrinking takes more.
    verbs
        Of the faults to draw from.
    seed
        Of the draws.
    watch
        Called after each flight, with the schedule if it broke the invariant.

    Raises
    ------
    ScenarioError
        When the invariant fails with no fault added.
    UserCodeError
        When a user's own estimator or law does something wrong, under the smallest schedule found that makes it do so.
    """
    undisturbed = invariant(_flown(given))
    if undisturbed.verdict == "fail":
        raise ScenarioError(f"{undisturbed}; it fails with no fault at all, and there is nothing to hunt for")
    coverage, known = Coverage(), dict[str, bool | None]()

    def breaks(faults: list[Entries]) -> bool | None:
        entries = [entry for fault in faults for entry in fault]
        key = json.dumps(entries)
        if key not in known:
            known[key] = _breaks(given, invariant, entries, coverage)
            watch(coverage, entries if known[key] else None)
        return known[key]

    def breaks_or_is_none(faults: list[Entries]) -> bool:
        answer = breaks(faults)
        return reject() if answer is None else answer

    patient = settings(
        max_examples=budget,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate, Phase.shrink],
    )
    try:
        found = find(strategies.timelines(given, verbs), breaks_or_is_none, settings=patient, random=Random(seed))
    except NoSuchExample:
        return None, coverage
    smallest = _without_the_needless(found, breaks)
    entries = [entry for fault in smallest for entry in fault]
    broken = extended(given, entries)
    try:
        evidence = _flown(broken)
    except UserCodeError as error:
        error.during = f"with the timeline {json.dumps(entries)}"
        raise
    return Counterexample(broken, invariant(evidence), str(evidence.outcome.digest)), coverage


def _without_the_needless(faults: list[Entries], breaks: Callable[[list[Entries]], bool | None]) -> list[Entries]:
    """The faults without which it would not break; Hypothesis leaves some before the last that it cannot delete."""
    for place in range(len(faults) - 1, -1, -1):
        fewer = faults[:place] + faults[place + 1 :]
        if fewer and breaks(fewer):
            faults = fewer
    return faults


def _breaks(given: Scenario, invariant: Checker, entries: Entries, coverage: Coverage) -> bool | None:
    """Whether a schedule breaks it; None where it is no schedule of this scenario: a selector matches nothing."""
    try:
        evidence = _flown(extended(given, entries))
    except (ScenarioError, PlanError):
        return None
    except UserCodeError:
        coverage.add(entries)
        return True
    coverage.add(entries)
    found = invariant(evidence).verdict
    untold = evidence.outcome.verdict == "vacuous" or found == "vacuous"
    coverage.vacuous += untold
    return found == "fail" and not untold


def _flown(given: Scenario) -> Evidence:
    return rehearse(planning.make(given))


def _words(entry: dict[str, object]) -> list[object]:
    chosen = entry.get("links") or entry.get("agents") or [entry.get("groups")]
    return list(chosen) if isinstance(chosen, list) else [chosen]


def _kind(word: object) -> str:
    text = str(word)
    if text.isdecimal():
        return "agent"
    if text.replace("->", "").isdecimal():
        return "one-way link"
    return "edge" if text.replace("-", "").isdecimal() else text
