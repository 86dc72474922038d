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
        method, beginning = chase.method, np.flatnonzero(over)
        if len(beginning):
            method = method.copy()
            method[beginning] = self.detectors.chosen(
                tick, _of(seed, beginning), numbers[beginning], chase.turn[beginning]
            )
        return Sighting(chase.found, over & (tick > 0), chase.method, method)

    def step(self, tick: int, seed: Seed, numbers: Integers, chase: PursuitState, drive: Array) -> PursuitState:
        """The next tick: detectors that are done begin again, and targets move on, driven as `drive` says, shape (S, m, D)."""
        moved = chase._replace(target=self._moved(tick, chase.target, drive))
        beginning = np.flatnonzero(chase.due == tick)
        if not len(beginning):
            return moved
        method = self.sighting(tick, seed, numbers, chase).method
        due, found, turn, by = chase.due.copy(), chase.found.copy(), chase.turn.copy(), method[beginning]
        due[beginning] = tick + self.target.latencies[by]
        found[beginning] = self.detectors.found(
            tick,
            _of(seed, beginning),
            numbers[beginning],
            chase.target[beginning // (len(numbers) // len(chase.target)), 0],
            np.sqrt(self.target.variances[by]),
        )
        turn[beginning] += 1
        return moved._replace(method=method, due=due, found=found, turn=turn)

    def drive(self, ticks: Integers, seed: Seed, swarms: int) -> Array:
        """What noise does to the targets of swarms with these seeds, one or (S,), in ticks, shape (T, S, m, D)."""
        shape = (len(ticks), swarms, *self.start.shape)
        if self.path is not None:
            return np.zeros(shape)
        white = normal(seed, Purpose.TARGET, tick=np.broadcast_to(ticks[:, None], shape[:2]), axes=shape[2] * shape[3])
        return product(self._motion[1], white.reshape(shape))

    def _moved(self, tick: int, targets: Array, drive: Array) -> Array:
        """Where the targets (S, m, D) are a tick later."""
        if self.path is not None:
            return np.broadcast_to(self.path[tick + 1], targets.shape).copy()
        return product(self._motion[0], targets) + drive

    @cached_property
    def _motion(self) -> tuple[Array, Array]:
        seconds, order = np.array(self.dt), self.target.order
        spread = diffusion(order, seconds, self.intensity)
        root = np.linalg.cholesky(spread) if self.intensity > 0.0 else np.zeros_like(spread)
        return transition(order, seconds), np.asarray(root, dtype=np.float64)


def _of(seed: Seed, rows: Integers) -> Seed:
    """The seeds of some agents."""
    return seed if isinstance(seed, int) else seed[rows]
