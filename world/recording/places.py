"""What a recording shows of localization: estimated places, the best there are, and how well each edge is known."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.metrics import localization
from analysis.models.arrays import Array
from analysis.models.jacobi import weights
from netem.core.channels import PLACE
from netem.faults.timeline import Timeline
from world.books.history import Moments
from world.books.localized import FirstMeasurements
from world.physics.world import World
from world.recording.stage import TIMELINE, ellipses, points, scalars

_ESTIMATED, _OPTIMAL, _ELLIPSE = 0x3FA7F5FF, 0xFF3B30FF, 0x88888866
_DEVIATIONS = 2.0


class Places:
    """Logs what agents that localize believe.

    Parameters
    ----------
    stream
        The recording.
    world
        What is flown.
    origin
        Of the recording, shape (D,), in metres.
    """

    def __init__(self, stream: rr.RecordingStream, world: World, origin: Array) -> None:
        self._stream = stream
        self._origin = origin
        self._dt = world.dt
        self._links = world.links
        self._first = FirstMeasurements(world.links, world.sensor, (), world.formation.dimension)
        self._reach = float(np.ptp(world.formation.nominal, axis=0).max())
        self._shown = 0

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        self._shown = 0
        for path, colour in (("swarm/place", _ESTIMATED), ("swarm/optimal", _OPTIMAL)):
            look = rr.Points3D.from_fields(radii=0.015 * self._reach, colors=colour)
            self._stream.log(path, look, static=True)
        lines = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_ELLIPSE)
        self._stream.log("swarm/measured", lines, static=True)
        says = rr.SeriesLines(names="distance from the optimal places (m)")
        self._stream.log("metrics/localization", says, static=True)

    def log(self, time: list[rr.TimeColumn], moments: Moments, kept: slice, timeline: Timeline) -> None:
        """Consecutive ticks, of which those `kept` are recorded."""
        for tick, measured, verdicts in zip(
            moments.ticks.tolist(), moments.measured, moments.verdicts[:, 0], strict=True
        ):
            self._first.tick(timeline, tick, measured, verdicts)
        place, position = moments.reports[PLACE][kept], moments.position[kept] - self._origin
        edges = self._first.edges()
        here = localization.centroid(position, weights(edges))[:, None]
        best = localization.optimal(edges) + here
        points(self._stream, "swarm/place", time, localization.beside(place, edges) + here)
        points(self._stream, "swarm/optimal", time, best)
        scalars(self._stream, "metrics/localization", time, localization.distance(place, edges)[:, None])
        if (seen := int(self._first.seen.sum())) > self._shown:
            self._shown = seen
            self._log_ellipses(moments.first, position[0])

    def _log_ellipses(self, tick: int, position: Array) -> None:
        """Where each agent puts its neighbours, with two standard deviations."""
        first, links = self._first, self._links
        where = (position[links.dst - 1] - first.measured)[first.seen]
        lines = ellipses(where, first.sensor.spread(first.measured[first.seen]), _DEVIATIONS)
        self._stream.set_time(TIMELINE, duration=tick * self._dt)
        self._stream.log("swarm/measured", rr.LineStrips3D(lines.reshape(-1, *lines.shape[-2:])))
