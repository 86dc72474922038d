"""Everything that happened in a run, as arrays, and the digest that two equal runs share."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tokenize import TokenError
from typing import Any, NamedTuple, Protocol
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray

from analysis.metrics.errors import tracking_error
from analysis.models.arrays import Array, Integers, Mask
from netem.core.refusal import Refusal
from netem.faults.timeline import Timeline
from netem.impairments.corrupt import Mark
from netem.medium.entry import Entry
from netem.medium.in_flight import newest_of
from netem.medium.verdict import Verdict, VerdictCodes
from world.books import growing
from world.books.described import BY_TICK, DERIVED
from world.physics.world import Scene, World

Arrays = dict[str, NDArray[Any]]
Reports = Mapping[str, tuple[int, ...]]  # what estimators report beyond edges, and the shape of each for one agent

ARRAYS = "arrays"  # in a run directory: a folder, with a file for each array

_SPAN = 512  # ticks that are looked at together, of arrays that may be larger than the memory

# Of each array by tick the kind of its numbers, and how many axes it has.
_BY_TICK = {name: (one.kind, len(one.axes)) for name, one in BY_TICK.items()}
TAKEN = frozenset({*BY_TICK, *DERIVED})  # names that no report can have
UNTOLD = -1  # of `feasible`: the agent is silent, or its estimator fits no map
_MARK = 3  # column of `Entry.odd`


class Moment(NamedTuple):
    """What happened in one tick, as arrays or as the nested lists that came over the wire.

    Parameters
    ----------
    position, target, input
        Where the agents are and should be, and what they fly, shape (N, D), in metres, and metres per second or per second
        squared.
    measured
        What the sensors said of every directed link, heard or not, shape (L, D), in metres.
    estimate, known, covariance
        Estimated relative positions, shape (N, n, D), in metres, where there are any, shape (N, n), and the upper triangles of
        their covariances, shape (N, n, D (D + 1) / 2), in square metres.
    psi
        Convergence indicators, shape (N,), NaN where undefined.
    feasible
        Whether what an agent sees determines a local map, 1 or 0, or `UNTOLD`, shape (N,).
    reports
        What else the agents' estimators said, by name, shape (N, *), NaN of those who did not.
    entry
        What became of the messages.
    """

    position: Any
    target: Any
    measured: Any
    input: Any
    estimate: Any
    known: Any
    covariance: Any
    psi: Any
    feasible: Any
    reports: Mapping[str, Any]
    entry: Entry


@dataclass(frozen=True)
class Moments:
    """Consecutive ticks; every array begins with them. Messages that arrived late, or were dropped under way, are counted.

    Parameters
    ----------
    first
        The first tick.
    position, measured, input, estimate, known, covariance, psi, feasible, reports
        As of a `Moment`.
    verdicts
        Verdicts on what was offered, shape (T, C, L).
    target
        Where the manoeuvre wants the agents, shape (T, N, D), in metres.
    error
        Tracking error (15), shape (T,), in square metres.
    newest
        The tick of which the newest arriving content speaks, -1 where nothing arrives, shape (T, C, L).
    copies, late
        How many messages were doubled, and how many arrived late, shape (T,).
    dropped
        How many were dropped under way, by verdict, shape (T, verdicts).
    """

    first: int
    position: Array
    measured: Array
    input: Array
    estimate: Array
    known: Mask
    covariance: Array
    psi: Array
    feasible: NDArray[np.int8]
    reports: Mapping[str, Array]
    verdicts: VerdictCodes
    newest: NDArray[np.int32]
    copies: Integers
    late: Integers
    dropped: Integers
    target: Array
    error: Array

    @property
    def ticks(self) -> Integers:
        """Their numbers, shape (T,)."""
        return np.arange(self.first, self.first + len(self.error))


def gather(timeline: Timeline, first: int, moments: Sequence[Moment]) -> Moments:
    """Consecutive moments as arrays, with what they are measured against."""
    ticks = np.arange(first, first + len(moments))
    where, target = (np.array([getattr(moment, name) for moment in moments]) for name in ("position", "target"))
    entries = [moment.entry for moment in moments]
    verdicts = np.array([entry.verdicts for entry in entries], dtype=np.uint8)
    return Moments(
        first=first,
        position=where,
        measured=np.array([moment.measured for moment in moments]),
        input=np.array([moment.input for moment in moments]),
        estimate=np.array([moment.estimate for moment in moments]),
        known=np.array([moment.known for moment in moments], dtype=bool),
        covariance=np.array([moment.covariance for moment in moments]),
        psi=np.array([moment.psi for moment in moments]),
        feasible=np.array([moment.feasible for moment in moments], dtype=np.int8),
        reports={name: np.array([moment.reports[name] for moment in moments]) for name in moments[0].reports},
        verdicts=verdicts,
        newest=_newest(ticks, verdicts, entries),
        copies=np.array([entry.copies for entry in entries]),
        late=np.array([entry.late for entry in entries]),
        dropped=np.array([entry.dropped_by_verdict for entry in entries]),
        target=target,
        error=tracking_error(where, target, timeline.present(ticks.tolist())),
    )


def _newest(ticks: Integers, verdicts: VerdictCodes, entries: Sequence[Entry]) -> NDArray[np.int32]:
    newest = np.where(verdicts == Verdict.DELIVERED, ticks[:, None, None], -1)
    for row, entry in enumerate(entries):
        marked = entry.odd[entry.odd[:, _MARK] != Mark.NONE]
        newest[row, marked[:, 0], marked[:, 1]] = -1
        if len(entry.apart):
            newest[row] = newest_of(newest[row], entry.apart)
    return newest.astype(np.int32)


class Goals(Protocol):
    """What says where agents should be."""

    def goal(self, tick: int, scene: Scene) -> Array:
        """Shape (N, D), in metres."""


class ErrorMonitor:
    """Follows the tracking error tick by tick, where a fault waits for it: as far back as one does."""

    def __init__(self, world: Goals) -> None:
        self._world = world
        self._errors: Array = np.empty(0)

    @property
    def errors(self) -> Array:
        """Of the last ticks, shape (T,), in square metres."""
        return self._errors

    def see(self, tick: int, scene: Scene, timeline: Timeline) -> None:
        """Take in a tick, if anything waits for it."""
        if timeline.pending:
            goal = self._world.goal(tick, scene)
            now = tracking_error(scene.position, goal, ~timeline.at(tick).absent)
            longest = max(timeline.triggers[number].ticks for number in timeline.pending)
            self._errors = np.append(self._errors, now)[-longest:]


class History:
    """The moments of a run, gathered in memory; arrays begin with the ticks."""

    def __init__(self, world: World, channels: int, reports: Mapping[str, tuple[int, ...]]) -> None:
        links, ticks = world.links, world.ticks
        agents, width, dimension = links.agents, links.slots.shape[1], world.formation.dimension
        self.ticks = 0
        self.position = np.zeros((ticks + 1, agents, dimension))
        self.measured = np.zeros((ticks, len(links), dimension))
        self.target = np.zeros((ticks, agents, dimension))
        self.error = np.full(ticks, np.nan)
        self.input = np.zeros((ticks, agents, dimension))
        self.estimate = np.zeros((ticks, agents, width, dimension))
        self.known = np.zeros((ticks, agents, width), dtype=bool)
        self.covariance = np.zeros((ticks, agents, width, dimension * (dimension + 1) // 2))
        self.psi = np.full((ticks, agents), np.nan)
        self.feasible = np.full((ticks, agents), UNTOLD, dtype=np.int8)
        self.reports = {name: np.full((ticks, agents, *shape), np.nan) for name, shape in reports.items()}
        self.verdicts = np.zeros((ticks, channels, len(links)), dtype=np.uint8)
        self.newest = np.full((ticks, channels, len(links)), -1, dtype=np.int32)
        self.copies = np.zeros(ticks, dtype=np.int64)
        self.late = np.zeros(ticks, dtype=np.int64)
        self.dropped = np.zeros((ticks, len(Verdict)), dtype=np.int64)

    def extend(self, moments: Moments, next_position: Array) -> None:
        """Take in the next ticks, and where they led."""
        span = slice(self.ticks, self.ticks + len(moments.error))
        for name in _BY_TICK:
            getattr(self, name)[span] = getattr(moments, name)
        for name, values in moments.reports.items():
            self.reports[name][span] = values
        self.position[span.stop] = next_position
        self.ticks = span.stop

    def arrays(self) -> Arrays:
        """All arrays by name, up to the last tick."""
        by_tick = {name: getattr(self, name)[: self.ticks] for name in _BY_TICK}
        said = {name: values[: self.ticks] for name, values in self.reports.items()}
        return by_tick | said | {"position": self.position[: self.ticks + 1]}


def forms(world: World, channels: int, reports: Reports) -> Arrays:
    """The arrays of a run over this world before its first tick.

    Parameters
    ----------
    world, channels, reports
        What is flown, over how many channels, and what estimators report.
    """
    before = History(replace(world, ticks=0), channels, reports)
    return before.arrays() | {"position": before.position[:0]}


def file_of(name: str) -> str:
    """The file of an array in the folder of a run's arrays."""
    return quote(name, safe="") + growing.ENDING


