"""Studies: a scenario over a grid of settings and many seeds, a figure, and a verdict on every claim.

A study is a TOML file like those in `affinet/shipped/studies/`: axes of values that override the scenario, and claims, each
with the check that decides it (`judging.py`, `analysis/claims/checks.py`); `report.py` writes down what came of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, ValidationError, model_validator

from affinet.planning import making as planning
from affinet.planning.plan import Plan, PlanError
from affinet.runtimes.side_by_side import Flight
from affinet.scenario import files
from affinet.scenario import loading as scenarios
from affinet.scenario.explain import explained, named_in
from affinet.scenario.keys import key
from affinet.scenario.section import Section
from affinet.scenario.sections import Scenario
from affinet.scenario.source import Source
from affinet.scenario.units import Finite, NotNegative
from affinet.scenario.wrong import ScenarioError
from affinet.studies import checks
from affinet.studies.batch import Runs, fly_together
from affinet.studies.checks import Wrong
from affinet.studies.executor import Executor, tell
from affinet.studies.quantities import Quantity
from affinet.studies.sharing import Piece, batches, flown_by_case, in_turn, missing
from analysis.models.arrays import Mask
from netem.processes.user_code import UserCodeError

Labels = dict[str, str]
_FOLDER = "studies"
_KEPT = 600  # moments of a curve
_NOTHING: Mapping[Piece, Runs] = MappingProxyType({})


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

# Of what no quantity is below, and no ratio of the largest to the smallest.
_LEAST_LEVEL: dict[str, float] = {"flat": 1.0, "stays_below": 0.0, "leaves": 0.0}


class Axis(Section):
    """A setting that is varied: for each value its label, and the overrides it stands for."""

    name: str = key(..., "of the axis")
    values: dict[str, list[str]] = key(..., "for each label the overrides that it stands for")


class Claim(Section):
    """What a paper says, for `each` label of some axes, and the check that decides it over the cases of these labels.

    With `levels`, a level for each label of the one axis in `each`, it says so of these labels only.
    """

    says: str = key(..., "the claim, in words")
    each: list[str] = key(list, "axes for whose labels, one by one, it is judged")
    check: Literal[
        "flat",
        "approaches",
        "stays_below",
        "leaves",
        "indicator_below_error",
        "indicator_follows_error",
        "lower",
        "ratio",
        "exponential",
        "slower_with_anchor",
        "value",
    ] = key(..., "what decides it")
    of: Labels = key(dict, "labels of the cases that it speaks of")
    to: Labels | None = key(None, "labels of those they are compared with")
    quantity: Quantity | None = key(None, "of what, in place of the study's own")
    to_quantity: Quantity | None = key(None, "of what of those compared with, if of another")
    level: Finite | None = key(None, "what the check compares with")
    levels: dict[str, Finite] | None = key(None, "or a level for each label of the one axis in `each`")
    between: Annotated[list[Finite], Field(min_length=2, max_length=2)] | None = key(
        None, "two numbers: of `ratio` what it lies between, of `value` factors of the level"
    )
    since: NotNegative = key(0.0, "from when on", "s")
    until: NotNegative | None = key(None, "up to when; without it to the end of the run", "s")

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
        levels = [one for one in (self.level, *(self.levels or {}).values()) if one is not None]
        if self.check == "value" and 0.0 in levels:
            raise ValueError("a value is between multiples of its level: give one that is not 0")
        if self.between is not None and self.between[0] >= self.between[1]:
            raise ValueError(
                f"between is from a smaller to a larger number, got {self.between[0]:g} and {self.between[1]:g}"
            )
        least = _LEAST_LEVEL.get(self.check, -math.inf)
        if any(one <= least for one in levels):
            raise ValueError(f"the level of {self.check!r} must be above {least:g}, below which nothing is")
        if self.levels is not None and (len(self.each) != 1 or self.level is not None):
            raise ValueError("levels are for the labels of one axis: name it in each, and give no level beside them")
        return self

    def settings(self, axes: Iterable[Axis]) -> Iterator[Labels]:
        """Every setting that it speaks of: a label of each of the axes it is for."""
        values = {axis.name: list(axis.values) for axis in axes}
        if self.levels is not None:
            values[self.each[0]] = list(self.levels)
        for labels in itertools.product(*(values[name] for name in self.each)):
            yield dict(zip(self.each, labels, strict=True))


class Bound(Section):
    """A line in the figure that no curve should cross, and what it says."""

    at: Finite = key(..., "where the line is, in the unit of the quantity")
    says: str = key(..., "what is said of it")


class Size(Section):
    """How large the study is: runs of each case, and overrides for all of them."""

    runs: Annotated[int, Field(ge=1, le=1_000_000)] = key(..., "of each case")
    set: list[str] = key(list, "overrides for all cases")


class Study(Section):
    """A study. Cases with all labels of an entry of `skip` are left out; a sweep runs `along` an axis, `since` a second.

    Curves and sweeps are drawn of its quantity, and of those in `also`.
    """

    title: str = key(..., "of the figure")
    source: str = key(..., "who says so: a paper and its figure, or our own")
    figure: Literal["curves", "sweep", "indicator", "map", "paths"] = key(
        ..., "curves, sweep, indicator, map or paths (`affinet list figures`)"
    )
    scenario: str = key(..., "by name, or a file, relative to this one")
    quantity: Quantity = key("error", "what is drawn and judged")
    also: list[Quantity] = key(list, "further quantities of which curves or a sweep are drawn")
    bound: Bound | None = key(None, "a line in the figure that no curve should cross")
    set: list[str] = key(list, "overrides for all cases")
    full: Size = key(..., "how large it is")
    quick: Size = key(..., "how large it is with --quick")
    axes: list[Axis] = key(..., "settings that are varied; every combination is a case")
    along: str | None = key(None, "of a sweep: the axis it runs along")
    since: NotNegative = key(0.0, "from when on a sweep takes its mean", "s")
    skip: list[Labels] = key(list, "cases that are left out: those with all labels of an entry")
    claims: list[Claim] = key(list, "what is judged")
    _source: Source | None = PrivateAttr(default=None)
    _folder: Path | None = PrivateAttr(default=None)

    @property
    def folder(self) -> Path | None:
        """Of the file that says it: paths in it, and modules it names, are relative to that."""
        return self._folder

    @model_validator(mode="after")
    def _drawn(self) -> Study:
        if self.figure == "map" and self.quantity != "error":
            raise ValueError(f"a map shows the mean tracking error, and no {self.quantity}")
        if self.also and self.figure not in ("curves", "sweep"):
            raise ValueError(f"also is of curves and sweeps, and the figure is {self.figure!r}: leave it out")
        return self

    def loaded(self, overrides: Sequence[str]) -> Scenario:
        """Its scenario with overrides, which name paths and modules from the folder of the study.

        Raises
        ------
        ScenarioError
            When there is something wrong with it.
        """
        folder = self.folder or Path()
        name = str(folder / self.scenario) if self.scenario.endswith(".toml") else self.scenario
        return scenarios.load(name, overrides, self.folder)

    def size(self, *, quick: bool) -> Size:
        """How large it is."""
        return self.quick if quick else self.full

    def refuse(self, found: Iterable[Wrong]) -> None:
        """Say what was found to be wrong, if anything was.

        Raises
        ------
        ScenarioError
            With the place in the file, and the keys of all that is wrong.
        """
        if wrong := list(found):
            raise ScenarioError(named_in(self._source or Source("in code", "", ()), wrong))


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
    source = Source(file.name, file.text, ())
    try:
        study = Study.model_validate(file.says)
    except ValidationError as error:
        raise ScenarioError(explained(error, Study, source)) from None  # it has all that pydantic says, in better words
    study._source = source
    study._folder = file.folder
    study.refuse(checks.of_file(study))
    return study


def cases(study: Study, *, quick: bool) -> Iterator[Case]:
    """Every setting of its grid."""
    size = study.size(quick=quick)
    for labels in itertools.product(*(axis.values for axis in study.axes)):
        chosen = [axis.values[label] for axis, label in zip(study.axes, labels, strict=True)]
        overrides = (*study.set, *size.set, *itertools.chain.from_iterable(chosen))
        case = Case(dict(zip((axis.name for axis in study.axes), labels, strict=True)), overrides)
        if not any(selected(case, left_out) for left_out in study.skip):
            yield case


def fly(
    planned: Sequence[tuple[Case, Plan]],
    runs: int,
    executor: Executor,
    there: Mapping[Piece, Runs] = _NOTHING,
    keep: Callable[[Piece, Runs], None] = lambda *_: None,
    watch: Callable[[Sequence[float]], None] = lambda _: None,
) -> Iterator[Result]:
    """So many runs of each case, in batches; each case in its turn, as soon as it is done.

    Parameters
    ----------
    planned, runs
        The cases, and how many runs of each.
    executor
        Where they fly.
    there, keep
        What came of pieces of it that have flown already, and what is told of each piece as it is done.
    watch
        Told from time to time which share of each case has flown.

    Raises
    ------
    UserCodeError
        When a user's own code does something wrong: in which case, as well as it can be known.
    Lost
        When who flew them is gone.
    """
    wanted = missing(there, len(planned), runs)
    shared = batches([plan for _, plan in planned], wanted, executor.at_once)

    def look(shares: Sequence[float]) -> None:
        watch(flown_by_case(shares, shared, there, len(planned), runs))

    def coming() -> Generator[tuple[Piece, Runs]]:
        yield from there.items()
        given = [[_part(*planned[piece.case], piece) for piece in batch] for batch in shared]
        with closing(executor.each(_fly, given, look)) as flown:
            for number, made in flown:
                pieces = list(zip(shared[number], made, strict=True))
                for one in pieces:
                    keep(*one)
                yield from pieces

    with closing(coming()) as pieces:
        for (case, plan), whole in zip(planned, in_turn(pieces, len(planned), runs), strict=True):
            yield Result(case.labels, plan, whole)


def plans(study: Study, *, quick: bool) -> list[tuple[Case, Plan]]:
    """All its cases with what flies in them: whatever cannot fly, be drawn or be judged is found before any has flown.

    Raises
    ------
    ScenarioError
        When something cannot.
    UserCodeError
        When a user's own estimator or law does something wrong.
    """
    todo = list(cases(study, quick=quick))
    study.refuse(checks.of_cases(study, todo, study.size(quick=quick).runs))
    planned = [(case, _planned(study, case)) for case in todo]
    study.refuse(checks.of_plans(study, planned, [_every(plan) for _, plan in planned]))
    return planned


def _planned(study: Study, case: Case) -> Plan:
    try:
        with _in_case(case):
            return planning.make(study.loaded(case.overrides))
    except (ScenarioError, PlanError) as error:
        where = f"{study._source.file}: " if study._source else ""
        said = str(error).removeprefix("override: ")  # which nobody typed
        raise ScenarioError(f"{where}case {checks.named(case.labels)}: {said}") from error


@contextmanager
def _in_case(case: Case) -> Iterator[None]:
    """What a user's own code does wrong in the block, it does in this case."""
    try:
        yield
    except UserCodeError as error:
        error.during = f"case {checks.named(case.labels)}"
        raise


def _every(plan: Plan) -> int:
    return max(1, plan.world.ticks // _KEPT)


def _part(case: Case, plan: Plan, piece: Piece) -> tuple[Case, Flight]:
    first = plan.scenario.seed
    return case, Flight(plan, range(first + piece.runs.start, first + piece.runs.stop))


def _fly(parts: Sequence[tuple[Case, Flight]]) -> list[Runs]:
    flights = [flight for _, flight in parts]
    try:
        return fly_together(flights, _every(flights[0].plan), tell)
    except UserCodeError as error:
        if len(parts) > 1:
            _fly_alone(parts, error.tick or 0)
        error.during = f"case {', or '.join(checks.named(case.labels) for case, _ in parts)}"
        raise


def _fly_alone(parts: Sequence[tuple[Case, Flight]], last: int) -> None:
    """Each up to this tick, in which all together failed: the one that fails alone is named."""
    for case, (plan, seeds) in parts:
        with _in_case(case):
            fly_together([Flight(replace(plan, world=replace(plan.world, ticks=last + 1)), seeds)], _every(plan))


def selected(one: Case | Result, labels: Mapping[str, str]) -> bool:
    """Whether a case has all these labels."""
    return all(one.labels[name] == label for name, label in labels.items())
