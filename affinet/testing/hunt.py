"""The hunt for the smallest fault that breaks an invariant: draw schedules, fly them in process, shrink what fails."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

from hypothesis import HealthCheck, Phase, find, reject, settings
from hypothesis.errors import NoSuchExample
from hypothesis.strategies import SearchStrategy

from affinet.planning import making as planning
from affinet.planning.plan import Plan, PlanError
from affinet.runtimes.rehearsing import rehearse, rehearse_all
from affinet.scenario.loading import extended
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.testing import strategies
from affinet.testing.strategies import Entries
from affinet.verdicts.checking import Checker, CheckResult
from affinet.verdicts.evidence import Evidence
from netem.processes.user_code import UserCodeError

_FIRST, _MOST = 8, 64  # schedules that fly at once: few at first, as the first may break it


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
    tried = _Tried(given, invariant, watch)
    drawn = strategies.timelines(given, verbs)
    # What is drawn depends on nothing but what is no schedule, until one breaks it: all fly side by side before.
    ahead = list[Entries]()
    _found(drawn, lambda faults: tried.plans(faults, ahead), budget, seed)
    tried.fly(ahead)
    found = _found(drawn, tried.breaks, budget, seed)
    if found is None:
        return None, tried.coverage
    smallest = _without_the_needless(found, tried.breaks)
    entries, coverage = _entries(smallest), tried.coverage
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


def _found(
    drawn: SearchStrategy[list[Entries]],
    breaks: Callable[[list[Entries]], bool | None],
    budget: int,
    seed: int,
) -> list[Entries] | None:
    """The smallest of those drawn that breaks something, if one does; None of what is no schedule."""
    patient = settings(
        max_examples=budget,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
        phases=[Phase.generate, Phase.shrink],
    )

    def breaks_or_is_none(faults: list[Entries]) -> bool:
        answer = breaks(faults)
        return reject() if answer is None else answer

    try:
        return find(drawn, breaks_or_is_none, settings=patient, random=Random(seed))
    except NoSuchExample:
        return None


@dataclass
class _Tried:
    """The schedules that have flown, and whether they break the invariant; None of one that is no schedule."""

    given: Scenario
    invariant: Checker
    watch: Callable[[Coverage, Entries | None], None]
    coverage: Coverage = field(default_factory=Coverage)
    known: dict[str, bool | None] = field(default_factory=dict)
    planned: dict[str, Plan | None] = field(default_factory=dict)

    def plans(self, faults: list[Entries], ahead: list[Entries]) -> bool | None:
        """Plan a schedule, which is to fly later with others: as if it broke nothing."""
        entries = _entries(faults)
        key = json.dumps(entries)
        if key not in self.planned:
            self.planned[key] = _plan(self.given, entries)
            ahead.append(entries)
        return None if self.planned[key] is None else False

    def fly(self, ahead: Sequence[Entries]) -> None:
        """Fly them side by side, up to the first that breaks it."""
        first, size = 0, _FIRST
        while first < len(ahead):
            some = [entries for entries in ahead[first : first + size] if self.planned[json.dumps(entries)]]
            first, size = first + size, min(2 * size, _MOST)
            plans = [plan for entries in some if (plan := self.planned[json.dumps(entries)]) is not None]
            try:
                flown = rehearse_all(plans)
            except UserCodeError:  # under which of them is found one by one
                return
            for entries, evidence in zip(some, flown, strict=True):
                if self._judged(entries, evidence):
                    return

    def breaks(self, faults: list[Entries]) -> bool | None:
        """Whether a schedule breaks it; None where it is no schedule of this scenario: a selector matches nothing."""
        entries = _entries(faults)
        key = json.dumps(entries)
        if key not in self.known:
            plan = self.planned[key] if key in self.planned else _plan(self.given, entries)
            if plan is None:
                self.known[key] = None
                return None
            try:
                self._judged(entries, rehearse(plan))
            except UserCodeError:
                self._told(entries, breaks=True)
        return self.known[key]

    def _judged(self, entries: Entries, evidence: Evidence) -> bool:
        found = self.invariant(evidence).verdict
        untold = evidence.outcome.verdict == "vacuous" or found == "vacuous"
        self.coverage.vacuous += untold
        return self._told(entries, breaks=found == "fail" and not untold)

    def _told(self, entries: Entries, *, breaks: bool) -> bool:
        self.known[json.dumps(entries)] = breaks
        self.coverage.add(entries)
        self.watch(self.coverage, entries if breaks else None)
        return breaks


def _entries(faults: list[Entries]) -> Entries:
    return [entry for fault in faults for entry in fault]


def _plan(given: Scenario, entries: Entries) -> Plan | None:
    try:
        return planning.make(extended(given, entries))
    except (ScenarioError, PlanError):
        return None


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
