"""Studies: a scenario over a grid of settings and many seeds, a figure, and a verdict on every claim.

A study is a TOML file in `affinet/studies/`: axes whose values are overrides of the scenario, and claims, each with the check
that decides it (`analysis/claims.py`).
"""

from __future__ import annotations

import itertools
import json
import multiprocessing
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, ValidationError, model_validator

from affinet import files
from affinet import plan as planning
from affinet import scenario as scenarios
from affinet.batch import Runs, fly_all
from affinet.impairments import Section
from affinet.plan import Plan, PlanError
from affinet.sections import ScenarioError
from analysis import claims
from analysis.claims import Verdict
from analysis.graph import adjacency
from analysis.indicator import Bounds, bounds
from netem.links import Mask
from world.formation import Array

Labels = dict[str, str]
Quantity = Literal["error", "procrustes", "estimation_error", "covariance_trace"]

NAMES: dict[Quantity, tuple[str, str]] = {
    "error": ("tracking error", "m²"),
    "procrustes": ("Procrustes error", "m"),
    "estimation_error": ("estimation error", "m"),
    "covariance_trace": ("trace of the covariances", "m²"),
}
_FOLDER = "studies"
_KEPT = 600  # moments of a curve


class Axis(Section):
    """A setting that is varied: for each value its label, and the overrides it stands for."""

    name: str
    values: dict[str, list[str]]


class Claim(Section):
    """What a paper says, for `each` label of some axes, and the check that decides it over the cases of these labels."""

    says: str
    each: list[str] = Field(default_factory=list)
    check: Literal["flat", "approaches", "stays_below", "leaves", "indicator_below_error", "lower", "ratio"]
    of: Labels
    to: Labels | None = None
    quantity: Quantity | None = None
    level: float | None = None
    between: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    since: float = 0.0
    until: float | None = None

    @model_validator(mode="after")
    def _compared(self) -> Claim:
        if (self.to is None) == (self.check in ("approaches", "lower", "ratio")):
            raise ValueError(f"the check {self.check!r} {'needs' if self.to is None else 'has no use for'} to")
        return self


class Size(Section):
    """How large the study is: runs of each case, and overrides for all of them."""

    runs: Annotated[int, Field(ge=1)]
    set: list[str] = Field(default_factory=list)


class Study(Section):
    """A study. Cases with all labels of an entry of `skip` are left out; a sweep runs `along` an axis."""

    title: str
    source: str
    figure: Literal["curves", "sweep", "indicator", "map"]
    scenario: str
    quantity: Quantity = "error"
    set: list[str] = Field(default_factory=list)
    full: Size
    quick: Size
    axes: list[Axis]
    along: str | None = None
    skip: list[Labels] = Field(default_factory=list)
    claims: list[Claim] = Field(default_factory=list)

    @model_validator(mode="after")
    def _drawn(self) -> Study:
        if self.figure in ("sweep", "map") and self.quantity != "error":
            raise ValueError(f"a {self.figure} shows the mean tracking error, and no {self.quantity}")
        return self


@dataclass(frozen=True)
class Case:
    """One setting of a study: its label on every axis, and the runs of it."""

    labels: Labels
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class Result:
    """A case, and what came of its runs; `bounds` are those of the indicator (18)."""

    labels: Labels
    runs: Runs
    bounds: Bounds
    followers: Mask


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
        return Study.model_validate(file.says)
    except ValidationError as error:
        wrong = [f"{file.name}: {'.'.join(map(str, one['loc']))}: {one['msg']}" for one in error.errors()]
        raise ScenarioError("\n".join(wrong)) from error


def cases(study: Study, *, quick: bool) -> Iterator[Case]:
    """Every setting of its grid."""
    size = study.quick if quick else study.full
    for labels in itertools.product(*(axis.values for axis in study.axes)):
        chosen = [axis.values[label] for axis, label in zip(study.axes, labels, strict=True)]
        overrides = (*study.set, *size.set, *itertools.chain.from_iterable(chosen))
        case = Case(dict(zip((axis.name for axis in study.axes), labels, strict=True)), overrides)
        if not any(_selected(case, left_out) for left_out in study.skip):
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
    plans = [_planned(study.scenario, case) for case in todo]  # what cannot fly is found before any has flown
    context = multiprocessing.get_context("spawn")  # a fork would copy the threads of the libraries loaded here
    with ProcessPoolExecutor(mp_context=context) as pool:
        waiting = [pool.submit(_fly, plan, case.labels, size.runs) for plan, case in zip(plans, todo, strict=True)]
        results = []
        for one in waiting:
            results.append(one.result())
            watch(results[-1])
    return results


def _planned(name: str, case: Case) -> Plan:
    try:
        return planning.make(scenarios.load(name, case.overrides))
    except (ScenarioError, PlanError) as error:
        raise ScenarioError(f"case {case.labels}: {error}") from error


