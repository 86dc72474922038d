"""A run as a Rerun recording: trajectories, graphs, target, indicators, verdicts and events on simulated time.

Many ticks are logged at once, as columns: that is several times cheaper than tick by tick.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from analysis.metrics import consistency
from analysis.metrics.errors import procrustes_error
from analysis.models.arrays import Array, Mask
from analysis.models.information import reported
from analysis.models.reports import NIS
from netem.core.channels import PLACE, THETA
from netem.core.parts import part
from netem.faults.timeline import Conditions, Timeline
from netem.medium.verdict import REASONS, Verdict, VerdictCodes
from netem.processes import system_errors
from world.books.edges import of_swarms
from world.books.history import Moments, Reports
from world.books.kept import Kept
from world.books.realised import Realised
from world.formation.nominal import Formation
from world.physics.world import World
from world.recording.file import NotRecorded, listens, make_room, writing, wrong_with
from world.recording.perceived import PerceivedFormations
from world.recording.places import Places
from world.recording.stage import TIMELINE, origin, scalars, spatial
from world.recording.target import Pursued

_LEADER, _FOLLOWER = 0xF2B705FF, 0x3FA7F5FF
_DEAD, _PAUSED, _DEPARTED, _VANISHED = 0x7A1F1FFF, 0xB388FFFF, 0x6E6E6EFF, 0x00000000
_LINK_COLOURS = {
    Verdict.SILENT: 0x00000000,
    Verdict.DELIVERED: 0x3DDC84FF,
    Verdict.DELAYED: 0x9AD0FFFF,
    Verdict.DEAD: 0x7A1F1FFF,
    Verdict.PAUSED: 0xB388FFFF,
    Verdict.DEPARTED: 0x6E6E6EFF,
    Verdict.CUT: 0xFF3B30FF,
    Verdict.PARTITION: 0xC86BFFFF,
    Verdict.SCRIPTED: 0xFF6B6BFF,
    Verdict.DROPOUT: 0xFF80ABFF,
    Verdict.CLOSED: 0x4A4A4AFF,
    Verdict.RANGE: 0x8D6E63FF,
    Verdict.JAMMED: 0xFFEB3BFF,
    Verdict.LISTED: 0xFFCC80FF,
    Verdict.LOST: 0xFF9F1CFF,
    Verdict.OVERFLOW: 0x26C6DAFF,
    Verdict.UNSAID: 0xF48FB1FF,
}
_FLUSH_S = 20.0
LARGEST = (
    2**23
)  # bytes, after which the next part begins: the library holds 0.7 kB of each chunk of one, for its ending
Layer = Places | Pursued | PerceivedFormations
_COUNTED = (Verdict.DELIVERED, Verdict.DELAYED, *REASONS)


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
    every
        Ticks from one recorded moment to the next; messages are counted over all of them.
    viewer
        URL of a viewer that is listening already.
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
        every: int,
        viewer: str | None = None,
        in_real_time: bool = False,
    ) -> None:
        self._world = world
        self._formation = world.formation
        self._links = world.links
        self._dt = world.dt
        self._every = every
        self._edges = np.array(world.formation.edges, dtype=np.int64) - 1
        self._first_part, self._path, self._parts = path, path, 0
        self._name, self._viewer = name, viewer
        self._stream = rr.RecordingStream("affinet", recording_id=run)
        if not rr.is_enabled(self._stream):
            raise NotRecorded(
                f"{path} cannot be written: RERUN={os.environ.get('RERUN')} in the environment turns the recording off; "
                "unset it, or set record.enabled=false"
            )
        shown = _shown(world, reports)
        self._blueprint = _blueprint(world.formation, shown, in_real_time=in_real_time)
        self._origin = origin(world)
        self._layers = [layer(self._stream, world, self._origin) for layer in shown]
        self._begin()

    def record(self, moments: Moments, timeline: Timeline, realised: Realised) -> None:
        """Write consecutive ticks; the first must be one that is recorded, a multiple of `every`."""
        if self._path.exists() and self._path.stat().st_size >= LARGEST:
            self._begin()
        self._log_events(moments, timeline)
        kept = slice(None, None, self._every)
        time = [rr.TimeColumn(TIMELINE, duration=(moments.ticks[kept] * self._dt).tolist())]
        position, target = moments.position[kept] - self._origin, moments.target[kept] - self._origin
        self._log_agents(time, [timeline.at(tick) for tick in moments.ticks[kept].tolist()], position)
        self._log_graph(time, position, target, moments.verdicts[kept, 0])
        self._scalars("metrics/tracking_error", time, moments.error[kept, None])
        present = timeline.present(moments.ticks[kept].tolist())
        shape = procrustes_error(moments.position[kept], self._formation.nominal, present)
        self._scalars("metrics/procrustes", time, shape[:, None])
        self._scalars("metrics/psi", time, moments.psi[kept])
        self._log_consistency(time, moments, kept, present)
        numbers = np.arange(1.0, self._formation.agents + 1.0)
        self._scalars("metrics/infeasible", time, np.where(moments.feasible[kept] == 0, numbers, np.nan))
        self._scalars("metrics/messages", time, self._messages_per_tick(moments))
        self._log_realised(time, realised)
        for layer in self._layers:
            layer.log(time, moments, kept, timeline)

    def record_kept(self, kept: Sequence[Kept]) -> None:
        """Write how late processes were, in milliseconds, in the ticks that are recorded."""
        shown = [one for one in kept if one.tick % self._every == 0]
        for process in sorted({one.process for one in shown}):
            of_process = [one for one in shown if one.process == process]
            time = [rr.TimeColumn(TIMELINE, duration=[one.tick * self._dt for one in of_process])]
            late = np.array([[1000.0 * one.late] for one in of_process])
            self._scalars(f"timing/{process.replace(' ', '_')}", time, late)

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
        self._log_static()
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

    def _log_static(self) -> None:
        numbers = [str(agent) for agent in range(1, self._formation.agents + 1)]
        reach = float(np.ptp(self._formation.nominal, axis=0).max())
        here = f"({', '.join(f'{axis:.0f}' for axis in self._origin)})"
        static = [
            ("origin", rr.TextDocument(f"positions are relative to {here} m")),
            ("swarm/agents", rr.Points3D.from_fields(radii=0.03 * reach, labels=numbers)),
            ("swarm/trail", rr.Points3D.from_fields(radii=rr.Radius.ui_points(1.0))),
            ("swarm/target", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.7), colors=0x8888AA60)),
            (
                "swarm/graph/nominal",
                rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=0x55555580),
            ),
            ("swarm/graph/functional", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(1.8))),
            ("metrics/tracking_error", rr.SeriesLines(names="tracking error (m²)", colors=0xFFFFFFFF)),
            ("metrics/procrustes", rr.SeriesLines(names="Procrustes error (m)", colors=0xFFFFFFFF)),
            ("metrics/psi", rr.SeriesLines(names=[f"psi {number}" for number in numbers])),
            ("metrics/infeasible", rr.SeriesPoints(names=[f"agent {number}" for number in numbers], marker_sizes=2.0)),
            (
                "metrics/consistency",
                rr.SeriesLines(
                    names=["NEES", "NIS", *(f"{consistency.DRAWN:.0%} {end}" for end in ("from", "to"))],
                    colors=np.array([0x3DDC84FF, 0x3FA7F5FF, 0xAAAAAAFF, 0xAAAAAAFF], dtype=np.uint32),
                ),
            ),
            (
                "graph/connectivity",
                rr.SeriesLines(
                    names=["sensing", "comms", "sensing, joint", "comms, joint"],
                    colors=np.array([0x3DDC8480, 0x3FA7F580, 0x3DDC84FF, 0x3FA7F5FF], dtype=np.uint32),
                ),
            ),
            (
                "graph/age",
                rr.SeriesLines(
                    names=["sensing (s)", "comms (s)"], colors=np.array([0x3DDC84FF, 0x3FA7F5FF], dtype=np.uint32)
                ),
            ),
            (
                "graph/rigidity",
                rr.SeriesLines(
                    names=["feasible agents", "stress dimension, joint"],
                    colors=np.array([0xF2B705FF, 0xC86BFFFF], dtype=np.uint32),
                ),
            ),
            (
                "metrics/messages",
                rr.SeriesLines(
                    names=[verdict.label for verdict in _COUNTED],
                    colors=[_LINK_COLOURS[verdict] for verdict in _COUNTED],
                ),
            ),
        ]
        for path, what in static:
            self._stream.log(path, what, static=True)

    def _log_events(self, moments: Moments, timeline: Timeline) -> None:
        said = [(tick, *line) for tick in moments.ticks.tolist() for line in _said_of(timeline, tick)]
        if said:  # all at once: of each row that is logged by itself the library keeps something to the end of the run
            ticks, texts, levels = zip(*said, strict=True)
            time = [rr.TimeColumn(TIMELINE, duration=[tick * self._dt for tick in ticks])]
            self._stream.send_columns("events", time, rr.TextLog.columns(text=texts, level=levels))

    def _log_realised(self, time: list[rr.TimeColumn], realised: Realised) -> None:
        # Sensing and the last channel stand for their classes: channels that share their verdicts are alike.
        classes = [0, -1]
        age = realised.age_s[:, classes]
        known = ~np.isnan(age)
        mean_age = np.where(known, age, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
        both = np.concatenate([realised.connectivity[:, classes], realised.joint_connectivity[:, classes]], axis=-1)
        self._scalars("graph/connectivity", time, both)
        self._scalars("graph/age", time, mean_age)
        counts = np.stack([realised.feasible.sum(axis=-1), realised.stress_dimension[:, 0]], axis=-1)
        self._scalars("graph/rigidity", time, counts.astype(np.float64))

    def _log_consistency(self, time: list[rr.TimeColumn], moments: Moments, kept: slice, present: Mask) -> None:
        edges = of_swarms(
            self._world,
            present=present,
            position=moments.position[kept],
            verdicts=moments.verdicts[kept, 0],
            estimate=moments.estimate[kept],
            covariance=moments.covariance[kept],
            known=moments.known[kept],
            nis=moments.reports[NIS][kept] if NIS in moments.reports else None,
        )
        errors = consistency.of_errors(edges.estimate, edges.true, edges.covariance, edges.known)
        innovations = consistency.of_innovations(edges.nis, edges.seen)
        number = np.maximum(errors.number, 1)
        bands = consistency.band(consistency.DRAWN, self._formation.dimension, number)
        self._scalars("metrics/consistency", time, np.concatenate([errors.mean, innovations.mean, *bands], axis=-1))

    def _messages_per_tick(self, moments: Moments) -> Array:
        starts = np.arange(0, len(moments.ticks), self._every)
        counts = np.stack([(moments.verdicts == verdict).sum(axis=(1, 2)) for verdict in _COUNTED], axis=-1)
        lengths = np.diff(np.append(starts, len(moments.ticks)))
        means: Array = np.add.reduceat(counts, starts, axis=0) / lengths[:, None]
        return means

    def _log_agents(self, time: list[rr.TimeColumn], conditions: Sequence[Conditions], position: Array) -> None:
        agents = self._formation.agents
        apart = {id(now): now for now in conditions}  # they stay the same object for as long as nothing changes
        colours_under = {which: self._agent_colours(now) for which, now in apart.items()}
        colours = np.concatenate([colours_under[id(now)] for now in conditions])
        columns = rr.Points3D.columns(positions=spatial(position).reshape(-1, 3), colors=colours)
        for path in ("swarm/agents", "swarm/trail"):
            self._stream.send_columns(path, time, columns.partition([agents] * len(conditions)))

    def _agent_colours(self, now: Conditions) -> NDArray[np.uint32]:
        flying = np.where(self._formation.is_leader, _LEADER, _FOLLOWER)
        states = [now.vanished, now.dead, now.departed, now.paused]
        return np.select(states, [_VANISHED, _DEAD, _DEPARTED, _PAUSED], flying).astype(np.uint32)

    def _log_graph(self, time: list[rr.TimeColumn], flown: Array, wanted: Array, verdicts: VerdictCodes) -> None:
        position, target = spatial(flown), spatial(wanted)
        links = self._links
        receiver, sender = position[:, links.dst - 1], position[:, links.src - 1]
        # Half an edge for each direction: the half at an agent shows whether that agent hears and sees the other.
        halves = np.stack([(receiver + sender) / 2, receiver], axis=-2)
        palette = np.array([_LINK_COLOURS[verdict] for verdict in Verdict], dtype=np.uint32)
        self._segments("swarm/graph/functional", time, halves, palette[verdicts])
        self._segments("swarm/graph/nominal", time, position[:, self._edges])
        self._segments("swarm/target", time, target[:, self._edges])

    def _segments(
        self, path: str, time: list[rr.TimeColumn], ends: Array, colours: NDArray[np.uint32] | None = None
    ) -> None:
        moments, number = ends.shape[:2]
        strips = ends.reshape(-1, 2, 3)
        columns = (
            rr.LineStrips3D.columns(strips=strips)
            if colours is None
            else rr.LineStrips3D.columns(strips=strips, colors=colours.ravel())
        )
        self._stream.send_columns(path, time, columns.partition([number] * moments))

    def _scalars(self, path: str, time: list[rr.TimeColumn], values: Array) -> None:
        scalars(self._stream, path, time, values)


def _refuse_what_breaks_off(path: Path) -> None:
    if wrong := wrong_with(path):
        raise NotRecorded(wrong)


def _said_of(timeline: Timeline, tick: int) -> list[tuple[str, str]]:
    """What begins and ends in a tick, and at which level that is said."""
    started = [(fault.describe(), "WARN") for fault in timeline.starting(tick)]
    return started + [(fault.describe_end(), "INFO") for fault in timeline.ending(tick)]


def _shown(world: World, reports: Reports) -> list[type[Layer]]:
    """The layers for what is reported: places, a target, and maps of the formation."""
    kinds: list[tuple[type[Layer], bool]] = [
        (Places, PLACE in reports),
        (Pursued, world.pursuit is not None and reported(reports)),
        (PerceivedFormations, reports.get(THETA) == (world.formation.dimension,) * 2),
    ]
    return [layer for layer, wanted in kinds if wanted]


def _blueprint(formation: Formation, shown: Collection[type[Layer]], *, in_real_time: bool) -> rrb.Blueprint:
    reach = float(np.ptp(formation.nominal, axis=0).max())
    trail = rrb.VisibleTimeRange(
        TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-8.0),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    flat = formation.dimension == 2
    swarm = rrb.Spatial3DView(
        origin="swarm",
        name="swarm",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -0.01 * reach, 2.6 * reach) if flat else (-1.4 * reach, -2.0 * reach, 1.1 * reach),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 1.0, 0.0) if flat else (0.0, 0.0, 1.0),
            tracking_entity="swarm/agents",
        ),
        overrides={"swarm/trail": rrb.VisibleTimeRanges([trail])},
    )
    local_maps = rrb.Tabs(
        rrb.TimeSeriesView(origin="metrics/psi", name="psi, by agent"),
        rrb.TimeSeriesView(origin="metrics/infeasible", name="agents whose neighbours determine no local map"),
    )
    plots = rrb.Vertical(
        rrb.Tabs(
            *([rrb.TimeSeriesView(origin="metrics/localization", name="localization")] if Places in shown else []),
            *([rrb.TimeSeriesView(origin="metrics/target", name="error of the target")] if Pursued in shown else []),
            rrb.TimeSeriesView(origin="metrics/tracking_error", name="tracking error"),
            rrb.TimeSeriesView(origin="metrics/procrustes", name="Procrustes error"),
            rrb.TimeSeriesView(origin="metrics/consistency", name="filter consistency, means over the edges"),
        ),
        *([] if Places in shown or Pursued in shown else [local_maps]),
        rrb.TimeSeriesView(origin="metrics/messages", name="messages per tick, by verdict"),
        rrb.Tabs(
            rrb.TimeSeriesView(origin="graph/connectivity", name="connectivity"),
            rrb.TimeSeriesView(origin="graph/age", name="age of information"),
            rrb.TimeSeriesView(origin="graph/rigidity", name="rigidity"),
            *([rrb.TimeSeriesView(origin="timing", name="how late processes are (ms)")] if in_real_time else []),
        ),
        rrb.TextLogView(origin="events", name="events"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(swarm, plots, column_shares=[3, 2]),
        rrb.TimePanel(timeline=TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
