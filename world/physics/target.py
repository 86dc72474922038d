"""A target that the agents pursue, and their detectors: what is found of it, and when (paper 002, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers
from analysis.models.pursuit import Sighting, Target, diffusion, transition
from netem.core.draws import Purpose, Seed
from world.physics.detectors import Detectors
from world.physics.noise import normal


class PursuitState(NamedTuple):
    """The target, and every agent's detector at work.

    Parameters
    ----------
    target
        Position and derivatives of each swarm's target, shape (S, m, D), in metres, metres per second ...
    method
        Which each agent's detector uses, shape (N,).
    due
        The tick in which it will be done, shape (N,).
    found
        What it will then say of the target at the tick in which it began, shape (N, D), in metres; NaN if nothing.
    turn
        How often it has begun, shape (N,).
    """

    target: Array
    method: Integers
    due: Integers
    found: Array
    turn: Integers


@dataclass(frozen=True)
class MovingTarget:
    """How targets move and detectors find them.

    Parameters
    ----------
    target
        What agents take it for, and how it can be found.
    dt
        Tick, in seconds.
    start
        Its position and derivatives in tick 0, shape (m, D).
    intensity
        W of the noise that truly drives it, per axis, whatever agents take it for.
    path
        Its position and derivatives in every tick, shape (T + 1, m, D), of one that no noise drives.
    detectors
        How it is found.
    """

    target: Target
    dt: float
    start: Array
    intensity: float
    path: Array | None
    detectors: Detectors

    def begin(self, swarms: int, agents: int) -> PursuitState:
        """Targets at the start; every detector is about to begin."""
        targets = np.broadcast_to(self.start, (swarms, *self.start.shape)).copy()
        nothing = np.zeros(agents, dtype=np.int64)
        return PursuitState(targets, nothing, nothing, np.zeros((agents, self.start.shape[-1])), nothing)

    def sighting(self, tick: int, seed: Seed, numbers: Integers, chase: PursuitState) -> Sighting:
        """What detectors say; `numbers` are those of the agents in their swarms, shape (N,)."""
        over = chase.due == tick
        method = np.where(over, self.detectors.chosen(tick, seed, numbers, chase.turn), chase.method)
        return Sighting(chase.found, over & (tick > 0), chase.method, method)

    def step(self, tick: int, seed: Seed, numbers: Integers, chase: PursuitState) -> PursuitState:
        """The next tick: detectors that are done begin again, and targets move on."""
        over, method = chase.due == tick, self.sighting(tick, seed, numbers, chase).method
        swarms = len(chase.target)
        here = np.repeat(chase.target[:, 0], len(numbers) // swarms, axis=0)
        seen = self.detectors.found(tick, seed, numbers, here, np.sqrt(self.target.variances[method]))
        firsts = seed if isinstance(seed, int) else seed[:: len(numbers) // swarms]
        return PursuitState(
            target=self._moved(tick, firsts, chase.target),
            method=method,
            due=np.where(over, tick + self.target.latencies[method], chase.due),
            found=np.where(over[:, None], seen, chase.found),
            turn=chase.turn + over,
        )

    def _moved(self, tick: int, seed: Seed, targets: Array) -> Array:
        """Where the targets (S, m, D) of swarms with these seeds are a tick later."""
        if self.path is not None:
            return np.broadcast_to(self.path[tick + 1], targets.shape).copy()
        swarms, order, axes = targets.shape
        white = normal(seed, Purpose.TARGET, tick=np.full(swarms, tick), axes=order * axes)
        drift, root = self._motion
        return product(drift, targets) + product(root, white.reshape(targets.shape))

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        seconds, order = np.array(self.dt), self.target.order
        spread = diffusion(order, seconds, self.intensity)
        root = np.linalg.cholesky(spread) if self.intensity > 0.0 else np.zeros_like(spread)
        return transition(order, seconds), np.asarray(root, dtype=np.float64)
