"""What a swarm at rest could know of where it is: the first measurement of every link.

An agent that restarts and knows nothing measures anew.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from analysis.models import jacobi
from analysis.models.arrays import Array, Mask
from analysis.models.sensor import Sensor
from netem.core.links import Links
from netem.faults.timeline import Timeline
from netem.medium.verdict import Verdict, VerdictCodes
from world.physics.world import World


@dataclass
class FirstMeasurements:
    """The first measurement of every link that reached its agent, of one run or of many.

    Parameters
    ----------
    links, sensor
        Of one run.
    batch
        Shape of the runs: () for one.
    dimension
        D.
    """

    links: Links
    sensor: Sensor
    batch: tuple[int, ...]
    dimension: int
    measured: Array = field(init=False)
    seen: Mask = field(init=False)

    def __post_init__(self) -> None:
        """Nothing is measured yet."""
        self.measured = np.zeros((*self.batch, len(self.links), self.dimension))
        self.seen = np.zeros((*self.batch, len(self.links)), dtype=bool)

    @classmethod
    def of(cls, world: World, timeline: Timeline, measured: Array, verdicts: VerdictCodes) -> FirstMeasurements:
        """Those of a whole run: measurements (T, L, D) in every tick, and their verdicts (T, L)."""
        first = cls(world.links, world.sensor, (), world.formation.dimension)
        for tick in range(len(measured)):
            first.tick(timeline, tick, measured[tick], verdicts[tick])
        return first

    def tick(self, timeline: Timeline, tick: int, measured: Array, verdicts: VerdictCodes) -> None:
        """Take in a tick of the runs, whose timeline this is: measurements (..., L, D), and their verdicts (..., L)."""
        if fresh := set(timeline.restarted(tick)) - set(timeline.remembering(tick)):
            self.seen = self.seen & ~np.isin(timeline.links.dst, [*fresh]).reshape(self.seen.shape)
        self.take(measured, verdicts == Verdict.DELIVERED)

    def take(self, measured: Array, delivered: Mask) -> None:
        """Keep what is new of a tick: measurements (..., L, D), and which arrived (..., L)."""
        new = delivered & ~self.seen
        self.measured = np.where(new[..., None], measured, self.measured)
        self.seen = self.seen | delivered

    def edges(self) -> jacobi.EdgeInformation:
        """Each edge, as both its ends know it: with the covariance where the mean of both measurements puts them."""
        agents, (rows, columns) = self.links.agents, (self.links.dst - 1, self.links.src - 1)
        dimension = self.measured.shape[-1]
        relative, seen = np.zeros((*self.batch, agents, agents, dimension)), np.zeros((*self.batch, agents, agents))
        relative[..., rows, columns, :] = np.where(self.seen[..., None], self.measured, 0.0)
        seen[..., rows, columns] = self.seen
        both = seen + np.swapaxes(seen, -1, -2)
        middle = (relative - np.swapaxes(relative, -2, -3)) / np.maximum(both, 1.0)[..., None]
        spread = np.where(seen[..., None, None] > 0.0, self.sensor.spread(middle), np.eye(dimension))
        information = np.where(seen[..., None, None] > 0.0, np.linalg.inv(spread), 0.0)
        return jacobi.together(relative, information)
