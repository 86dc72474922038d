"""What a recording shows of the maps that agents perceive (paper 000, Fig. 7): the formation as each of them sees it."""

from __future__ import annotations

import rerun as rr

from analysis.models.algebra import product
from netem.core.channels import THETA
from world.physics.world import World
from world.recording.stage import Stage, Stretch

_PERCEIVED = 0x3FA7F577


class PerceivedFormations:
    """Logs, for each agent, where its neighbours and all others would be if its map Theta_i were everybody's.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage = stage
        nominal = world.formation.nominal
        self._from_each = nominal[None] - nominal[:, None]

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        look = rr.Points3D.from_fields(radii=0.008 * self._stage.reach, colors=_PERCEIVED)
        self._stage.still("swarm/perceived", look)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks; who perceives no map is left out."""
        theta, position = stretch.moments.reports[THETA][stretch.kept], stretch.position
        seen = position[:, :, None] + product(theta[:, :, None], self._from_each[..., None])[..., 0]
        self._stage.points("swarm/perceived", stretch.time, seen.reshape(len(seen), -1, seen.shape[-1]))
