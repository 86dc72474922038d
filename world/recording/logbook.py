"""What the world of a run leaves to look at while it flies: realised graph and recording, a batch of ticks at a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

import pyarrow as pa

from netem.core.arrow import NAMES, Stream, named
from netem.core.pace import Pace
from netem.faults.timeline import Timeline
from netem.processes import system_errors
from world.books.history import Moments, Reports
from world.books.kept import Kept
from world.books.realised import GraphWatch, columns
from world.books.spans import Spans
from world.books.timing import TimingWriter
from world.brief import RecordOptions
from world.physics.world import World
from world.recording.file import RECORDING

if TYPE_CHECKING:
    from world.recording.recorder import Recorder

GRAPH = "graph.arrows"
GRAPH_SCHEMA = pa.schema(
    [
        ("tick", pa.int32()),
        ("channel", NAMES),
        ("links", pa.int32()),
        ("connectivity", pa.float64()),
        ("joint_connectivity", pa.float64()),
        ("stress_dimension", pa.int32()),
        ("mean_age_s", pa.float64()),
        ("feasible", pa.int32()),
    ]
)


class RunWriter:
    """Writes the realised graph, and the recording if one is wanted.

    Parameters
    ----------
    out, run
        The run directory, and a name that no other run has.
    world, channels, reports
        What is flown, and what estimators report of it.
    books, pace
        How to write it down, and how time goes in a run in real time.

    Raises
    ------
    OSError
        When something cannot be written, from the first byte to the last: which file, and why.
    """

    def __init__(
        self,
        out: Path,
        run: str,
        world: World,
        channels: Sequence[str],
        reports: Reports,
        books: RecordOptions,
        pace: Pace | None = None,
    ) -> None:
        self._every, self._spans = books.every, Spans(books.every)
        self._channels = list(channels)
        self._out = out
        self._graph = Stream(out / GRAPH, GRAPH_SCHEMA)
        self._watch = GraphWatch(world.formation, world.links, world.dt, books.window)
        self._timing = None if pace is None else TimingWriter(out)
        self._recorder: Recorder | None = None
        if books.record:
            from world.recording.recorder import Recorder  # Rerun takes a second to import: for those who record

            self._recorder = Recorder(
                out / RECORDING,
                run=run,
                name=out.absolute().name,
                world=world,
                reports=reports,
                books=books,
                in_real_time=pace is not None,
            )

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        def close_graph() -> None:
            with system_errors.about(self._out / GRAPH):
                self._graph.close()

        others = [open_file.close for open_file in (self._timing, self._recorder) if open_file]
        closing = [self._write_the_rest, close_graph, *others]
        with system_errors.afterwards(*closing):
            if error is not None:
                raise error

    def write(self, moments: Moments, timeline: Timeline) -> None:
        """Write down consecutive ticks, flown under this timeline, once all are known that one recorded moment stands for."""
        self._timeline = timeline
        if whole := self._spans.whole(moments):
            self._write(whole)

    def _write_the_rest(self) -> None:
        if rest := self._spans.rest():
            self._write(rest)

    def _write(self, moments: Moments) -> None:
        realised = self._watch.follow(moments.first, moments.newest, self._timeline, self._every)
        table = columns(realised, self._channels)
        with system_errors.about(self._out / GRAPH):
            self._graph.write({**table, "channel": named(table["channel"], self._channels)})
        if self._recorder:
            self._recorder.record(moments, self._timeline, realised)

    def write_kept(self, kept: Sequence[Kept]) -> None:
        """Write down how processes kept their time."""
        if self._timing:
            self._timing.write(kept)
            if self._recorder:
                self._recorder.record_kept(kept)
