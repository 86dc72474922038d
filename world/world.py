"""The world's state and its step: what is sensed in a tick, and where the agents are in the next."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.affine import Manoeuvre
from netem.draws import Purpose, Tape
from netem.links import Links
from world import dynamics, sensors
from world.formation import Array, Formation
from world.noise import normal


@dataclass(frozen=True)
class World:
    """The physics of a run. Positions are state, and are handed in: shape (N, D), in metres.

    Parameters
    ----------
    seed
        Of the run.
    dt
        Tick, in seconds.
    ticks
        How many there are.
    formation, links, manoeuvre
        Who flies, who is linked to whom, and what the leaders fly.
    covariance
        Of a relative measurement, shape (D, D), in square metres.
    disturbance
        Standard deviation of the displacement that disturbs an agent in a tick, per axis, in metres.
    spread
        Standard deviation of the followers' initial offset from their targets, per axis, in metres.
    """

    seed: int
    dt: float
    ticks: int
    formation: Formation
    links: Links
    manoeuvre: Manoeuvre
    covariance: Array
    disturbance: float
    spread: float

    def start(self) -> Array:
        """Positions in tick 0: leaders on their targets, followers scattered about theirs."""
        agents = np.arange(1, self.formation.agents + 1)
        offset = normal(self.seed, Purpose.INITIAL_POSITION, src=agents, axes=self.formation.dimension)
        return self.target(0) + np.where(self.formation.is_leader[:, None], 0.0, self.spread * offset)

    def target(self, tick: int | NDArray[np.int64]) -> Array:
        """Where the manoeuvre wants every agent in a tick, shape (N, D), or in each of many, shape (T, N, D)."""
        return self.manoeuvre.target(tick, self.formation.nominal)

    def measure(self, tick: int, position: Array) -> Array:
        """y_ij of every directed link, shape (L, D)."""
        return sensors.relative(position, self.links) + self._sensor_noise.at(tick)

    def step(self, tick: int, position: Array, velocity: Array, absent: NDArray[np.bool_]) -> Array:
        """Positions in the next tick; the body of an agent that is absent holds still."""
        moved = dynamics.single_integrator(position, velocity, self.dt, self._disturbances.at(tick))
        return np.where(absent[:, None], position, moved)

    @cached_property
    def _sensor_noise(self) -> Tape:
        return Tape(
            lambda ticks: sensors.noise(
                normal(
                    self.seed,
                    Purpose.SENSOR_NOISE,
                    tick=ticks[:, None],
                    src=self.links.src,
                    dst=self.links.dst,
                    axes=self.formation.dimension,
                ),
                self.covariance,
            )
        )

    @cached_property
    def _disturbances(self) -> Tape:
        agents = np.arange(1, self.formation.agents + 1)
        return Tape(
            lambda ticks: (
                self.disturbance
                * normal(
                    self.seed,
                    Purpose.PROCESS_NOISE,
                    tick=ticks[:, None],
                    src=agents,
                    axes=self.formation.dimension,
                )
            )
        )