# What NumPy says of an array that is not whole; an `OSError` of an open file is that of a place in it that cannot be.
_UNREADABLE = (
    ValueError, TypeError, EOFError, MemoryError, OverflowError, RuntimeError, LookupError, SyntaxError, OSError, TokenError,
)  # fmt: skip


class Damaged(Refusal, ValueError):
    """What lies in a run directory is not what the run wrote: which file, what is wrong in it, and the way out.

    Parameters
    ----------
    file
        The file.
    why
        What is wrong in it.
    """

    def __init__(self, file: Path, why: str) -> None:
        super().__init__(file, why)
        self.file, self.why = file, " ".join(why.split())

    def __str__(self) -> str:
        return f"{self.file}: not what a run wrote there: {self.why}; fly the run again, or restore the file"


def load(folder: Path, only: Collection[str] | None = None, *, mapped: bool = False) -> Arrays:
    """The arrays of a run by name, as far as they were written; those that are large are mapped, and cannot be written to.

    Parameters
    ----------
    folder
        Which has them.
    only
        Names of those that are wanted, by default all.
    mapped
        Whether those that are small are mapped too.

    Raises
    ------
    FileNotFoundError
        When the run never wrote them.
    Damaged
        When they are not whole, or not those of a run any more.
    """
    files = [file for file in sorted(folder.iterdir()) if file.suffix == growing.ENDING]
    arrays = {unquote(file.stem): read(file, mapped=mapped) for file in files}
    try:
        whole = _up_to_the_last_tick(arrays)
        _refuse_other_forms(whole)
    except ValueError as error:
        raise Damaged(folder, str(error)) from error
    return whole if only is None else {name: whole[name] for name in only}


