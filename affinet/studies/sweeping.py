"""A scenario over settings and seeds, without a study file: a figure of each run, and what the runs came to.

Runs fly side by side in this process, as those of studies do; what cannot flies one by one, and it is said why.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.planning.programs import refuse_in_process
from affinet.runtimes.rehearsing import rehearse_all, why_alone
from affinet.scenario import overrides, source
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from affinet.studies import pool, study
from affinet.studies.executor import Executor, Here
from affinet.studies.study import Case
from affinet.verdicts.checkers import summed_up
from affinet.verdicts.checking import Checker
from affinet.verdicts.evidence import Evidence
from analysis.claims import intervals
from analysis.claims.intervals import Interval
from analysis.models.arrays import Array

CONFIDENCE = 0.95
_WORTH_PROCESSES = 50_000  # ticks of runs, below which starting them takes longer
_LOOKED_AT = 100  # runs of which all is kept at once

Load = Callable[[Sequence[str]], Scenario]
Labelled = tuple[Mapping[str, str], Plan]
# What the summary of a run calls a quantity.
_FIGURES = {"localization": "localization_error", "agreed": "target_error"}


class NotPassed(NamedTuple):
    """A run that came to another verdict than a pass: its seed, the verdict, and why."""

    seed: int
    verdict: str
    says: str


@dataclass(frozen=True)
class Setting:
    """What came of the runs of one setting.

    Parameters
    ----------
    labels
        Its value of each key that is varied.
    quantity
        What `values` are of, by its name in studies.
    values
        Its mean over each run, shape (R,).
    verdicts
        How many runs came to each verdict.
    first
        The first run that did not pass, if one did not.
    alone
        Why its runs flew one by one; None of those that flew side by side, or of a single one.
    """

    labels: Mapping[str, str]
    quantity: str
    values: Array
    verdicts: Counter[str]
    first: NotPassed | None
    alone: str | None

    @property
    def mean(self) -> Interval:
        """Over the runs, with its interval by Student's t."""
        return intervals.mean(self.values, confidence=CONFIDENCE)


def values_of(sweep: str) -> tuple[str, list[str]]:
    """A key and its values, as in `network.availability=0.2,0.5,1`; commas within brackets or quotes part none.

    Raises
    ------
    ScenarioError
        When it says none.
    """
    key, _, text = sweep.partition("=")
    values = [value.strip() for value in _parts(text)]
    if not key.strip() or not all(values):
        raise ScenarioError(f"--sweep {sweep}: write it as key=value,value, like network.availability=0.2,0.5,1")
    said = [one.value for one in overrides.read([f"{key}={value}" for value in values])]
    for number, value in enumerate(said):
        if value in said[:number]:
            raise ScenarioError(f"--sweep {sweep}: {values[number]} stands there twice")
    return key.strip(), values


def refuse_twice(sweeps: Sequence[str], fixed: Sequence[str]) -> None:
    """Go on if each key is said once, by what is swept or by what is the same in all runs.

    Parameters
    ----------
    sweeps, fixed
        Texts like `key=value,value`, and overrides.

    Raises
    ------
    ScenarioError
        When one would be dropped for another, or seeds are swept, which runs of a setting have of their own.
    """
    swept = [".".join(source.parts(sweep.partition("=")[0])).strip() for sweep in sweeps]
    if "seed" in swept:
        raise ScenarioError("--sweep seed: the seeds of runs are given by --seeds, like --seeds 1-50")
    for number, key in enumerate(swept):
        if key in swept[:number]:
            raise ScenarioError(f"--sweep {key}: it is swept twice; give all its values at once")
    for one in overrides.read(fixed):
        if one.key in swept:
            raise ScenarioError(f"--sweep {one.key}: {one.says} is given as well; leave one of them out")


def planned(load: Load, sweeps: Sequence[tuple[str, list[str]]], seed: int | None) -> list[Labelled]:
    """Every combination of settings, with its plan; whatever cannot fly is found before any has flown.

    Parameters
    ----------
    load
        Reads the scenario with overrides.
    sweeps
        Keys with their values.
    seed
        The first; None is that of the scenario.

    Raises
    ------
    ScenarioError, PlanError
        When one of them cannot fly, or not in this process.
    """
    first = [] if seed is None else [f"seed={seed}"]
    plans = list[Labelled]()
    for values in itertools.product(*(values for _, values in sweeps)):
        labels = dict(zip((key for key, _ in sweeps), values, strict=True))
        plan = planning.make(load([*first, *(f"{key}={value}" for key, value in labels.items())]))
        refuse_in_process(plan)
        plans.append((labels, plan))
    return plans


