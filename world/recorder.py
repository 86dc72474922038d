"""A run as a Rerun recording: trajectories, graphs, target, indicators, verdicts and events on simulated time.

Moments are gathered and logged as columns, many ticks at once: that is several times cheaper than tick by tick.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from netem.medium import REASONS, Fate
from netem.timeline import Timeline
from world.formation import Array, Formation
from world.history import Moment

_BATCH = 100
_TIMELINE = "sim_time"

_LEADER, _FOLLOWER, _DEAD, _DEPARTED = 0xF2B705FF, 0x3FA7F5FF, 0x7A1F1FFF, 0x6E6E6EFF
_LINK_COLOURS = {
    Fate.SILENT: 0x00000000,
    Fate.DELIVERED: 0x3DDC84FF,
    Fate.DELAYED: 0x9AD0FFFF,
    Fate.DEAD: 0x7A1F1FFF,
    Fate.DEPARTED: 0x6E6E6EFF,
    Fate.CUT: 0xFF3B30FF,
    Fate.PARTITION: 0xC86BFFFF,
    Fate.LOST: 0xFF9F1CFF,
}
_COUNTED = (Fate.DELIVERED, Fate.DELAYED, *REASONS)


class Recorder:
    """Writes `run.rrd`, and streams to a viewer when one listens.

    Parameters
    ----------
    path
        Of the recording.
    run
        Its name.
    formation, timeline
        Who flies, and what is scripted.
    dt
        Tick, in seconds.
    every
        Ticks from one recorded moment to the next; messages are counted over all of them.
    viewer
        URL of a viewer that is listening already.
    """

    def __init__(
        self,
        path: Path,
        *,
        run: str,
        formation: Formation,
        timeline: Timeline,
        dt: float,
        every: int,
        viewer: str | None = None,
    ) -> None:
        self._formation = formation
        self._timeline = timeline
        self._dt = dt
        self._every = every
        self._moments: list[Moment] = []
        self._counts: list[NDArray[np.int64]] = []
        self._running = np.zeros(len(Fate), dtype=np.int64)
        self._edges = np.array(formation.edges, dtype=np.int64) - 1
        self._stream = rr.RecordingStream("affinet", recording_id=run)
        sinks = [rr.FileSink(str(path)), *([rr.GrpcSink(viewer)] if viewer else [])]
        self._stream.set_sinks(*sinks, default_blueprint=_blueprint(formation))
        self._log_static()

    def record(self, moment: Moment) -> None:
        """Take in one tick; it is written with its batch."""
        self._running += np.bincount(moment.fates.ravel(), minlength=len(Fate))
        self._log_events(moment.tick)
        if moment.tick % self._every:
            return
        self._moments.append(moment)
        self._counts.append(self._running)
        self._running = np.zeros(len(Fate), dtype=np.int64)
        if len(self._moments) >= _BATCH:
            self.flush()

    def flush(self) -> None:
        """Write the moments gathered so far."""
        if not self._moments:
            return
        moments, counts = self._moments, np.array(self._counts)
        self._moments, self._counts = [], []
        time = [rr.TimeColumn(_TIMELINE, duration=[moment.tick * self._dt for moment in moments])]
        self._log_agents(time, moments)
        self._log_graph(time, moments)
        self._scalars("metrics/tracking_error", time, np.array([[moment.error] for moment in moments]))
        self._scalars("metrics/psi", time, np.array([moment.psi for moment in moments]))
        self._scalars("metrics/messages", time, counts[:, list(_COUNTED)] / self._every)

    def close(self) -> None:
        """Write the rest and end the file."""
        self.flush()
        self._stream.disconnect()

    def _log_static(self) -> None:
        numbers = [str(agent) for agent in range(1, self._formation.agents + 1)]
        reach = float(np.ptp(self._formation.nominal, axis=0).max())
        static = [
            ("swarm/agents", rr.Points3D.from_fields(radii=0.03 * reach, labels=numbers)),
            ("swarm/trail", rr.Points3D.from_fields(radii=rr.Radius.ui_points(1.0))),
            ("swarm/target", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.7), colors=0x8888AA60)),
            ("swarm/graph/nominal", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=0x55555580)),
            ("swarm/graph/functional", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(1.8))),
            ("metrics/tracking_error", rr.SeriesLines(names="tracking error (m²)", colors=0xFFFFFFFF)),
            ("metrics/psi", rr.SeriesLines(names=[f"psi {number}" for number in numbers])),
            (
                "metrics/messages",
                rr.SeriesLines(
                    names=[fate.label for fate in _COUNTED], colors=[_LINK_COLOURS[fate] for fate in _COUNTED]
                ),
            ),
        ]
        for path, what in static:
            self._stream.log(path, what, static=True)

    def _log_events(self, tick: int) -> None:
        started = [fault.describe() for fault in self._timeline.starting(tick)]
        ended = [fault.describe_end() for fault in self._timeline.ending(tick)]
        if started or ended:
            self._stream.set_time(_TIMELINE, duration=tick * self._dt)
            for text in started:
                self._stream.log("events", rr.TextLog(text, level="WARN"))
            for text in ended:
                self._stream.log("events", rr.TextLog(text, level="INFO"))

    def _log_agents(self, time: list[rr.TimeColumn], moments: Sequence[Moment]) -> None:
        agents = self._formation.agents
        positions = _spatial(np.array([moment.position for moment in moments]))
        colours = np.array([self._agent_colours(moment.tick) for moment in moments]).ravel()
        columns = rr.Points3D.columns(positions=positions.reshape(-1, 3), colors=colours)
        for path in ("swarm/agents", "swarm/trail"):
            self._stream.send_columns(path, time, columns.partition([agents] * len(moments)))

    def _agent_colours(self, tick: int) -> NDArray[np.uint32]:
        now = self._timeline.at(tick)
        flying = np.where(self._formation.is_leader, _LEADER, _FOLLOWER)
        return np.where(now.dead, _DEAD, np.where(now.departed, _DEPARTED, flying)).astype(np.uint32)

    def _log_graph(self, time: list[rr.TimeColumn], moments: Sequence[Moment]) -> None:
        position = _spatial(np.array([moment.position for moment in moments]))
        target = _spatial(np.array([moment.target for moment in moments]))
        links = self._timeline.links
        receiver, sender = position[:, links.dst - 1], position[:, links.src - 1]
        # Half an edge for each direction: the half at an agent shows whether that agent hears and sees the other.
        halves = np.stack([(receiver + sender) / 2, receiver], axis=-2)
        palette = np.array([_LINK_COLOURS[fate] for fate in Fate], dtype=np.uint32)
        colours = palette[np.array([moment.fates[0] for moment in moments])]
        self._segments("swarm/graph/functional", time, halves, colours)
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
        columns = rr.Scalars.columns(scalars=values.ravel())
        self._stream.send_columns(path, time, columns.partition([values.shape[1]] * len(values)))


def _spatial(position: Array) -> Array:
    """Points (..., D) as points (..., 3); a plane is seen from above."""
    missing = 3 - position.shape[-1]
    return np.pad(position, [(0, 0)] * (position.ndim - 1) + [(0, missing)])


def _blueprint(formation: Formation) -> rrb.Blueprint:
    reach = float(np.ptp(formation.nominal, axis=0).max())
    trail = rrb.VisibleTimeRange(
        _TIMELINE,
        start=rrb.TimeRangeBoundary.cursor_relative(seconds=-8.0),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    swarm = rrb.Spatial3DView(
        origin="swarm",
        name="swarm",
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -0.01 * reach, 2.6 * reach),
            look_target=(0.0, 0.0, 0.0),
            eye_up=(0.0, 1.0, 0.0),
            tracking_entity="swarm/agents",
        ),
        overrides={"swarm/trail": rrb.VisibleTimeRanges([trail])},
    )
    plots = rrb.Vertical(
        rrb.TimeSeriesView(origin="metrics/tracking_error", name="tracking error"),
        rrb.TimeSeriesView(origin="metrics/psi", name="psi, by agent"),
        rrb.TimeSeriesView(origin="metrics/messages", name="messages per tick, by verdict"),
        rrb.TextLogView(origin="events", name="events"),
    )
    return rrb.Blueprint(
        rrb.Horizontal(swarm, plots, column_shares=[3, 2]),
        rrb.TimePanel(timeline=_TIMELINE, state="collapsed"),
        collapse_panels=True,
    )