def read(file: Path, *, mapped: bool = False) -> NDArray[Any]:
    """One array of a run.

    Raises
    ------
    Damaged
        When it is not there, or not whole.
    """
    try:
        return growing.read(file, mapped=mapped)
    except _UNREADABLE as error:
        raise Damaged(file, str(error)) from error


def _up_to_the_last_tick(arrays: Arrays) -> Arrays:
    """The arrays up to the last tick that all of them have: who was killed while he wrote had not come to the others."""
    if missing := [name for name in _BY_TICK if name not in arrays]:
        raise ValueError(f"it has no {', '.join(missing)}")
    if single := [name for name, array in arrays.items() if not array.ndim]:
        raise ValueError(f"{single[0]} is a single number")
    ticks = min(len(array) - (name == "position") for name, array in arrays.items())
    return {name: array[: ticks + (name == "position")] for name, array in arrays.items()}


def refuse_those_of_another(path: Path, arrays: Arrays, world: World, channels: int, reports: Reports) -> None:
    """Refuse arrays that no run over this world has left.

    Parameters
    ----------
    path
        Of the file that has them.
    arrays
        As read from it.
    world, channels, reports
        What they would be of: the world, how many channels, and what estimators report.

    Raises
    ------
    Damaged
        When they have other names, numbers, agents, links, channels or axes, or more ticks.
    """
    due = forms(world, channels, reports)
    for name in sorted(due.keys() | arrays.keys()):
        said, wanted = form(arrays.get(name)), form(due.get(name))
        if said != wanted:
            raise Damaged(path, f"{name} is {said} in a tick, where its scenario makes it {wanted}")
    if (ticks := len(arrays["error"])) > world.ticks:
        raise Damaged(path, f"it has {ticks} ticks, where its scenario has {world.ticks}")


