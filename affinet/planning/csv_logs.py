"""The log of a flight as a CSV file: what was measured, what was flown, and where everybody was, in rows as they were noted.

A row with a neighbour is a measurement, one without what an agent says of itself; empty cells are gaps. A tick takes the last
measurement since the tick before, and the last input by then; positions are interpolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from affinet.scenario.words import among
from analysis.models.arrays import Array, Integers, Mask
from netem.core.listing import listed
from netem.impairments import measured
from world.physics.recorded import RecordedFlight
from world.physics.world import World

_AXES = "xyz"
_POLAR = ("range", "bearing", "elevation")
_ROUNDING = 1e-3  # of a tick: as exact as clocks of seconds since 1970 are in ticks of a millisecond
LARGEST = 1e9  # m, m/s: what no robot is, or flies
_LATEST, _TURN = 1e12, 2.0 * np.pi  # s, rad
_WHO = ("time", "agent", "neighbour")


def read(path: Path, world: World) -> RecordedFlight:
    """The flight in a file, by the ticks, agents and links of a world.

    Raises
    ------
    OSError
        When there is no such file.
    ValueError
        When it is no log of this formation's, or ends too early.
    """
    try:
        measured.refuse_endless(path)
    except measured.MeasuredError as error:
        raise ValueError(f"{path}: {error}") from error
    log = _Log(path, world)
    log.refuse_what_is_misplaced()
    log.refuse_what_is_short()
    return RecordedFlight(log.measured(), log.position(), log.input())


def columns_of(dimension: int) -> tuple[str, ...]:
    """The columns that a log may have."""
    vectors = (f"{what}_{axis}" for what in ("relative", "input", "position") for axis in _AXES[:dimension])
    return (*_WHO, *_POLAR[:dimension], *vectors)


class _Log:
    """The rows of a file, sorted by time, as columns (m,); NaN where a cell is empty."""

    def __init__(self, path: Path, world: World) -> None:
        self._path, self._world = path, world
        self._dimension = world.formation.dimension
        columns = _columns(path, columns_of(self._dimension))
        if not len(columns["time"]):
            raise ValueError(f"{path}: it has no rows")
        in_order = np.argsort(columns["time"], kind="stable")
        self._line = in_order + 2  # the first is the heading
        self._columns = {name: column[in_order] for name, column in columns.items()}
        self._every = np.arange(len(in_order))
        for name in ("time", "agent"):
            self._refuse_rows(self._every, np.isnan(self._columns[name]), f"there is no {name}")
        time = self._columns["time"]
        self._tick = _whole((time - time[0]) / world.dt)
        self._agent = self._numbers("agent")
        self._says_measured = ~np.isnan(self._columns["neighbour"])

    def refuse_what_is_misplaced(self) -> None:
        """Fail where a row says what is of rows of the other kind, and nobody would look at it."""
        every = self._every
        own = np.concatenate([self._vectors(what, every) for what in ("input", "position")], axis=-1)
        seen = np.concatenate([self._vectors("relative", every), self._polar(every)], axis=-1)
        self._refuse_rows(
            every, self._says_measured & _says_some(own), "input and position are of rows without neighbour"
        )
        self._refuse_rows(every, ~self._says_measured & _says_some(seen), "it measures, and names no neighbour")

    def refuse_what_is_short(self) -> None:
        """Fail where it ends before the run does."""
        has = float(self._tick[-1])
        if has < self._world.ticks - 1 - _ROUNDING:
            ends = has * self._world.dt
            raise ValueError(f"{self._path}: it ends after {ends:g} s: set time.duration to that, or less")

    def measured(self) -> Array:
        """What is measured on each link in each tick, shape (T, L, D); NaN where nothing is."""
        ticks, links = self._world.ticks, self._world.links
        measured = np.full((ticks, len(links), self._dimension), np.nan)
        rows = np.flatnonzero(self._says_measured)
        said, there = self._said(rows)
        kept = there & (self._tick[rows] <= ticks - 1)
        tick = np.ceil(self._tick[rows][kept]).astype(np.int64)
        place = tick * len(links) + self._links(rows)[kept]
        _, last = np.unique(place[::-1], return_index=True)  # of those of a tick and link the last stays
        measured.reshape(-1, self._dimension)[place[::-1][last]] = said[kept][::-1][last]
        return measured

    def input(self) -> Array:
        """What everybody flies from each tick on, shape (T, N, D); 0 before the log says."""
        now = np.arange(self._world.ticks)
        flown = np.zeros((self._world.ticks, self._world.links.agents, self._dimension))
        for agent, when, said in self._of_each("input"):
            last = np.searchsorted(when, now, side="right") - 1
            flown[:, agent - 1] = np.where(last[:, None] >= 0, said[last], 0.0)
        return flown

    def position(self) -> Array:
        """Where everybody is in each tick, shape (T + 1, N, D); NaN of all where the log does not say it of all."""
        now = np.arange(self._world.ticks + 1)
        position = np.full((len(now), self._world.links.agents, self._dimension), np.nan)
        for agent, when, said in self._of_each("position"):
            self._refuse_what_does_not_span(agent, when)
            for axis in range(self._dimension):
                position[:, agent - 1, axis] = np.interp(now, when, said[:, axis])
        without = (np.flatnonzero(np.isnan(position).any(axis=(0, 2))) + 1).tolist()
        if 0 < len(without) < self._world.links.agents:
            agents = listed(without)
            raise ValueError(
                f"{self._path}: it says where some agents are, and not where {agents}: say it of all, or none"
            )
        return position

    def _refuse_what_does_not_span(self, agent: int, when: Array) -> None:
        if when[0] > _ROUNDING or when[-1] < self._world.ticks - 1 - _ROUNDING:
            span = f"from {when[0] * self._world.dt:g} to {when[-1] * self._world.dt:g} s"
            raise ValueError(
                f"{self._path}: it says where agent {agent} is {span} only: a reference is of the whole run"
            )

    def _said(self, rows: Integers) -> tuple[Array, Mask]:
        """y_ij = z_i - z_j of each row, shape (m, D), and which there are (000, eq. 7); logs say where neighbours are."""
        relative, polar, sensor = self._vectors("relative", rows), self._polar(rows), self._world.sensor
        by_place, by_angle = _says_some(relative), _says_some(polar)
        self._refuse_rows(rows, by_place & by_angle, "it measures a relative position twice: give one form of it")
        needed = polar if sensor.says_positions else polar[:, 1:]
        is_half = (by_place & ~_says_all(relative)) | (by_angle & ~_says_all(needed))
        self._refuse_rows(
            rows, np.asarray(is_half), "it measures half of a relative position: give all of it, or nothing"
        )
        self._refuse_rows(rows, polar[:, 0] < 0.0, "it measures a range below 0")
        beyond = np.asarray((np.abs(polar[:, 1:]) > _TURN).any(axis=-1))
        self._refuse_rows(rows, beyond, "an angle of more than a turn: give rad")
        if not sensor.says_positions:
            length = np.linalg.norm(relative, axis=-1, keepdims=True)
            self._refuse_rows(
                rows, length[:, 0] == 0.0, "it measures no direction: the neighbour is where the agent is"
            )
            relative, polar = relative / length, np.concatenate([np.ones_like(polar[:, :1]), needed], axis=-1)
        return -np.where(by_place[:, None], relative, sensor.of_polar(polar)), by_place | by_angle

    def _polar(self, rows: Integers) -> Array:
        return self._cells(_POLAR[: self._dimension], rows)

    def _links(self, rows: Integers) -> Integers:
        index, neighbour = self._world.links.index, self._numbers("neighbour", rows)
        pairs = list(zip(neighbour.tolist(), self._agent[rows].tolist(), strict=True))
        strange = np.array([pair not in index for pair in pairs], dtype=bool)
        self._refuse_rows(rows, strange, "it measures a neighbour that is none in this formation")
        return np.array([index[pair] for pair in pairs], dtype=np.int64)

    def _of_each(self, what: str) -> Iterable[tuple[int, Array, Array]]:
        """Of each agent that says it, in which ticks, shape (m,), and what, shape (m, D)."""
        rows = np.flatnonzero(~self._says_measured)
        said = self._vectors(what, rows)
        whole = _says_all(said)
        self._refuse_rows(rows, _says_some(said) & ~whole, f"it says half of {what}: give all, or nothing")
        for agent in range(1, self._world.links.agents + 1):
            own = (self._agent[rows] == agent) & whole
            if own.any():
                yield agent, self._tick[rows[own]], said[own]

    def _vectors(self, what: str, rows: Integers) -> Array:
        return self._cells([f"{what}_{axis}" for axis in _AXES[: self._dimension]], rows)

    def _cells(self, names: Sequence[str], rows: Integers) -> Array:
        return np.stack([self._columns[name][rows] for name in names], axis=-1)

    def _numbers(self, name: str, rows: Integers | None = None) -> Integers:
        rows = self._every if rows is None else rows
        column, agents = self._columns[name][rows], self._world.links.agents
        wrong = np.asarray((column != np.round(column)) | (column < 1) | (column > agents))
        self._refuse_rows(rows, wrong, f"its {name} is none of 1 to {agents}")
        return column.astype(np.int64)

    def _refuse_rows(self, rows: Integers, wrong: Mask, why: str) -> None:
        if wrong.any():
            raise ValueError(f"{self._path}: line {self._line[rows[int(np.argmax(wrong))]]}: {why}")


def _whole(ticks: Array) -> Array:
    """Times in ticks, without the rounding of those that are whole ones."""
    nearest = np.round(ticks)
    return np.where(np.abs(ticks - nearest) <= _ROUNDING, nearest, ticks)


def _says_some(cells: Array) -> Mask:
    """Rows (m,) in which not all cells (m, n) are empty."""
    return np.asarray(~np.isnan(cells).all(axis=-1))


def _says_all(cells: Array) -> Mask:
    """Rows (m,) in which no cell (m, n) is empty."""
    return np.asarray(~np.isnan(cells).any(axis=-1))


def _columns(path: Path, known: Sequence[str]) -> dict[str, Array]:
    """The columns of a file by name, of numbers, NaN in empty cells; those that it has not are empty."""
    import pyarrow as pa  # it takes a while to import
    from pyarrow import csv

    options = csv.ConvertOptions(
        column_types=dict.fromkeys(known, pa.float64()), null_values=[""], strings_can_be_null=True
    )
    try:
        table = csv.read_csv(path, convert_options=options)
        names = table.column_names  # which may not be UTF-8
    except (pa.ArrowInvalid, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: no CSV file of numbers: {' '.join(str(error).split())}") from error
    if strange := [name for name in names if name not in known]:
        raise ValueError(f"{path}: no column {strange[0]!r} in such a log; {among(strange[0], known)}")
    if twice := [name for name in known if names.count(name) > 1]:
        raise ValueError(f"{path}: it has more than one column {twice[0]!r}")
    if missing := [name for name in _WHO[:2] if name not in names]:
        raise ValueError(f"{path}: it has no column {missing[0]!r}")
    nothing = np.full(len(table), np.nan)
    columns: dict[str, Any] = dict.fromkeys(known, nothing)
    for name in names:
        columns[name] = table[name].fill_null(np.nan).to_numpy()
    for name, column in columns.items():
        if (beyond := np.abs(column) > (_LATEST if name == "time" else LARGEST)).any():
            line = int(np.argmax(beyond)) + 2
            raise ValueError(f"{path}: line {line}: {name} is {column[line - 2]:g}, which no robot can say")
    return columns