def fly(
    plans: Sequence[Labelled],
    runs: int,
    checker: Checker | None,
    load: Load,
    watch: Callable[[float], None],
) -> list[Setting]:
    """So many runs of each setting, with successive seeds.

    Parameters
    ----------
    plans, runs
        The settings, and how many runs of each.
    checker
        What else must hold of each run.
    load
        Reads the scenario with overrides.
    watch
        Told how many settings are done, and which share of others.

    Raises
    ------
    UserCodeError
        When a user's own code does something wrong.
    """
    found: dict[int, Setting] = {}
    together = [number for number, (_, plan) in enumerate(plans) if runs > 1 and _enough(plan, checker)]
    cases = [(Case(dict(plans[number][0]), ()), plans[number][1]) for number in together]
    if cases:
        flown = study.fly(cases, runs, _executor(cases, runs), watch=lambda shares: watch(sum(shares)))
        for number, result in zip(together, flown, strict=True):
            found[number] = _of_runs(result)
            watch(len(found))
    for number, (labels, plan) in enumerate(plans):
        if number not in found:
            whole = _told(_looked_at(labels, plan, runs, load), len(found), runs, watch)
            found[number] = _of_evidence(labels, plan, whole, checker, why_alone(plan) if runs > 1 else None)
    return [found[number] for number in range(len(plans))]


def _enough(plan: Plan, checker: Checker | None) -> bool:
    """Whether what studies keep of a run is all that is asked of it: not what a fault touched, and what a check looks at."""
    return checker is None and not plan.faults and why_alone(plan) is None


def _executor(cases: Sequence[tuple[Case, Plan]], runs: int) -> Executor:
    ticks = runs * sum(plan.world.ticks for _, plan in cases)
    return pool.on_this_machine() if ticks > _WORTH_PROCESSES else Here()


def _quantity(plan: Plan) -> str:
    """What matters of agents that find out where they are, pursue a target, or keep a formation."""
    if plan.localizes:
        return "localization"
    return "agreed" if plan.pursues else "error"


def _of_runs(result: study.Result) -> Setting:
    quantity = _quantity(result.plan)
    error = result.runs.mean_error
    values = error if quantity == "error" else np.nanmean(result.runs.quantities[quantity], axis=1)
    finite = np.isfinite(error)
    verdicts = Counter("pass" if one else "fail" for one in finite.tolist())
    seed = result.plan.scenario.seed + int(np.argmin(finite))
    first = None if finite.all() else NotPassed(seed, "fail", "the swarm diverged")
    return Setting(result.labels, quantity, values, verdicts, first, None)


def _looked_at(labels: Mapping[str, str], plan: Plan, runs: int, load: Load) -> Iterator[Evidence]:
    labelled, first = [f"{key}={value}" for key, value in labels.items()], plan.scenario.seed
    for begin in range(first, first + runs, _LOOKED_AT):
        seeds = range(begin, min(begin + _LOOKED_AT, first + runs))
        yield from rehearse_all(
            [plan if seed == first else planning.make(load([*labelled, f"seed={seed}"])) for seed in seeds]
        )


def _told(flown: Iterable[Evidence], done: int, runs: int, watch: Callable[[float], None]) -> Iterator[Evidence]:
    """The same runs; after each it is told how many settings are done."""
    for number, run in enumerate(flown, start=1):
        yield run
        watch(done + number / runs)


def _of_evidence(
    labels: Mapping[str, str], plan: Plan, flown: Iterable[Evidence], checker: Checker | None, why: str | None
) -> Setting:
    quantity, values, verdicts, first = _quantity(plan), list[float](), Counter[str](), None
    for run in flown:
        findings = [] if checker is None else [checker(run)]
        verdict = summed_up(run, findings)
        verdicts[verdict] += 1
        values.append(_figure(run, quantity))
        if first is None and verdict in ("fail", "vacuous"):
            says = [*run.outcome.reasons, *(str(one) for one in findings if one.verdict == verdict)]
            first = NotPassed(run.plan.scenario.seed, verdict, "; ".join(says))
    return Setting(labels, quantity, np.array(values), verdicts, first, why)


def _figure(flown: Evidence, quantity: str) -> float:
    if quantity == "error":
        return float(flown.error.mean())
    mean = flown.outcome.errors[_FIGURES[quantity]]["mean"]
    return np.nan if mean is None else mean


def _parts(text: str) -> Iterator[str]:
    """What stands between commas that are in no brackets and no quotes."""
    part, depth, quote = "", 0, ""
    for sign in text:
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "\"'":
            quote = sign
        else:
            depth += (sign in "[{(") - (sign in "]})")
        if sign == "," and not depth and not quote:
            yield part
            part = ""
        else:
            part += sign
    yield part
