"""The hunt for the smallest fault that breaks an invariant: draw trials, fly them side by side, shrink what breaks."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from itertools import islice, product

from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.testing import shrinking
from affinet.testing.covered import Coverage
from affinet.testing.flights import Case, Each, Make, fly, in_order
from affinet.testing.menu import menu
from affinet.testing.reducing import Ground
from affinet.testing.trial import Deck, Settings, Trial
from affinet.verdicts.checking import CheckResult
from netem.processes.user_code import UserCodeError

_FIRST, _MOST = 8, 64  # trials that fly at once: few at first, as the first may break it; enough to keep processes busy
Watch = Callable[[Coverage, Trial | None], None]


@dataclass(frozen=True)
class Counterexample:
    """The smallest schedule that breaks an invariant.

    Parameters
    ----------
    number
        Of the invariant, from 0.
    scenario
        With settings, seed, and the schedule in its timeline.
    finding
        How it breaks.
    digest
        Of the run in process.
    trial
        What it is.
    """

    number: int
    scenario: Scenario
    finding: CheckResult
    digest: str
    trial: Trial


@dataclass
class Hunted:
    """What a hunt came to.

    Parameters
    ----------
    found
        The smallest for each invariant that broke, in the order of the invariants.
    coverage
        What was tried.
    worth
        Trials worth keeping for the next hunt: what each broke, by the names of invariants; nothing of those that covered
        something new.
    """

    found: list[Counterexample] = field(default_factory=list)
    coverage: Coverage = field(default_factory=Coverage)
    worth: list[tuple[Trial, tuple[str, ...]]] = field(default_factory=list)


@dataclass(frozen=True)
class Quarry:
    """What is hunted, and where.

    Parameters
    ----------
    make
        Makes the invariants that must not fail.
    scenarios
        By the settings that make them; the first is the plainest.
    seeds
        Of the runs; the first is the plainest.
    verbs
        Of the faults to draw from.
    beyond
        Settings that trials of a corpus have, and none that are drawn.
    """

    make: Make
    scenarios: Mapping[Settings, Scenario]
    seeds: Sequence[int]
    verbs: Sequence[str]
    beyond: Mapping[Settings, Scenario] = field(default_factory=dict)

    def case(self, trial: Trial) -> Case:
        """A trial in its scenario."""
        return Case({**self.scenarios, **self.beyond}[trial.settings], trial)


def hunt(quarry: Quarry, *, budget: int, seed: int, watch: Watch, each: Each, corpus: Sequence[Trial] = ()) -> Hunted:
    """The smallest schedule of faults found that breaks each invariant, where one was, and what was tried.

    Parameters
    ----------
    quarry
        What is hunted, and where.
    budget
        Trials to draw before giving up; shrinking takes more.
    seed
        Of the draws.
    watch
        Called after each flight of a trial that was drawn, and with what broke something, or is smaller.
    each
        Flies chunks of trials, in this process or in others.
    corpus
        Trials that are flown first.

    Raises
    ------
    ScenarioError
        When an invariant fails with no fault added.
    UserCodeError
        When a user's own estimator or law does something wrong, under the smallest schedule found that makes it do so.
    """
    refuse_failing_undisturbed(quarry, each)
    menus = {settings: menu(given, quarry.verbs) for settings, given in quarry.scenarios.items()}
    drawn = Deck(quarry.scenarios, quarry.seeds, menus).drawn(seed, budget)
    hunted, broken = _flown(quarry, [*_chunks(iter(corpus)), *_chunks(drawn)], each, watch)
    for number, trial in broken.items():
        hunted.found.append(_smallest(quarry, number, trial, hunted, watch))
    return hunted


def refuse_failing_undisturbed(quarry: Quarry, each: Each) -> None:
    """Go on if no invariant fails with no fault added, in any setting and with any seed.

    Raises
    ------
    ScenarioError
        When one does.
    """
    pairs = [*product(quarry.scenarios, quarry.seeds)]
    for (settings, seed), finding in zip(pairs, failing_undisturbed(quarry, pairs, each), strict=True):
        if finding is not None:
            where = "".join(f", with {words}" for words in settings) + (f", seed {seed}" if len(pairs) > 1 else "")
            raise ScenarioError(f"{finding}; it fails with no fault at all{where}, and there is nothing to hunt for")


def failing_undisturbed(quarry: Quarry, pairs: Sequence[tuple[Settings, int]], each: Each) -> list[CheckResult | None]:
    """What fails with no fault added, with each of these settings and seeds; None where nothing does.

    Raises
    ------
    UserCodeError, ScenarioError, PlanError
        When one of them cannot fly.
    """
    bare = [Trial(settings, seed, ()) for settings, seed in pairs]
    chunks = [[quarry.case(trial) for trial in chunk] for chunk in _chunks(iter(bare))]
    with closing(each(partial(fly, quarry.make), chunks)) as found:
        flown = [one for made in in_order(found) for one in made]
    for trial, one in zip(bare, flown, strict=True):
        if one is None or one.raised:  # by itself it says what is wrong
            rehearse(planning.make(trial.in_scenario(quarry.case(trial).given)))
    findings = [one.findings if one else () for one in flown]
    return [next((finding for finding in some if finding.verdict == "fail"), None) for some in findings]


def _chunks(trials: Iterator[Trial]) -> Iterator[list[Trial]]:
    """Few trials at first, then more."""
    size = _FIRST
    while some := [*islice(trials, size)]:
        yield some
        size = min(2 * size, _MOST)


def _flown(
    quarry: Quarry, chunks: Sequence[Sequence[Trial]], each: Each, watch: Watch
) -> tuple[Hunted, dict[int, Trial]]:
    """Fly trials until every invariant is broken: the first that breaks each, by its number."""
    invariants = quarry.make()
    hunted, broken = Hunted(), dict[int, Trial]()
    cases = [[quarry.case(trial) for trial in chunk] for chunk in chunks]
    with closing(each(partial(fly, quarry.make), cases)) as found:
        for chunk, flown in zip(chunks, in_order(found), strict=True):
            for trial, one in zip(chunk, flown, strict=True):
                if one is None:
                    hunted.coverage.unfit += 1
                    continue
                new = hunted.coverage.add(one.covered, vacuous=one.untold)
                those = [number for number in range(len(invariants)) if one.breaks(number)]
                if new or those:
                    hunted.worth.append((trial, tuple(invariants[number].name for number in those)))
                watch(hunted.coverage, trial if set(those) - broken.keys() else None)
                broken |= {number: trial for number in those if number not in broken}
                if len(broken) == len(invariants):
                    return hunted, dict(sorted(broken.items()))
    return hunted, dict(sorted(broken.items()))


def _smallest(quarry: Quarry, number: int, trial: Trial, hunted: Hunted, watch: Watch) -> Counterexample:
    coverage = hunted.coverage

    def breaks(trials: Sequence[Trial]) -> list[bool]:
        flown = fly(quarry.make, [quarry.case(one) for one in trials])
        coverage.shrinking += sum(one is not None for one in flown)
        watch(coverage, None)
        return [one is not None and one.breaks(number) for one in flown]

    ground = Ground({**quarry.scenarios, **quarry.beyond}, quarry.seeds)
    found = shrinking.smallest(trial, ground, breaks, lambda smaller: watch(coverage, smaller))
    invariant = quarry.make()[number]
    hunted.worth.append((found, (invariant.name,)))
    broken = found.in_scenario(quarry.case(found).given)
    try:
        evidence = rehearse(planning.make(broken))
    except UserCodeError as error:
        error.during = f"with the timeline {json.dumps(found.entries)}"
        raise
    return Counterexample(number, broken, invariant(evidence), str(evidence.outcome.digest), found)
