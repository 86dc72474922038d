"""docs/reference/: every key, verb, checker, algorithm, array, command and study, from models and docstrings.

python docs/references.py
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import reference_of_commands
import reference_of_studies
from marked import LONGEST, Lines, code, filled, parameters, table, titled
from pydantic import BaseModel

from affinet.reference import catalogue
from affinet.reference.docstrings import first_line
from affinet.reference.entries import Entry, of_model
from affinet.scenario.profiles import LinkProfile
from affinet.scenario.sections import Scenario
from affinet.scenario.words import shown
from affinet.verdicts.metrics import METRICS
from world.books import described
from world.books.described import Described

FOLDER = Path(__file__).parent / "reference"
_ELSEWHERE = (LinkProfile,)  # tables that have a page of their own


def scenario() -> Lines:
    """Every key of a scenario file, table by table."""
    yield from titled(
        "Keys of a scenario",
        "Every table of a [scenario file](../scenario.md), and every key in it; SI units. `affinet schema` has the same for",
        "editors.",
    )
    yield from ("", *parameters(of_model(Scenario)))
    for name, info in Scenario.model_fields.items():
        if name != "timeline":
            for model in _models(info.annotation):
                yield from _table_of(name, model)


def _table_of(name: str, model: type[BaseModel]) -> Lines:
    """The keys of a table, and of the tables within it."""
    yield from ("", f"## {name}", "", filled(first_line(model)), "", *parameters(of_model(model)))
    for key, info in model.model_fields.items():
        for within in _models(info.annotation):
            if within in _ELSEWHERE:
                yield from ("", f"What stands in a table of `{name}.{key}` is [on a page of its own](air.md).")
            else:
                yield from _table_of(f"{name}.{key}", within)


def _models(hint: Any) -> Iterator[type[BaseModel]]:
    if isinstance(hint, type) and issubclass(hint, BaseModel):
        yield hint
    for inner in get_args(hint):
        yield from _models(inner)


def verbs() -> Lines:
    """The verbs of the timeline."""
    yield from titled(
        "Verbs of the timeline",
        "What a `[[timeline]]` entry of a scenario, or `.fault(...)` of a test, can do",
        "([how it is written](../scenario.md#the-timeline)). Every verb takes the keys that say when, too.",
    )
    *every, when = catalogue.verb_entries()
    yield from ("", "## When", "", filled(when.says), "", *parameters(when.parameters))
    yield from _each(every)


def air() -> Lines:
    """What a profile of links is made of, and those there are."""
    yield from titled(
        "Profiles and impairments",
        "What happens to messages: profiles by name, and what one of your own may have",
        "([how it is written](../network.md)).",
    )
    yield from ("", "## Profiles", "")
    profiles = ((code(one.name), one.says, code(_contents(one))) for one in catalogue.link_profiles())
    yield from table(("profile", "what", "contents"), profiles)
    yield from ("", "## Keys of a profile", "", filled(first_line(LinkProfile)), "", *parameters(of_model(LinkProfile)))
    yield from _each(catalogue.impairments())


def _contents(profile: Entry) -> str:
    return ", ".join(f"{one.name} = {shown(one.default, LONGEST)}" for one in profile.parameters)


def algorithms() -> Lines:
    """Estimators and laws with their parameters."""
    yield from titled(
        "Estimators and laws",
        "`agents.estimator` and `agents.law` of a scenario, and what `[agents.parameters.NAME]` can set. How to write one of",
        "your own: [estimators](../estimators.md), [laws](../laws.md).",
    )
    yield from ("", "## Estimators", *_each(catalogue.estimators(), "###"))
    yield from ("", "## Laws", *_each(catalogue.laws(), "###"))


def checkers() -> Lines:
    """Checkers, and the metrics of `below`."""
    yield from titled(
        "Checkers",
        "What `run.check(...)` of a test, `--check` and `--invariant` can ask of a run",
        "([when each is vacuous](../testing.md#checkers)). All are imported from `affinet`.",
    )
    yield from _each(catalogue.checker_entries())
    yield from ("", "## Metrics of `below`", "")
    yield from table(
        ("metric", "what", "unit"), ((code(name), one.says, one.unit or "1") for name, one in METRICS.items())
    )


def arrays() -> Lines:
    """Every array of a run."""
    yield from titled(
        "Arrays of a run",
        "What `run.arrays[...]` holds, and, with labels, `run.dataset` and what is exported of it",
        "([library](../library.md#arrays-with-labels)). All begin with the ticks, and are float64 unless another kind is said.",
        "`position` has one row more than there are ticks: where the last tick led.",
    )
    yield from ("", "## Axes", "", *table(("axis", "what stands along it"), _coded(described.AXES.items())))
    yield from ("", "## By tick", "", *table(_OF_ARRAYS, (_array(*one) for one in described.BY_TICK.items())))
    yield from ("", "Of `run.dataset` and what is exported, made of these when it is asked for:", "")
    yield from table(_OF_ARRAYS, (_array(*one) for one in described.DERIVED.items()))
    yield from ("", "What an input is depends on the bodies: m/s of those that integrate it once, m/s2 of those twice.")
    yield from ("", "## What estimators report", "")
    yield from ("Each begins with the ticks and the agents; an estimator of your own may have others.", "")
    yield from table(_OF_ARRAYS, (_array(name, one, ("time", "agent")) for name, one in described.REPORTS.items()))


_OF_ARRAYS = ("array", "axes", "unit", "kind", "what")
_KINDS = {"f": "float64", "b": "truth", "i": "whole number", "u": "whole number"}


def _array(name: str, one: Described, before: tuple[str, ...] = ()) -> Sequence[str]:
    absent = f"; {one.absent} where there is none" if one.absent is not None else ""
    where = f"; where `{one.where}` says so" if one.where else ""
    return code(name), ", ".join((*before, *one.axes)), one.unit, _KINDS[one.kind], one.says + absent + where


def _each(entries: Iterable[Entry], mark: str = "##") -> Lines:
    """A heading for each, its line and a table of what it takes."""
    for entry in entries:
        brought = "" if entry.package == "affinet" else f" ({entry.package})"
        yield from ("", f"{mark} {entry.name}{brought}", "", filled(entry.says))
        if entry.parameters:
            yield from ("", *parameters(entry.parameters))


def _coded(rows: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    return ((code(name), says) for name, says in rows)


PAGES: Mapping[str, Callable[[], Lines]] = {
    "scenario": scenario,
    "verbs": verbs,
    "air": air,
    "algorithms": algorithms,
    "checkers": checkers,
    "studies": reference_of_studies.page,
    "arrays": arrays,
    "commands": reference_of_commands.page,
}


def text(page: str) -> str:
    """A page as it stands in the file."""
    return "\n".join(PAGES[page]()) + "\n"


def main() -> None:
    """Write all pages."""
    FOLDER.mkdir(exist_ok=True)
    for page in PAGES:
        (FOLDER / f"{page}.md").write_text(text(page), encoding="utf-8")


if __name__ == "__main__":
    main()
