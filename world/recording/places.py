"""What a recording shows of localization: estimated places, the best there are, and how well each edge is known."""

from __future__ import annotations

import rerun as rr

from analysis.metrics import localization
from analysis.models.arrays import Array
from analysis.models.jacobi import weights
from netem.core.channels import PLACE
from world.books.localized import FirstMeasurements
from world.physics.world import World
from world.recording import palette
from world.recording.curves import decades
from world.recording.stage import Stage, Stretch, ellipses

_ESTIMATED, _OPTIMAL, _ELLIPSE = 0x3FA7F5FF, 0xFF3B30FF, 0x88888866
_DEVIATIONS = 2.0


class Places:
    """Logs what agents that localize believe.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage = stage
        self._links = world.links
        self._first = FirstMeasurements(world.links, world.sensor, (), world.formation.dimension)
        self._shown = 0

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        self._shown = 0
        for path, colour in (("swarm/place", _ESTIMATED), ("swarm/optimal", _OPTIMAL)):
            look = rr.Points3D.from_fields(radii=0.015 * self._stage.reach, colors=colour)
            self._stage.still(path, look)
        lines = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_ELLIPSE)
        self._stage.still("swarm/measured", lines)
        says = rr.SeriesLines(names="distance from the optimal places (log10 m)", colors=palette.PLAIN)
        self._stage.still("metrics/localization", says)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        moments, time = stretch.moments, stretch.time
        for tick, measured, verdicts in zip(
            moments.ticks.tolist(), moments.measured, moments.verdicts[:, 0], strict=True
        ):
            self._first.tick(stretch.timeline, tick, measured, verdicts)
        place, position = moments.reports[PLACE][stretch.kept], stretch.position
        edges = self._first.edges()
        here = localization.centroid(position, weights(edges))[:, None]
        best = localization.optimal(edges) + here
        self._stage.points("swarm/place", time, localization.beside(place, edges) + here)
        self._stage.points("swarm/optimal", time, best)
        self._stage.scalars("metrics/localization", time, decades(localization.distance(place, edges)[:, None]))
        if (seen := int(self._first.seen.sum())) > self._shown:
            self._shown = seen
            self._log_ellipses(moments.first, position[0])

    def _log_ellipses(self, tick: int, position: Array) -> None:
        """Where each agent puts its neighbours, with two standard deviations."""
        first, links = self._first, self._links
        where = (position[links.dst - 1] - first.measured)[first.seen]
        lines = ellipses(where, first.sensor.spread(first.measured[first.seen]), _DEVIATIONS)
        strips = lines.reshape(-1, *lines.shape[-2:])
        columns = rr.LineStrips3D.columns(strips=strips).partition([len(strips)])
        self._stage.stream.send_columns("swarm/measured", self._stage.times([tick]), columns)
