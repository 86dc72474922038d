"""What a recording shows of the maps that agents perceive (paper 000, Fig. 7): the formation as each of them sees it."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.models.algebra import product
from analysis.models.arrays import Array
from netem.core.channels import THETA
from netem.faults.timeline import Timeline
from world.books.history import Moments
from world.physics.world import World
from world.recording.stage import points

_PERCEIVED = 0x3FA7F577


class PerceivedFormations:
    """Logs, for each agent, where its neighbours and all others would be if its map Theta_i were everybody's.

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
        nominal = world.formation.nominal
        self._from_each = nominal[None] - nominal[:, None]
        self._reach = float(np.ptp(nominal, axis=0).max())

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        look = rr.Points3D.from_fields(radii=0.008 * self._reach, colors=_PERCEIVED)
        self._stream.log("swarm/perceived", look, static=True)

    def log(self, time: list[rr.TimeColumn], moments: Moments, kept: slice, timeline: Timeline) -> None:  # noqa: ARG002
        """Consecutive ticks, of which those `kept` are recorded; who perceives no map is left out."""
        theta, position = moments.reports[THETA][kept], moments.position[kept] - self._origin
        seen = position[:, :, None] + product(theta[:, :, None], self._from_each[..., None])[..., 0]
        points(self._stream, "swarm/perceived", time, seen.reshape(len(seen), -1, seen.shape[-1]))
