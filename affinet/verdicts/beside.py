"""Runs beside each other: the settings in which they differ, their figures, and where each parts from the first."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from affinet.scenario.words import shown
from affinet.verdicts import compare
from affinet.verdicts.evidence import Evidence
from world.books import history
from world.books.history import Arrays

Row = tuple[str, tuple[Any, ...]]  # a name, and a plain value of each run; None is none
_NOT_FLOWN = ("record.", "description")  # settings of which a flight knows nothing
_QUOTE, _LONGEST = '"', 60


def settings(runs: Sequence[Evidence]) -> list[Row]:
    """The keys of scenarios in which runs differ, and what each says there."""
    said = [dict(_leaves(run.plan.scenario.model_dump(mode="json"))) for run in runs]
    keys = dict.fromkeys(key for one in said for key in one)
    rows = [(key, tuple(one.get(key) for one in said)) for key in keys]
    return [(key, values) for key, values in rows if any(value != values[0] for value in values)]


def titles(runs: Sequence[Evidence], names: Sequence[str]) -> list[str]:
    """What tells runs apart above a picture: the settings of the flight that differ, and their names where that does not do."""
    rows = [(key.rpartition(".")[2], values) for key, values in settings(runs) if not key.startswith(_NOT_FLOWN)]
    told = [", ".join(f"{key} {_told(values[number])}" for key, values in rows) for number in range(len(runs))]
    if not rows or len(set(told)) < len(told) or max(map(len, told)) > _LONGEST:
        return list(names)
    return told


def _told(value: Any) -> str:
    return "-" if value is None else shown(value).strip(_QUOTE)


def figures(runs: Sequence[Evidence]) -> list[Row]:
    """What came of each."""
    each = [dict(_figures(run)) for run in runs]
    names = dict.fromkeys(name for one in each for name in one)
    return [(name, tuple(one.get(name) for one in each)) for name in names]


def parting(first: Evidence, other: Evidence) -> str:
    """Where a run parts from the first one, of what both have, in words."""
    links = first.plan.world.links
    if links.index != other.plan.world.links.index:
        return "it is of another formation: there is nothing to hold tick by tick against the first"
    channels = [name for name in first.plan.channels if name in other.plan.channels]
    one, another = (_over(run, channels) for run in (first, other))
    names = [name for name in one if history.form(one[name]) == history.form(another.get(name))]
    found = compare.first_difference(
        {name: one[name] for name in names}, {name: another[name] for name in names}, links, channels
    )
    return "the same bits as the first" if found is None else str(found)


def _over(run: Evidence, channels: Sequence[str]) -> Arrays:
    """The arrays of a run over some of its channels."""
    chosen = [run.plan.channels.index(name) for name in channels]
    return {**run.arrays, **{name: run.arrays[name][:, chosen] for name in ("verdicts", "newest")}}


def _figures(run: Evidence) -> Iterator[tuple[str, Any]]:
    done = run.outcome
    yield "verdict", done.says
    yield "ticks", run.ticks
    errors = done.errors or {"tracking error (m2)": done.tracking_error}
    for name, of in errors.items():
        called = name if name.endswith(")") else f"{name.replace('_', ' ')} (m)"
        for what, value in of.items():
            yield f"{called}, {what}", value
    messages = done.messages
    yield from ((f"messages {what}", messages[what]) for what in ("offered", "delivered"))
    for reason, number in messages["dropped"].items():
        yield f"dropped, {reason}", number
    yield "faults", len(done.faults)
    yield "digest", done.digest


def _leaves(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in table.items():
        key = f"{before}{name}"
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, f"{key}.")
        else:
            yield key, value
