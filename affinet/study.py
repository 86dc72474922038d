"""Studies: a scenario over a grid of settings and many seeds, a figure, and a verdict on every claim.

A study is a TOML file in `affinet/studies/`: axes whose values are overrides of the scenario, and claims, each with the check
that decides it (`affinet/judging.py`, `analysis/claims.py`); `affinet/study_report.py` writes down what came of it.
"""

from __future__ import annotations

import itertools
import multiprocessing
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PrivateAttr, ValidationError, model_validator

from affinet import files
from affinet import plan as planning
from affinet import scenario as scenarios
from affinet.batch import Runs, fly_all
from affinet.impairments import Section
from affinet.plan import Plan, PlanError
from affinet.quantities import Quantity
from affinet.sections import ScenarioError
from analysis.graph import adjacency
from analysis.indicator import Bounds, bounds
from netem.links import Mask

Labels = dict[str, str]
_FOLDER = "studies"
_KEPT = 600  # moments of a curve


# What checks compare with, and want to be told; the others need nothing.
_WANTED: dict[str, frozenset[str]] = {
    "flat": frozenset({"level"}),
    "approaches": frozenset({"to", "level"}),
    "stays_below": frozenset({"level"}),
    "leaves": frozenset({"level"}),
    "lower": frozenset({"to"}),
    "ratio": frozenset({"to", "between"}),
    "value": frozenset({"level", "between"}),
}


class Axis(Section):
    """A setting that is varied: for each value its label, and the overrides it stands for."""

    name: str
    values: dict[str, list[str]]


class Claim(Section):
    """What a paper says, for `each` label of some axes, and the check that decides it over the cases of these labels.

    With `levels`, a level for each label of the one axis in `each`, it says so of these labels only.
    """

    says: str
    each: list[str] = Field(default_factory=list)
    check: Literal[
        "flat",
        "approaches",
        "stays_below",
        "leaves",
        "indicator_below_error",
        "lower",
        "ratio",
        "exponential",
        "slower_with_anchor",
        "value",
    ]
    of: Labels = Field(default_factory=dict)
    to: Labels | None = None
    quantity: Quantity | None = None
    to_quantity: Quantity | None = None
    level: float | None = None
    levels: dict[str, float] | None = None
    between: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    since: float = 0.0
    until: float | None = None

    @model_validator(mode="after")
    def _compared(self) -> Claim:
        level = self.level if self.levels is None else self.levels
        given = {
            key for key, value in (("to", self.to), ("level", level), ("between", self.between)) if value is not None
        }
        wanted = _WANTED.get(self.check, frozenset())
        if missing := sorted(wanted - given):
            raise ValueError(f"the check {self.check!r} needs {' and '.join(missing)}")
        if useless := sorted(given - wanted):
            raise ValueError(f"the check {self.check!r} has no use for {' and '.join(useless)}")
        if self.to_quantity is not None and self.to is None:
            raise ValueError("to_quantity is that of what is compared with: give to")
        if self.levels is not None and (len(self.each) != 1 or self.level is not None):
            raise ValueError("levels are for the labels of one axis: name it in each, and give no level beside them")
        return self


class Bound(Section):
    """A line in the figure that no curve should cross, and what it says."""

    at: float
    says: str


class Size(Section):
    """How large the study is: runs of each case, and overrides for all of them."""

    runs: Annotated[int, Field(ge=1)]
    set: list[str] = Field(default_factory=list)