def _fly(plan: Plan, labels: Labels, runs: int) -> Result:
    every = max(1, plan.world.ticks // _KEPT)
    first = plan.scenario.seed
    flown = fly_all(plan, range(first, first + runs), every)
    links = plan.world.links
    heard = adjacency(np.ones(len(links), dtype=bool), links.src, links.dst, links.agents)
    limits = bounds(plan.world.formation.nominal, heard, plan.world.covariance)
    return Result(labels, flown, limits, ~plan.world.formation.is_leader)


def judge(study: Study, results: list[Result]) -> list[Verdict]:
    """The verdict on each of its claims.

    Raises
    ------
    ScenarioError
        When a claim looks at what was not flown.
    """
    verdicts = []
    for claim in itertools.chain.from_iterable(_spelled_out(study, claim) for claim in study.claims):
        try:
            verdicts.append(_judge(claim, results, claim.quantity or study.quantity))
        except ValueError as error:
            raise ScenarioError(f"claim {claim.says!r}: {error}") from error
    return verdicts


def _spelled_out(study: Study, claim: Claim) -> Iterator[Claim]:
    """A claim for each label of the axes it is for."""
    values = {axis.name: list(axis.values) for axis in study.axes}
    for labels in itertools.product(*(values[name] for name in claim.each)):
        where = dict(zip(claim.each, labels, strict=True))
        other = None if claim.to is None else claim.to | where
        yield claim.model_copy(
            update={"says": ", ".join(labels) + ": " * bool(labels) + claim.says, "of": claim.of | where, "to": other}
        )


def _judge(claim: Claim, results: list[Result], quantity: Quantity) -> Verdict:
    chosen = [one for one in results if _selected(one, claim.of)]
    if not chosen:
        raise ValueError(f"no case has the labels {claim.of}")
    span, unit = (claim.since, claim.until), NAMES[quantity][1]

    def means(of: list[Result]) -> Array:
        return np.array([_mean_of(one.runs, quantity, span) for one in of])

    other = [one for one in results if _selected(one, claim.to or {})]
    seconds = chosen[0].runs.seconds
    values = np.concatenate([getattr(one.runs, quantity) for one in chosen])
    match claim.check:
        case "flat":
            return claims.flat(claim.says, means(chosen), claim.level or 2.0, unit)
        case "approaches":
            return claims.approaches(claim.says, means(chosen), means(other), claim.level or 0.5)
        case "lower":
            return claims.lower(claim.says, means(chosen), means(other), unit)
        case "ratio":
            (one,), (another,) = means(chosen), means(other)
            return claims.ratio(claim.says, one, another, claim.between or [0.0, 1.0])
        case "stays_below":
            return claims.stays_below(claim.says, seconds, values, claim.level or 1.0, span, unit)
        case "leaves":
            return claims.leaves(claim.says, seconds, values, claim.level or 1.0, span, unit)
        case "indicator_below_error":
            (one,) = chosen
            followers, limits, runs = one.followers, one.bounds, one.runs
            psi = (runs.psi - limits.offset)[:, :, followers]
            return claims.below_in_mean(claim.says, runs.seconds, psi, runs.error[..., None] * limits.slope[followers])


def _selected(one: Case | Result, labels: Mapping[str, str]) -> bool:
    return all(one.labels[name] == label for name, label in labels.items())


def _mean_of(runs: Runs, quantity: Quantity, span: claims.Span) -> Array:
    """The mean of each run over a span of seconds, shape (R,); of the tracking error over all of it, every tick counts."""
    if quantity == "error" and span == (0.0, None):
        return runs.mean_error
    values: Array = getattr(runs, quantity)
    return values[:, claims.within(runs.seconds, span)].mean(axis=1)


def save(out: Path, study: Study, results: list[Result], verdicts: list[Verdict]) -> None:
    """Write data, figure and verdicts into a directory."""
    from affinet import study_tables  # pyarrow and matplotlib take a while to import
    from analysis import figures

    out.mkdir(parents=True, exist_ok=True)
    study_tables.write(out, results)
    (out / "claims.json").write_text(json.dumps([asdict(verdict) for verdict in verdicts], indent=2) + "\n")
    curves = [
        figures.Curve(one.labels, one.runs.seconds, getattr(one.runs, study.quantity), one.runs.mean_error)
        for one in results
    ]
    if study.figure == "curves":
        what, unit = NAMES[study.quantity]
        figures.curves(out / "figure.png", study.title, curves, [axis.name for axis in study.axes], f"{what} ({unit})")
    elif study.figure == "sweep":
        figures.sweep(out / "figure.png", study.title, curves, [axis.name for axis in study.axes], study.along or "")
    elif study.figure == "map":
        figures.settings(out / "figure.png", study.title, curves, [axis.name for axis in study.axes])
    else:
        (one,) = results
        corrected = (one.runs.psi - one.bounds.offset) / one.bounds.slope
        numbers = np.flatnonzero(one.followers)
        path, seen = out / "figure.png", corrected[:, :, numbers]
        figures.indicator(path, study.title, one.runs.seconds, one.runs.error, seen, (numbers + 1).tolist())
