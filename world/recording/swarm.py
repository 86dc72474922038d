"""What a recording shows of the bodies: where they are, who of them takes part, what they fly, and how large a metre is."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr

from analysis.models.arrays import Array
from analysis.models.elementary import whole_power
from netem.faults.conditions import Conditions
from world.physics.world import World
from world.recording import palette
from world.recording.stage import Colours, Stage, Stretch, spatial

_AHEAD_S = 0.5  # an arrow ends where an input alone leads within
_STEPS = (1.0, 2.0, 5.0)


class Swarm:
    """Logs agents, the way they came, their inputs, the formation that is wanted, and a bar of a round length.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage, self._formation = stage, world.formation
        order = world.body.build().order
        self._per_input = whole_power(_AHEAD_S, order) / math.factorial(order)
        self._metres = _round_length(stage.reach / 4.0)

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        still, reach = self._stage.still, self._stage.reach
        numbers = [str(agent) for agent in range(1, self._formation.agents + 1)]
        here = f"({', '.join(f'{axis:.0f}' for axis in self._stage.origin)})"
        still("origin", rr.TextDocument(f"positions are relative to {here} m"))
        still("swarm/agents", rr.Points3D.from_fields(radii=0.03 * reach, labels=numbers))
        still("swarm/trail", rr.Points3D.from_fields(radii=rr.Radius.ui_points(1.0)))
        still("swarm/target", rr.LineStrips3D.from_fields(radii=rr.Radius.ui_points(0.7), colors=palette.FAINT))
        still("swarm/input", rr.Arrows3D.from_fields(radii=rr.Radius.ui_points(1.0), colors=palette.PLAIN))
        bar = rr.LineStrips3D.from_fields(
            radii=rr.Radius.ui_points(1.5), colors=palette.PLAIN, labels=[f"{self._metres:g} m"], show_labels=True
        )
        still("swarm/scale", bar)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        self._log_bodies(stretch)
        self._stage.segments("swarm/target", stretch.time, spatial(stretch.target)[:, self._formation.ends])
        flown = stretch.moments.input[stretch.kept]
        self._stage.arrows("swarm/input", stretch.time, stretch.position, self._per_input * flown)
        self._stage.segments("swarm/scale", stretch.time, self._bar(stretch.target))

    def _log_bodies(self, stretch: Stretch) -> None:
        apart = {id(now): now for now in stretch.conditions}  # the same object for as long as nothing changes
        under = {which: self._colours(now) for which, now in apart.items()}
        colours = np.stack([under[id(now)] for now in stretch.conditions])
        for path in ("swarm/agents", "swarm/trail"):
            self._stage.points(path, stretch.time, stretch.position, colours)

    def _colours(self, now: Conditions) -> Colours:
        flying = np.where(self._formation.is_leader, palette.LEADER, palette.FOLLOWER)
        states = [now.vanished, now.dead, now.departed, now.paused]
        shown = [palette.VANISHED, palette.DEAD, palette.DEPARTED, palette.PAUSED]
        return np.select(states, shown, flying).astype(np.uint32)

    def _bar(self, target: Array) -> Array:
        """A bar below the formation that is wanted, shape (T, 1, 2, 3)."""
        corner = spatial(target.min(axis=1))
        corner[:, 1] -= 0.3 * self._stage.reach
        ends = np.stack([corner, corner + np.array([self._metres, 0.0, 0.0])], axis=1)
        return ends[:, None]


def _round_length(longest: float) -> float:
    """The longest of 1, 2, 5, 10, 20 ... that is no longer."""
    decade = 1e-9
    while 10.0 * decade <= longest:
        decade *= 10.0
    return max((step * decade for step in _STEPS if step * decade <= longest), default=decade)