def form(array: NDArray[Any] | None) -> str:
    """What kind of numbers an array has, and how many of them in a tick."""
    return "missing" if array is None else f"{array.dtype} {array.shape[1:]}"


def _refuse_other_forms(arrays: Arrays) -> None:
    for name, array in arrays.items():
        kind, axes = _BY_TICK.get(name, ("f", max(2, array.ndim)))
        if (array.dtype.kind, array.ndim) != (kind, axes):
            raise ValueError(f"{name} is {array.dtype} of shape {array.shape}")
    largest = max((int(span.max(initial=0)) for span in _spans(arrays["verdicts"])), default=0)
    if largest >= len(Verdict):
        raise ValueError(f"verdicts has a {largest}, which is no verdict")
    if (columns := arrays["dropped"].shape[1]) != len(Verdict):
        raise ValueError(f"dropped counts {columns} verdicts, and there are {len(Verdict)}")


def by_span(arrays: Arrays) -> Iterator[Arrays]:
    """The arrays of consecutive ticks, of so many at a time that they are small; the last has where the last tick led."""
    ticks = len(arrays["error"])
    for first in range(0, max(ticks, 1), _SPAN):
        end = first + _SPAN if first + _SPAN < ticks else None
        yield {name: array[first:end] for name, array in arrays.items()}
        growing.let_go(arrays)


def digest(arrays: Arrays) -> str:
    """SHA-256 over positions, inputs, estimates, indicators and verdicts, bit for bit.

    It is the same in either runtime. Between CPUs it is as far as OpenBLAS takes the same kernels for products and inverses:
    set OPENBLAS_CORETYPE alike to compare (docs/decisions/0001).
    """
    total = hashlib.sha256()
    for name, array in _digested(arrays):
        total.update(f"{name}{array.dtype.str}{array.shape}".encode())
        for span in _spans(array):
            total.update(one_nan(span).tobytes())
    return total.hexdigest()


def _spans(array: NDArray[Any]) -> Iterator[NDArray[Any]]:
    for first in range(0, len(array), _SPAN):
        yield array[first : first + _SPAN]
        growing.let_go({"it": array})


def _digested(arrays: Arrays) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays by name, and what was dropped under way by each reason that occurred: a new one changes no older run."""
    for name, array in sorted(arrays.items()):
        if name == "dropped":
            occurred = {number for span in _spans(array) for number in np.flatnonzero(span.any(axis=0)).tolist()}
            yield from ((f"{name} {Verdict(number).label}", array[:, number]) for number in sorted(occurred))
        else:
            yield name, array


def one_nan(array: NDArray[Any]) -> NDArray[Any]:
    """The array, contiguous, with one NaN for all: of what sign the others are is up to the CPU."""
    contiguous = np.ascontiguousarray(array)
    return np.where(np.isnan(contiguous), np.nan, contiguous) if contiguous.dtype.kind == "f" else contiguous
