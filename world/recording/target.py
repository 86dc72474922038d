"""What a recording shows of a pursuit: the target, where each agent finds it by itself and with the others, and how surely."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.metrics.errors import root_mean_square
from analysis.models.arrays import Array
from netem.faults.timeline import Timeline
from world.books.history import Moments
from world.physics.world import World
from world.recording.stage import ellipses, points, scalars

_TARGET, _FOUND, _AGREED, _ELLIPSE = 0xFF3B30FF, 0x88888899, 0x3FA7F5FF, 0x3FA7F544
_DEVIATIONS = 2.0


class Pursued:
    """Logs what agents that pursue a target believe.

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
        self._nominal = world.formation.nominal
        self._reach = float(np.ptp(world.formation.nominal, axis=0).max())

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        for path, colour, size in (("target", _TARGET, 0.03), ("found", _FOUND, 0.01), ("agreed", _AGREED, 0.015)):
            look = rr.Points3D.from_fields(radii=size * self._reach, colors=colour)
            self._stream.log(f"swarm/{path}/at", look, static=True)
        lines = rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.5), colors=_ELLIPSE)
        self._stream.log("swarm/agreed/spread", lines, static=True)
        names = ["found by oneself (m)", "agreed on (m)"]
        self._stream.log("metrics/target", rr.SeriesLines(names=names), static=True)

    def log(self, time: list[rr.TimeColumn], moments: Moments, kept: slice, timeline: Timeline) -> None:  # noqa: ARG002
        """Consecutive ticks, of which those `kept` are recorded."""
        target = (moments.target[kept] - self._nominal)[:, :1]
        found, agreed = moments.reports["found"][kept], moments.reports["reference"][kept][:, :, 0]
        for path, positions in (("target", target), ("found", found), ("agreed", agreed)):
            points(self._stream, f"swarm/{path}/at", time, positions - self._origin)
        off = [_over_agents(each - target) for each in (found, agreed)]
        scalars(self._stream, "metrics/target", time, np.stack(off, axis=-1))
        variance = moments.reports["variance"][kept][..., None, None] * np.eye(target.shape[-1])
        known = np.asarray(np.isfinite(variance).all(axis=(-2, -1)) & np.isfinite(agreed).all(axis=-1))
        lines = ellipses(
            np.where(known[..., None], agreed - self._origin, 0.0),
            np.where(known[..., None, None], variance, 0.0),
            _DEVIATIONS,
        )
        strips = lines.reshape(len(lines), -1, *lines.shape[-2:])
        columns = rr.LineStrips3D.columns(strips=strips.reshape(-1, *strips.shape[-2:]))
        self._stream.send_columns("swarm/agreed/spread", time, columns.partition([strips.shape[1]] * len(strips)))


def _over_agents(off: Array) -> Array:
    """Root mean squares (T,) of vectors (T, N, D), over the agents that say anything."""
    return root_mean_square(off, np.asarray(~np.isnan(off).any(axis=-1)))
