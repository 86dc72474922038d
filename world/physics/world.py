"""The world's state and its step: what is sensed in a tick, and where the agents are in the next."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property, partial
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.models.affine import Manoeuvre
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.pursuit import Sighting
from analysis.models.sensor import Sensor
from netem.core.draws import DrawnAhead, Purpose, Seed, uniform
from netem.core.links import Links
from netem.faults.conditions import Conditions
from world.formation.nominal import Formation
from world.physics import bodies, sensors
from world.physics.bodies import Body, BodyModel, Motion
from world.physics.disturbance import Disturbance
from world.physics.noise import normal
from world.physics.recorded import RecordedFlight
from world.physics.target import MovingTarget, PursuitState


class Scene(NamedTuple):
    """What the world remembers from tick to tick.

    Parameters
    ----------
    position, motion, pose
        Of the agents, as `bodies.Motion` has them: shape (N, D), in metres, derivatives (N, K, D), and what else (N, S).
    measured
        What was measured last, shape (L, D), in metres: in the tick before, but for gaps; NaN where nothing ever was.
    disturbance
        What displaced them from the tick before, shape (N, D), in metres.
    chase
        The target, and the detectors that are after it, if there is one.
    """

    position: Array
    motion: Array
    measured: Array
    disturbance: Array
    chase: PursuitState | None
    pose: Array

    @property
    def bodies(self) -> Motion:
        """Where the bodies are, and how they move."""
        return Motion(self.position, self.motion, self.pose)

    @property
    def velocity(self) -> Array:
        """Shape (N, D), in metres per second."""
        return self.motion[:, 0]


@dataclass(frozen=True)
class World:
    """The physics of a run. The scene is state, and is handed in.

    Parameters
    ----------
    run_seed, swarm_seeds
        Of the run; and of every agent's run, shape (N,), where runs fly side by side.
    dt
        Tick, in seconds.
    ticks
        How many there are.
    body
        How they move under their input.
    formation, links, manoeuvre
        Who flies, who is linked to whom, and what the leaders fly.
    sensor
        What measures relative positions.
    disturbance
        What displaces the agents in every tick.
    pursuit
        How a target moves and is found, if there is one.
    start
        Where they begin: leaders on their targets and followers scattered about theirs, or all about the origin.
    spread
        Standard deviation of that scatter, per axis, in metres.
    swarms
        How many swarms fly side by side, each with its own disturbances.
    flight
        What was flown before, where that stands in for bodies and sensors.
    """

    run_seed: int
    swarm_seeds: NDArray[np.uint64] | None
    dt: float
    ticks: int
    body: BodyModel
    formation: Formation
    links: Links
    manoeuvre: Manoeuvre
    sensor: Sensor
    disturbance: Disturbance
    pursuit: MovingTarget | None
    start: Literal["targets", "origin"]
    spread: float
    swarms: int
    flight: RecordedFlight | None

    def __getstate__(self) -> dict[str, object]:
        """What it was made of: what it has worked out since can be worked out again, wherever it is taken."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def seed(self) -> Seed:
        """What all draws are made with."""
        return self.run_seed if self.swarm_seeds is None else self.swarm_seeds

    def begin(self) -> Scene:
        """The scene in tick 0: everybody where the scatter puts it, at rest."""
        offset = self.spread * normal(
            self.seed, Purpose.INITIAL_POSITION, src=self._numbers, axes=self.formation.dimension
        )
        position = offset
        if self.start == "targets":
            position = self.target(0) + np.where(self.formation.is_leader[:, None], 0.0, offset)
        if self.flight is not None:
            position = self.flight.position[0]
        still, rest = np.zeros_like(position), self._body.rest(position)
        chase = None if self.pursuit is None else self.pursuit.begin(self.swarms, self.formation.agents)
        seen = self.sensor.exact(sensors.relative(position, self.links))
        if self.flight is not None:  # no sensor has said anything yet
            seen = np.full_like(seen, np.nan)
        return Scene(position, rest.derivatives, seen, still, chase, rest.pose)

    def target(self, tick: int | Integers) -> Array:
        """Where the manoeuvre wants every agent in a tick, shape (N, D), or in each of many, shape (T, N, D)."""
        return self.manoeuvre.target(np.asarray(tick)[..., None], self.formation.nominal)

    def goal(self, tick: int, scene: Scene) -> Array:
        """Where every agent should be, shape (N, D): where the manoeuvre wants it, or at its place about the target."""
        if scene.chase is None:
            return self.target(tick)
        about = scene.chase.target[:, :1] + self._of_swarms(self.formation.nominal)
        return about.reshape(self.formation.nominal.shape)

    def sighting(self, tick: int, scene: Scene) -> Sighting | None:
        """What the agents' detectors say of the target, if there is one."""
        if self.pursuit is None or scene.chase is None:
            return None
        return self.pursuit.sighting(tick, self.seed, self._numbers, scene.chase)

    def measure(self, tick: int, scene: Scene, now: Conditions) -> Array:
        """y_ij of every directed link, shape (L, D), in metres, or a unit vector, as the sensor says it."""
        return self.astray(tick, scene, self._sensed(tick, scene), now)

    def astray(self, tick: int, scene: Scene, measured: Array, now: Conditions) -> Array:
        """What sensors say that measured this, shape (L, D), with those that fail in this tick."""
        if not now.acting or not (now.bias.any() or now.outlier.any() or now.frozen.any()):
            return measured
        size = self._normal(Purpose.OUTLIER_SIZE, tick, self.formation.dimension)
        return sensors.astray(measured, scene.measured, self.outliers(tick, now), size, now)

    def _sensed(self, tick: int, scene: Scene) -> Array:
        if self.flight is not None:
            return self.flight.measured[tick]
        return self.sensor.measured(sensors.relative(scene.position, self.links), self._sensor_noise.at(tick))

    def outliers(self, tick: int, now: Conditions) -> Mask:
        """Which measurements of a tick are outliers, shape (L,)."""
        src, dst = self.links.ends.values()
        draw = uniform(self.links.seeds(self.seed), Purpose.OUTLIER, tick=tick, src=src, dst=dst)[..., 0]
        return sensors.stray(draw, now)

    def flown(self, tick: int, scene: Scene, commanded: Array, now: Conditions) -> Array:
        """The inputs that the bodies fly when their agents command these, shape (N, D)."""
        if self.flight is not None:
            return self.flight.input[tick]
        return bodies.flown(commanded, self._body.coasting(scene.bodies), now) if now.acting else commanded

    def odometry(self, scene: Scene) -> Array | None:
        """The derivatives that agents are told, as in `Scene`, shape (N, K, D), unless their input says all."""
        return scene.motion if self._body.odometry else None

    def told(self, tick: int) -> Array | None:
        """What agents are told that they fly when a tick begins, shape (N, D), where that is not what they commanded."""
        return None if self.flight is None else self.flight.flown_before(tick)

    def step(self, tick: int, scene: Scene, measured: Array, flown: Array, now: Conditions) -> Scene:
        """The scene of the next tick, after what was measured and flown in this one."""
        if self.flight is not None:
            return scene._replace(
                position=self.flight.position[tick + 1], measured=sensors.last(scene.measured, measured)
            )
        noise, chase = self._disturb(tick, scene), scene.chase
        moved = self._body.moved(scene.bodies, flown, now.push, self.dt)
        position, motion, pose = moved.position + noise, moved.derivatives, moved.pose
        if now.acting:
            still = now.still[:, None]
            position, pose = np.where(still, scene.position, position), np.where(still, scene.pose, pose)
            motion = np.where(still[..., None], 0.0, motion)
        if self.pursuit is not None and self._drives is not None and chase is not None:
            chase = self.pursuit.step(tick, self.seed, self._numbers, chase, self._drives.at(tick))
        return Scene(position, motion, measured, noise, chase, pose)

    @cached_property
    def _body(self) -> Body:
        return self.body.build()

    @cached_property
    def _sensor_noise(self) -> DrawnAhead:
        return DrawnAhead(
            lambda ticks: sensors.noise(
                self._normal(Purpose.SENSOR_NOISE, ticks[:, None], len(self.sensor.covariance)), self.sensor.covariance
            )
        )

    def _normal(self, purpose: Purpose, tick: int | Integers, axes: int) -> Array:
        """Standard normal draws for every measurement of a tick, shape (..., L, axes)."""
        src, dst = self.links.ends.values()
        return normal(self.links.seeds(self.seed), purpose, tick=tick, src=src, dst=dst, axes=axes)

    @cached_property
    def _numbers(self) -> Integers:
        return self.links.own_number(np.arange(1, self.formation.agents + 1))

    def _of_swarms(self, of_agents: Array) -> Array:
        """Of agents (..., N, *), apart by swarms (..., S, n, *)."""
        *batch, agents, size = of_agents.shape
        return of_agents.reshape(*batch, self.swarms, agents // self.swarms, size)

    def _disturb(self, tick: int, scene: Scene) -> Array:
        if self.disturbance.still:
            return np.zeros_like(scene.position)
        before = self._of_swarms(scene.disturbance) if tick else None
        pushed = self.disturbance.next(before, self._pushes.at(tick), self._of_swarms(scene.position))
        return pushed.reshape(scene.position.shape)

    @cached_property
    def _pushes(self) -> DrawnAhead:
        root = self.disturbance.root(self._of_swarms(self.formation.nominal)[0])

        def pushes(ticks: Integers) -> Array:
            axes, who = self.formation.dimension, self._numbers
            white = normal(self.seed, Purpose.PROCESS_NOISE, tick=ticks[:, None], src=who, axes=axes)
            return self.disturbance.drawn(self._of_swarms(white), root)

        return DrawnAhead(pushes)

    @cached_property
    def _drives(self) -> DrawnAhead | None:
        seed = self.seed
        first = seed if isinstance(seed, int) else seed[:: self.formation.agents // self.swarms]
        return None if self.pursuit is None else DrawnAhead(partial(self.pursuit.drive, seed=first, swarms=self.swarms))
