"""MCAP, which Foxglove and PlotJuggler open: the swarm as a scene, its faults as a log, and each number as a JSON message.

Log times are simulated times. A number that is not there, or is none, is left out of its message.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import derived, extras, foxglove, labelled, tables
from affinet.verdicts.export.foxglove import Json, Level, Rgba
from affinet.verdicts.export.tables import Column, Table
from analysis.models.arrays import Array
from netem.medium.verdict import Verdict
from netem.processes.whole import whole
from world.books.history import Arrays

_LEADER, _FOLLOWER = (1.0, 0.75, 0.1, 1.0), (0.25, 0.5, 0.95, 1.0)
_NOTHING, _HEARD, _LATE, _LOST = (0.5, 0.5, 0.5, 0.3), (0.2, 0.7, 0.3, 0.8), (0.9, 0.8, 0.1, 0.8), (0.95, 0.5, 0.1, 0.8)
_COLOURS: Mapping[int, Rgba] = {Verdict.SILENT: _NOTHING, Verdict.DELIVERED: _HEARD, Verdict.DELAYED: _LATE}
_TYPES = {"f": "number", "i": "integer", "u": "integer", "b": "boolean"}


class _Message(NamedTuple):
    topic: str
    ns: int
    says: Json


def write(run: Evidence, out: Path) -> None:
    """Write a run into a file, whole or not at all, some ticks at a time.

    Raises
    ------
    NotInstalled
        When there is no library for it.
    OSError
        When it cannot be written.
    """
    writing = extras.needed("mcap.writer", "mcap", "an MCAP file")
    with whole(out) as unfinished, unfinished.open("wb") as sink:
        writer = writing.Writer(sink)
        writer.start(library=f"affinet {version('affinet')}")
        writer.add_metadata("affinet", labelled.about(run))
        channels = _Channels(writer)
        events, first = _events(run), 0
        channels.add_all(_begun(run))
        for span in derived.by_parts(run):
            channels.add_all(_of_span(run, span, first, events))
            first += len(span["error"])
        channels.add_all(_ended(run))
        writer.finish()


class _Channels:
    """The channels of a file, each with its schema; registered when something is said on them first."""

    def __init__(self, writer: Any) -> None:
        self._writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._encoder = msgspec.json.Encoder()

    def add_all(self, messages: Iterator[tuple[_Message, Json]]) -> None:
        """Write messages, each with the schema that it has."""
        for message, schema in messages:
            if message.topic not in self._channels:
                self._channels[message.topic] = self._registered(message.topic, schema)
            data = self._encoder.encode(message.says)
            self._writer.add_message(self._channels[message.topic], message.ns, data, message.ns)

    def _registered(self, topic: str, schema: Json) -> int:
        name = schema["title"]
        if name not in self._schemas:
            data = self._encoder.encode(schema)
            self._schemas[name] = self._writer.register_schema(name, "jsonschema", data)
        channel: int = self._writer.register_channel(topic, "json", self._schemas[name])
        return channel


def _begun(run: Evidence) -> Iterator[tuple[_Message, Json]]:
    leads = run.plan.world.formation.is_leader.tolist()
    balls = [
        foxglove.ball(0, _frame(row), _width(run), _LEADER if leader else _FOLLOWER) for row, leader in enumerate(leads)
    ]
    yield _scene("/scene/agents", 0, foxglove.scene(balls))


def _ended(run: Evidence) -> Iterator[tuple[_Message, Json]]:
    level = Level.INFO if run.outcome.verdict == "pass" else Level.ERROR
    for says in (run.outcome.says, *run.outcome.reasons):
        yield _logged(_ns(run, run.ticks), level, says)


def _of_span(
    run: Evidence, span: Arrays, first: int, events: Mapping[int, list[tuple[Level, str]]]
) -> Iterator[tuple[_Message, Json]]:
    topics = _topics(run)
    made = [_Rows(name, table, topics[name]) for name, table in tables.of_span(run, span, first).items()]
    for row in range(len(span["error"])):
        ns = _ns(run, first + row)
        for level, says in events.get(first + row, ()):
            yield _logged(ns, level, says)
        yield from _seen(run, ns, span["position"][row], span["target"][row], span["verdicts"][row, 0])
        for rows in made:
            yield from rows.of_tick(row, ns)


def _seen(run: Evidence, ns: int, position: Array, target: Array, sensed: Any) -> Iterator[tuple[_Message, Json]]:
    """What there is to see of a tick: where the agents are, where they should be, and who measures whom."""
    frames = ((_frame(row), place) for row, place in enumerate(position.tolist()) if _finite(place))
    transforms, poses = foxglove.SCHEMAS[foxglove.TRANSFORMS], foxglove.SCHEMAS[foxglove.POSES]
    yield _Message("/tf", ns, foxglove.transforms(ns, frames)), transforms
    yield _Message("/targets", ns, foxglove.poses(ns, (place for place in target.tolist() if _finite(place)))), poses
    links = run.plan.world.links
    hears, heard = position[links.dst - 1], position[links.src - 1]
    halves = np.stack([hears, (hears + heard) / 2.0], axis=1)
    there = np.isfinite(halves).all(axis=(1, 2))
    colours = [_COLOURS.get(code, _LOST) for code in sensed[there].tolist()]
    ends = halves[there].reshape(-1, halves.shape[-1]).round(4).tolist()
    yield _scene("/scene/edges", ns, foxglove.scene([foxglove.lines(ns, "edges", 0.3 * _width(run), ends, colours)]))


class _Rows:
    """The rows of a table, each a message of what is there."""

    def __init__(self, name: str, table: Table, topics: list[str]) -> None:
        columns = {of: column for of, column in table.items() if of not in ("time", "agent", "neighbour")}
        self._topics, self._schema = topics, _schema(name, columns)
        self._columns = [(of, _cells(column)) for of, column in columns.items()]

    def of_tick(self, row: int, ns: int) -> Iterator[tuple[_Message, Json]]:
        """The messages of a tick."""
        for place, topic in enumerate(self._topics, start=row * len(self._topics)):
            says = {of: cells[place] for of, cells in self._columns if cells[place] is not None}
            yield _Message(topic, ns, says), self._schema


def _topics(run: Evidence) -> dict[str, list[str]]:
    """What the messages of each table are said on, row by row of a tick."""
    links = run.plan.world.links
    pairs = zip(links.dst.tolist(), links.src.tolist(), strict=True)
    return {
        "ticks": ["/swarm"],
        "agents": [f"/agents/{agent}" for agent in range(1, links.agents + 1)],
        "links": [f"/agents/{hears}/neighbours/{heard}" for hears, heard in pairs],
    }


def _schema(name: str, columns: Table) -> Json:
    properties = {
        of: {
            "type": "string" if column.words else _TYPES[column.values.dtype.kind],
            "description": f"{column.says}{f', {column.unit}' if column.unit not in ('', '1') else ''}",
        }
        for of, column in columns.items()
    }
    return {"title": f"affinet.{name}", "type": "object", "properties": properties}


def _cells(column: Column) -> list[Any]:
    """The values of a column, None where there is none that JSON could say."""
    values, there = column.values.tolist(), column.is_there & np.isfinite(column.values)
    words = column.words
    return [
        (words[value] if words else value) if is_there else None
        for value, is_there in zip(values, there.tolist(), strict=True)
    ]


def _events(run: Evidence) -> dict[int, list[tuple[Level, str]]]:
    """What the log says, by tick: faults as they begin and end."""
    said: dict[int, list[tuple[Level, str]]] = defaultdict(list)
    for bite in run.bites:
        if bite.at is not None:
            said[bite.fault.start].append(
                (Level.WARNING, f"{bite.fault.describe()}: touched {bite.touched} {bite.what}")
            )
            if bite.fault.end is not None:
                said[bite.fault.end].append((Level.INFO, bite.fault.describe_end()))
    return said


def _scene(topic: str, ns: int, says: Json) -> tuple[_Message, Json]:
    return _Message(topic, ns, says), foxglove.SCHEMAS[foxglove.SCENE]


def _logged(ns: int, level: Level, says: str) -> tuple[_Message, Json]:
    return _Message("/log", ns, foxglove.log(ns, level, says)), foxglove.SCHEMAS[foxglove.LOG]


def _frame(row: int) -> str:
    return f"agent_{row + 1}"


def _width(run: Evidence) -> float:
    """How large an agent is drawn, in metres."""
    return 0.02 * float(np.ptp(run.plan.world.formation.nominal, axis=0).max())


def _finite(place: list[float]) -> bool:
    return all(map(math.isfinite, place))


def _ns(run: Evidence, tick: int) -> int:
    return round(tick * run.dt * 1e9)
