"""What a recording shows of the surroundings: walls, jammed zones, and how far agents hear."""

from __future__ import annotations

import numpy as np
import rerun as rr

from world.books.scenery import Scenery
from world.recording import palette
from world.recording.stage import Stage, Stretch, spatial


class Surroundings:
    """Logs what the swarm flies through.

    Parameters
    ----------
    stage
        Where.
    scenery
        What there is.
    """

    def __init__(self, stage: Stage, scenery: Scenery) -> None:
        self._stage, self._scenery = stage, scenery

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        if walls := self._scenery.walls:
            strips = [spatial(np.array(wall) - self._stage.origin) for wall in walls]
            self._stage.still(
                "swarm/walls", rr.LineStrips3D(strips, radii=rr.Radius.ui_points(2.5), colors=palette.WALL)
            )
        if zones := self._scenery.zones:
            centres = np.array([zone.centre for zone in zones]) - self._stage.origin
            shown = rr.Ellipsoids3D(
                centers=spatial(centres),
                half_sizes=_balls([zone.radius for zone in zones], centres.shape[-1]),
                labels=[f"jammed {zone.share:.0%}" for zone in zones],
                colors=palette.JAMMED,
                fill_mode=rr.components.FillMode.Solid,
            )
            self._stage.still("swarm/jammed", shown)
        if (hearing := self._scenery.hearing) is not None:
            still = rr.Ellipsoids3D.from_fields(
                half_sizes=_balls([hearing], len(self._stage.origin)),
                colors=palette.RANGE,
                line_radii=rr.Radius.ui_points(0.5),
                fill_mode=rr.components.FillMode.MajorWireframe,
            )
            self._stage.still("swarm/range", still)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        if self._scenery.hearing is not None:
            moments, agents, _ = stretch.position.shape
            centres = rr.Ellipsoids3D.columns(centers=spatial(stretch.position).reshape(-1, 3))
            self._stage.stream.send_columns("swarm/range", stretch.time, centres.partition([agents] * moments))


def _balls(radii: list[float], dimension: int) -> list[list[float]]:
    """Half sizes of balls, or of disks in a plane."""
    return [[radius, radius, radius if dimension == 3 else 0.0] for radius in radii]
