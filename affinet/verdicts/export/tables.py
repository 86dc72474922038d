"""The arrays of a run as three tables of columns, each array in the one whose rows it has something to say of.

`ticks` has a row for each tick, `agents` for each tick and agent, `links` for each tick, agent and neighbour: what the agent
believes of the neighbour, and what it measured and heard of it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import labelled
from analysis.models.arrays import Integers
from netem.medium.verdict import Verdict
from world.books.described import AGENT, AXIS, CHANNEL, DERIVATIVE, LINK, PAIR, SLOT, TIME, VERDICT, Described
from world.books.history import Arrays

NAMES = ("ticks", "agents", "links")
_WORDS = tuple(verdict.label for verdict in Verdict)


class Column(NamedTuple):
    """Of a table.

    Parameters
    ----------
    values
        One for each row.
    unit, says
        As in `world.books.described.Described`.
    there
        Where there is a value; None where NaN alone says that there is none.
    words
        What whole numbers stand for, if they stand for words.
    """

    values: NDArray[Any]
    unit: str
    says: str
    there: NDArray[np.bool_] | None = None
    words: tuple[str, ...] = ()

    @property
    def is_there(self) -> NDArray[np.bool_]:
        """Where there is a value."""
        stated = np.ones(len(self.values), dtype=bool) if self.there is None else self.there
        return stated & ~np.isnan(self.values) if self.values.dtype.kind == "f" else stated


Table = Mapping[str, Column]


def of_span(run: Evidence, span: Arrays, first: int) -> Mapping[str, Table]:
    """The tables, by name, of ticks that follow each other.

    Parameters
    ----------
    run
        Of which they are.
    span
        Its arrays in these ticks, as `affinet.verdicts.export.derived` has them.
    first
        The first of them.
    """
    ticks = np.arange(first, first + len(span["error"]))
    made = {name: dict(_keys(run, name, ticks)) for name in NAMES}
    for name, form in labelled.forms(run).items():
        values = span[name][: len(ticks)]
        table, rows = _placed(run, form, values)
        there = labelled.present(run, span, form, values)
        stated = None if there is None else _placed(run, form, there)[1]
        for ending, at in _columns(run, form, rows.shape):
            where = None if stated is None else stated[at].reshape(-1)
            words = _WORDS if form.axes == (TIME, CHANNEL, LINK) and form.kind == "u" else ()
            called = f"{'verdict' if words else name}{ending}"
            called = f"report_{called}" if called in made[table] else called
            made[table][called] = Column(rows[at].reshape(-1), form.unit, form.says, where, words)
    return made


def _keys(run: Evidence, table: str, ticks: Integers) -> Iterator[tuple[str, Column]]:
    links = run.plan.world.links
    each = {"ticks": 1, "agents": links.agents, "links": len(links)}[table]
    yield "time", Column(np.repeat(ticks.astype(np.float64) * run.dt, each), "s", "time")
    yield "tick", Column(np.repeat(ticks, each), "1", "number of the tick")
    if table == "agents":
        yield "agent", Column(np.tile(np.arange(1, links.agents + 1), len(ticks)), "1", "number of the agent")
    if table == "links":
        yield "agent", Column(np.tile(links.dst, len(ticks)), "1", "who measures and hears")
        yield "neighbour", Column(np.tile(links.src, len(ticks)), "1", "who is measured and heard")


def _placed(run: Evidence, form: Described, values: NDArray[Any]) -> tuple[str, NDArray[Any]]:
    """In which table an array is, and the array with the axes of its rows in front: ticks, then agents or links."""
    if SLOT in form.axes:
        return "links", values[:, run.plan.world.links.present]  # links are in the order of agents and their slots
    if LINK in form.axes:
        return "links", np.moveaxis(values, form.axes.index(LINK), 1)
    return ("agents" if AGENT in form.axes else "ticks"), values


def _columns(run: Evidence, form: Described, shape: tuple[int, ...]) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """How the columns end that an array makes, and where in it each lies."""
    rows = 1 if not {AGENT, LINK} & {*form.axes} else 2
    within = [axis for axis in form.axes if axis not in (TIME, AGENT, SLOT, LINK)]
    for place in np.ndindex(*shape[rows:]):
        said = (_label(run, axis, number) for axis, number in zip(within, place, strict=True))
        yield "".join(f"_{one}" for one in said), (slice(None),) * rows + place


def _label(run: Evidence, axis: str, number: int) -> str:
    words: Mapping[str, Sequence[str]] = {
        AXIS: labelled.LETTERS,
        PAIR: labelled.pairs(run.plan.world.formation.dimension),
        CHANNEL: run.plan.channels,
        VERDICT: _WORDS,
    }
    return words[axis][number] if axis in words else str(number + (axis != DERIVATIVE))
