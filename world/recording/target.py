"""What a recording shows of a pursuit: the target, where each agent finds it by itself and with the others, and how surely."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.metrics.errors import root_mean_square
from analysis.models.arrays import Array
from world.physics.world import World
from world.recording.curves import decades
from world.recording.stage import Stage, Stretch, ellipses

_TARGET, _FOUND, _AGREED, _ELLIPSE = 0xFF3B30FF, 0x88888899, 0x3FA7F5FF, 0x3FA7F544
_DEVIATIONS = 2.0


class Pursued:
    """Logs what agents that pursue a target believe.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage = stage
        self._nominal = world.formation.nominal

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        for path, colour, size in (("target", _TARGET, 0.03), ("found", _FOUND, 0.01), ("agreed", _AGREED, 0.015)):
            look = rr.Points3D.from_fields(radii=size * self._stage.reach, colors=colour)
            self._stage.still(f"swarm/{path}/at", look)
        lines = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_ELLIPSE)
        self._stage.still("swarm/agreed/spread", lines)
        says = rr.SeriesLines(names=["found by oneself", "agreed on"], colors=[_FOUND | 0xFF, _AGREED])
        self._stage.still("metrics/target", says)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        moments, kept, origin = stretch.moments, stretch.kept, self._stage.origin
        target = (moments.target[kept] - self._nominal)[:, :1]
        found, agreed = moments.reports["found"][kept], moments.reports["reference"][kept][:, :, 0]
        for path, positions in (("target", target), ("found", found), ("agreed", agreed)):
            self._stage.points(f"swarm/{path}/at", stretch.time, positions - origin)
        off = [_over_agents(each - target) for each in (found, agreed)]
        self._stage.scalars("metrics/target", stretch.time, decades(np.stack(off, axis=-1)))
        variance = moments.reports["variance"][kept][..., None, None] * np.eye(target.shape[-1])
        known = np.asarray(np.isfinite(variance).all(axis=(-2, -1)) & np.isfinite(agreed).all(axis=-1))
        lines = ellipses(
            np.where(known[..., None], agreed - origin, 0.0),
            np.where(known[..., None, None], variance, 0.0),
            _DEVIATIONS,
        )
        strips = lines.reshape(len(lines), -1, *lines.shape[-2:])
        columns = rr.LineStrips3D.columns(strips=strips.reshape(-1, *strips.shape[-2:]))
        self._stage.stream.send_columns(
            "swarm/agreed/spread", stretch.time, columns.partition([strips.shape[1]] * len(strips))
        )


def _over_agents(off: Array) -> Array:
    """Root mean squares (T,) of vectors (T, N, D), over the agents that say anything."""
    return root_mean_square(off, np.asarray(~np.isnan(off).any(axis=-1)))
