"""The arrays of a run with names on their axes, units, and gaps where there is nothing: what xarray calls a dataset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Integers
from netem.medium.verdict import Verdict
from world.books import described
from world.books.described import AGENT, AXIS, CHANNEL, LINK, PAIR, SLOT, TIME, VERDICT, Described
from world.books.history import Arrays

LETTERS = "xyz"
NEIGHBOUR, SENDER, RECEIVER, TICK = "neighbour", "sender", "receiver", "tick"
LEADER, FINAL_POSITION = "leader", "final_position"
_VERDICTS = "verdicts"
_TAKEN = frozenset({*described.AXES, NEIGHBOUR, SENDER, RECEIVER, TICK, LEADER, FINAL_POSITION})  # by no report


class Variable(NamedTuple):
    """An array with the names of its axes, and what is to be known of it."""

    axes: Sequence[str]
    values: NDArray[Any]
    attributes: Mapping[str, Any]


def about(run: Evidence) -> dict[str, str]:
    """What was flown, and what came of it."""
    done = run.outcome
    flown = {name: str(done.flown[name]) for name in ("estimator", "law", "seed")}
    came = {"verdict": done.verdict, "digest": done.digest or "", "affinet": version("affinet")}
    return {"title": run.plan.scenario.source.file, **flown, **came}


def forms(run: Evidence) -> dict[str, Described]:
    """What each array of the run is, and each that is made of them."""
    return {**described.of_run(run.plan.world, run.plan.reports), **described.DERIVED}


def coordinates(run: Evidence) -> dict[str, Variable]:
    """The labels along the axes, and what else is known of what stands there."""
    links, world = run.plan.world.links, run.plan.world
    along = lengths(run)
    labels: dict[str, NDArray[Any]] = {
        TIME: run.seconds,
        AGENT: np.arange(1, links.agents + 1),
        LINK: _words(f"{src}->{dst}" for src, dst in zip(links.src.tolist(), links.dst.tolist(), strict=True)),
        CHANNEL: _words(run.plan.channels),
        AXIS: _words(LETTERS[: world.formation.dimension]),
        PAIR: _words(pairs(world.formation.dimension)),
        VERDICT: _words(verdict.label for verdict in Verdict),
        described.ROW: np.arange(1, world.formation.dimension + 1),
        described.COLUMN: np.arange(1, world.formation.dimension + 1),
        described.DERIVATIVE: np.arange(along.get(described.DERIVATIVE, 0)),
    }
    said = {TIME: {"units": "s", "long_name": "time"}}
    beside = {
        TICK: Variable((TIME,), np.arange(run.ticks), {"long_name": "number of the tick"}),
        SENDER: Variable((LINK,), links.src, {"long_name": "agent that is measured and heard"}),
        RECEIVER: Variable((LINK,), links.dst, {"long_name": "agent that measures and hears"}),
        NEIGHBOUR: Variable(
            (AGENT, SLOT),
            np.where(links.present, links.neighbours + 1.0, np.nan),
            {"long_name": "number of the neighbour in each slot"},
        ),
        LEADER: Variable((AGENT,), world.formation.is_leader, {"long_name": "whether the agent leads"}),
    }
    on_axes = {name: Variable((name,), values, said.get(name, {})) for name, values in labels.items() if name in along}
    return on_axes | beside


def variables(run: Evidence, span: Arrays) -> Iterator[tuple[str, Variable]]:
    """The arrays of consecutive ticks of a run by name, NaN where there is nothing.

    Parameters
    ----------
    run
        Of which they are.
    span
        As `affinet.verdicts.export.derived` has them, of all ticks or of some that follow each other.
    """
    for name, form in forms(run).items():
        values = span[name][: len(span["error"])]
        there = present(run, span, form, values)
        called = f"report_{name}" if name in _TAKEN else name
        yield called, Variable(form.axes, values if there is None else filled(values, there), attributes(name, form))


def closing(run: Evidence) -> dict[str, Variable]:
    """Where the last tick led: one row more than there are ticks."""
    form = forms(run)["position"]
    last = Variable(
        form.axes[1:], run.arrays["position"][-1], {"units": form.unit, "long_name": "position after the last tick"}
    )
    return {FINAL_POSITION: last}


def present(run: Evidence, span: Arrays, form: Described, values: NDArray[Any]) -> NDArray[np.bool_] | None:
    """Where an array has something to say, as broad as it is; None of one that always has."""
    if form.absent is not None:
        return np.asarray(values != form.absent)
    if described.SLOT not in form.axes or form.kind == "b":
        return None
    there = run.plan.world.links.present & (True if form.where is None else span[form.where])
    of_slots = np.broadcast_to(there, values.shape[:3])  # behind the ticks and the agents
    return np.broadcast_to(of_slots.reshape(*of_slots.shape, *[1] * (values.ndim - 3)), values.shape)


def filled(values: NDArray[Any], there: NDArray[np.bool_]) -> NDArray[Any]:
    """Numbers, NaN where there is none."""
    return np.where(there, values.astype(np.float64), np.nan)


def attributes(name: str, form: Described) -> dict[str, Any]:
    """What netCDF has beside an array."""
    said = {"long_name": form.says} | ({"units": form.unit} if form.unit else {})
    if name != _VERDICTS:
        return said
    codes: Integers = np.array([int(verdict) for verdict in Verdict], dtype=np.uint8)
    words = " ".join(verdict.label for verdict in Verdict)
    return said | {"flag_values": codes, "flag_meanings": words}


def pairs(dimension: int) -> list[str]:
    """The upper triangle of a covariance, row by row: xx, xy, yy."""
    rows, columns = np.triu_indices(dimension)
    return [LETTERS[row] + LETTERS[column] for row, column in zip(rows.tolist(), columns.tolist(), strict=True)]


def lengths(run: Evidence) -> dict[str, int]:
    """How long each axis is."""
    of = forms(run)
    return {
        axis: run.ticks if axis == TIME else size
        for name, array in run.arrays.items()
        for axis, size in zip(of[name].axes, array.shape, strict=True)
    }


def _words(words: Any) -> NDArray[Any]:
    return np.array(list(words), dtype=object)
