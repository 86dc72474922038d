"""Detectors of a target: which method each uses next, and what it finds (paper 002, remarks 1 and 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models.arrays import Array, Integers
from netem.core.draws import Purpose, Seed, uniform
from world.physics.noise import normal


@dataclass(frozen=True)
class Detectors:
    """How methods are chosen, and how often a detection is none of the target.

    Parameters
    ----------
    probabilities
        Of each method, shape (M,), where it is chosen at random for each detection.
    schedule
        Or which each agent of a swarm uses, turn by turn and over again, shape (N, K).
    misses, false_positives
        Probabilities that a detection finds nothing, and that it finds something else.
    clutter
        Standard deviation of where that is, about the target, per axis, in metres.
    """

    probabilities: Array
    schedule: Integers | None
    misses: float
    false_positives: float
    clutter: float

    def chosen(self, tick: int, seed: Seed, numbers: Integers, turn: Integers) -> Integers:
        """Which method the detectors of agents use that begin in this tick, having begun `turn` times, shape (N,)."""
        if self.schedule is not None:
            return np.asarray(self.schedule[numbers - 1, turn % self.schedule.shape[1]], dtype=np.int64)
        draw = uniform(seed, Purpose.LATENCY, tick=tick, src=numbers)
        below = np.cumsum(self.probabilities)[:-1]
        return np.asarray((draw >= below).sum(axis=-1), dtype=np.int64)

    def found(self, tick: int, seed: Seed, numbers: Integers, here: Array, deviation: Array) -> Array:
        """What detections that begin in this tick find, shape (N, D), in metres; NaN of those that find nothing.

        Parameters
        ----------
        tick, seed, numbers
            When, and of which agents, (N,).
        here
            Where the target is, shape (N, D), in metres.
        deviation
            Of what each method finds, per axis, shape (N,), in metres.
        """
        axes = here.shape[-1]
        seen = here + deviation[:, None] * normal(seed, Purpose.DETECTION, tick=tick, src=numbers, axes=axes)
        if self.misses > 0.0:
            missed = uniform(seed, Purpose.MISS, tick=tick, src=numbers) < self.misses
            seen = np.where(missed, np.nan, seen)
        if self.false_positives > 0.0:
            elsewhere = here + self.clutter * normal(seed, Purpose.CLUTTER, tick=tick, src=numbers, axes=axes)
            false = uniform(seed, Purpose.FALSE_POSITIVE, tick=tick, src=numbers) < self.false_positives
            seen = np.where(false, elsewhere, seen)
        return np.asarray(seen, dtype=np.float64)