class Study(Section):
    """A study. Cases with all labels of an entry of `skip` are left out; a sweep runs `along` an axis, `since` a second."""

    title: str
    source: str
    figure: Literal["curves", "sweep", "indicator", "map"]
    scenario: str
    quantity: Quantity = "error"
    bound: Bound | None = None
    set: list[str] = Field(default_factory=list)
    full: Size
    quick: Size
    axes: list[Axis]
    along: str | None = None
    since: float = 0.0
    skip: list[Labels] = Field(default_factory=list)
    claims: list[Claim] = Field(default_factory=list)
    _folder: Path | None = PrivateAttr(default=None)

    @property
    def folder(self) -> Path | None:
        """Of the file that says it: paths in it, and modules it names, are relative to that."""
        return self._folder

    @model_validator(mode="after")
    def _drawn(self) -> Study:
        if self.figure == "map" and self.quantity != "error":
            raise ValueError(f"a map shows the mean tracking error, and no {self.quantity}")
        return self

    @model_validator(mode="after")
    def _labelled(self) -> Study:
        known = {axis.name: axis.values for axis in self.axes}
        named = [*self.skip, *(labels for claim in self.claims for labels in (claim.of, claim.to or {}))]
        named += [{claim.each[0]: label} for claim in self.claims for label in claim.levels or {}]
        for axis, label in (item for labels in named for item in labels.items()):
            if label not in known.get(axis, {}):
                raise ValueError(
                    f"no axis {axis!r} has the label {label!r}; there are { ({n: [*v] for n, v in known.items()}) }"
                )
        for axis in (axis for claim in self.claims for axis in claim.each):
            if axis not in known:
                raise ValueError(f"no axis is called {axis!r}; there are {', '.join(known)}")
        return self


@dataclass(frozen=True)
class Case:
    """One setting of a study: its label on every axis, and the runs of it."""

    labels: Labels
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class Result:
    """A case, what was flown, and what came of its runs."""

    labels: Labels
    plan: Plan
    runs: Runs

    @property
    def followers(self) -> Mask:
        """Who is no leader, shape (N,)."""
        return ~self.plan.world.formation.is_leader

    @property
    def bounds(self) -> Bounds:
        """Those of the indicator (18) where nothing is lost."""
        world = self.plan.world
        heard = adjacency(np.ones(len(world.links), dtype=bool), world.links.src, world.links.dst, world.links.agents)
        return bounds(world.formation.nominal, heard, world.sensor.common)


def shipped() -> list[str]:
    """Names of the studies that come with affinet."""
    return files.shipped(_FOLDER)


def load(name: str) -> Study:
    """The study in a file, or one that is shipped.

    Raises
    ------
    ScenarioError
        When there is none, or something in it is wrong.
    """
    file = files.read(name, _FOLDER, "study")
    try:
        study = Study.model_validate(file.says)
    except ValidationError as error:
        wrong = [f"{file.name}: {'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()]
        raise ScenarioError("\n".join(wrong)) from error
    study._folder = file.folder
    return study


def cases(study: Study, *, quick: bool) -> Iterator[Case]:
    """Every setting of its grid."""
    size = study.quick if quick else study.full
    for labels in itertools.product(*(axis.values for axis in study.axes)):
        chosen = [axis.values[label] for axis, label in zip(study.axes, labels, strict=True)]
        overrides = (*study.set, *size.set, *itertools.chain.from_iterable(chosen))
        case = Case(dict(zip((axis.name for axis in study.axes), labels, strict=True)), overrides)
        if not any(selected(case, left_out) for left_out in study.skip):
            yield case


def run(study: Study, *, quick: bool, watch: Callable[[Result], None]) -> list[Result]:
    """All its cases, two at a time; `watch` sees each as it is done.

    Raises
    ------
    ScenarioError
        When a case cannot fly.
    """
    size = study.quick if quick else study.full
    todo = list(cases(study, quick=quick))
    plans = [_planned(study, case) for case in todo]  # what cannot fly is found before any has flown
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries loaded here
    with ProcessPoolExecutor(mp_context=context) as pool:
        waiting = [pool.submit(_fly, plan, size.runs) for plan in plans]
        results = []
        for case, plan, runs in zip(todo, plans, waiting, strict=True):
            results.append(Result(case.labels, plan, runs.result()))
            watch(results[-1])
    return results


def _planned(study: Study, case: Case) -> Plan:
    folder = study.folder or Path()
    name = str(folder / study.scenario) if study.scenario.endswith(".toml") else study.scenario
    try:
        return planning.make(scenarios.load(name, case.overrides, study.folder))
    except (ScenarioError, PlanError) as error:
        raise ScenarioError(f"case {case.labels}: {error}") from error


def _fly(plan: Plan, runs: int) -> Runs:
    first = plan.scenario.seed
    return fly_all(plan, range(first, first + runs), max(1, plan.world.ticks // _KEPT))


def selected(one: Case | Result, labels: Mapping[str, str]) -> bool:
    """Whether a case has all these labels."""
    return all(one.labels[name] == label for name, label in labels.items())
