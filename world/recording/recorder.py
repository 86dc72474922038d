"""A run as a Rerun recording, in parts each of which opens by itself, and to a viewer when one listens.

Many ticks are logged at once, as columns: that is several times cheaper than tick by tick. What is shown is in layers.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

import rerun as rr

from analysis.models.information import reported
from netem.core.channels import PLACE, THETA
from netem.core.parts import part
from netem.faults.timeline import Timeline
from netem.processes import system_errors
from world.books.history import Moments, Reports
from world.books.kept import Kept
from world.books.realised import Realised
from world.brief import RecordOptions
from world.physics.world import World
from world.recording.believed import Believed
from world.recording.curves import ConsistencyCurves, MapCurves, TrackingCurves
from world.recording.file import NotRecorded, listens, make_room, writing, wrong_with
from world.recording.graphs import GraphCurves
from world.recording.layout import Shown, blueprint
from world.recording.links import MOST_IN_A_MATRIX, AgeMatrix, Graph, MessageCurves, SpaceTime
from world.recording.lives import Lives, log_kept
from world.recording.perceived import PerceivedFormations
from world.recording.places import Places
from world.recording.scenery import Surroundings
from world.recording.stage import Layer, Stage, Stretch
from world.recording.swarm import Swarm
from world.recording.target import Pursued

_FLUSH_S = 20.0
LARGEST = (
    2**23
)  # bytes, after which the next part begins: the library holds 0.7 kB of each chunk of one, for its ending


class Recorder:
    """Writes `run.rrd`, in parts each of which opens by itself, and streams to a viewer when one listens.

    Parameters
    ----------
    path
        Of the first part.
    run
        What tells it from all others: a viewer takes recordings that share it for one.
    name
        What people call it.
    world
        What is flown.
    reports
        What the agents' estimators report, by name, and the shape of each for one agent: it decides what is shown.
    books
        How it is written down.
    in_real_time
        Whether processes have a time to keep.

    Raises
    ------
    OSError
        When it cannot be written; when it is closed at the latest.
    """

    def __init__(
        self,
        path: Path,
        *,
        run: str,
        name: str,
        world: World,
        reports: Reports,
        books: RecordOptions,
        in_real_time: bool = False,
    ) -> None:
        self._every, self._settings = books.every, books.settings
        self._first_part, self._path, self._parts = path, path, 0
        self._name, self._viewer = name, books.viewer
        self._stream = rr.RecordingStream("affinet", recording_id=run)
        if not rr.is_enabled(self._stream):
            raise NotRecorded(
                f"{path} cannot be written: RERUN={os.environ.get('RERUN')} in the environment turns the recording off; "
                "unset it, or set record.enabled=false"
            )
        self._stage = Stage(self._stream, world)
        shown = _shown(world, reports, in_real_time=in_real_time)
        self._blueprint = blueprint(world, shown, self._stage.reach, books.every)
        self._layers = _layers(self._stage, world, books, shown)
        self._begin()

    def record(self, moments: Moments, timeline: Timeline, realised: Realised) -> None:
        """Write consecutive ticks; the first must be one that is recorded, a multiple of `every`."""
        if self._path.exists() and self._path.stat().st_size >= LARGEST:
            self._begin()
        kept = slice(None, None, self._every)
        ticks = moments.ticks[kept].tolist()
        stretch = Stretch(
            moments=moments,
            timeline=timeline,
            realised=realised,
            ticks=ticks,
            kept=kept,
            time=self._stage.times(ticks),
            position=moments.position[kept] - self._stage.origin,
            target=moments.target[kept] - self._stage.origin,
            conditions=[timeline.at(tick) for tick in ticks],
            present=timeline.present(ticks),
        )
        for layer in self._layers:
            layer.log(stretch)

    def record_kept(self, kept: Sequence[Kept]) -> None:
        """Write how late processes were."""
        log_kept(self._stage, kept, self._every)

    def close(self) -> None:
        """End the file.

        Raises
        ------
        OSError
            When it is not whole.
        """
        with system_errors.afterwards(self._stream.disconnect):
            self._flush()
        _refuse_what_breaks_off(self._path)

    def _begin(self) -> None:
        """Begin the next part, which ends the one before."""
        before, self._parts = self._path, self._parts + 1
        self._path = part(self._first_part, self._parts)
        make_room(self._path)
        viewers = [rr.GrpcSink(self._viewer)] if self._viewer and listens(self._viewer) else []
        # The layout once: of each that it is given the library keeps two threads and a mebibyte to the end of the run.
        layout = self._blueprint if self._parts == 1 else None
        with writing(self._path):
            self._stream.set_sinks(rr.FileSink(str(self._path)), *viewers, default_blueprint=layout)
        if before != self._path:
            _refuse_what_breaks_off(before)
        self._stream.send_recording_name(self._name)
        self._stage.still("settings", rr.TextDocument(self._settings, media_type="text/markdown"))
        for layer in self._layers:
            layer.begin()
        self._flush()  # what a killed run leaves can be read from the first tick on

    def _flush(self) -> None:
        try:
            with writing(self._path):
                self._stream.flush(timeout_sec=_FLUSH_S)  # without end it would wait for a writer that has given up
        except NotRecorded:
            if self._viewer is None:  # else it may be gone, and whether the file is whole shows when it is closed
                raise


def _refuse_what_breaks_off(path: Path) -> None:
    if wrong := wrong_with(path):
        raise NotRecorded(wrong)


def _shown(world: World, reports: Reports, *, in_real_time: bool) -> Shown:
    localizes, pursues = PLACE in reports, world.pursuit is not None and reported(reports)
    return Shown(
        localizes=localizes,
        pursues=pursues,
        maps=reports.get(THETA) == (world.formation.dimension,) * 2,
        edges=not (localizes or pursues),
        in_real_time=in_real_time,
    )


def _layers(stage: Stage, world: World, books: RecordOptions, shown: Shown) -> list[Layer]:
    agents, links = world.formation.agents, world.links
    wanted: list[tuple[Layer, bool]] = [
        (Surroundings(stage, books.scenery), True),
        (Graph(stage, world), True),
        (Swarm(stage, world), True),
        (Believed(stage), shown.edges),
        (PerceivedFormations(stage, world), shown.maps),
        (Places(stage, world), shown.localizes),
        (Pursued(stage, world), shown.pursues),
        (TrackingCurves(stage, world), not shown.localizes),
        (MapCurves(stage, agents), shown.maps),
        (ConsistencyCurves(stage, world), shown.edges),
        (MessageCurves(stage, books.every), True),
        (GraphCurves(stage), True),
        (AgeMatrix(stage, links), agents <= MOST_IN_A_MATRIX),
        (SpaceTime(stage, links, books.every), True),
        (Lives(stage, agents), True),
    ]
    return [layer for layer, is_shown in wanted if is_shown]
