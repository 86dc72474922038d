"""Modules of a user's own: an estimator with a centre, and a law that flies the mission, each with checks of its own."""

CENTRALIZED = """\
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from affinet import CentreEstimate, Estimate, Finding, SwarmBrief, SwarmFilter, algebra, no_indicator


class Nothing(NamedTuple):
    pass


class Places(NamedTuple):
    position: np.ndarray


@dataclass(frozen=True)
class Blended:
    swarm: SwarmBrief
    gain: float

    def begin(self, batch):
        return Places(np.zeros((*batch, self.swarm.agents, self.swarm.dimension)))

    def step(self, state, measured, seen, inputs):
        position = state.position + self.swarm.dt * inputs
        off = np.where(seen[..., None], measured - self._edges(position), 0.0)
        position = position + self.gain * algebra.sum_over(off, -2) / np.maximum(seen.sum(axis=-1), 1)[..., None]
        relative = self._edges(position)
        square = (*relative.shape, self.swarm.dimension)
        estimate = CentreEstimate(relative, np.broadcast_to(np.eye(self.swarm.dimension), square).copy())
        return Places(position), estimate

    def _edges(self, position):
        relative = position[..., :, None, :] - position[..., self.swarm.neighbours, :]
        return np.where(self.swarm.present[..., None], relative, 0.0)


@dataclass(frozen=True)
class Own:
    gain: float = 0.4
    filter: str = "own"

    def channels(self, brief):
        return {}

    def init(self, brief, batch):
        return Nothing()

    def sense(self, brief, state, measured, seen):
        return state, {}

    def fuse(self, brief, state, heard, own):
        told = heard["centre"].fields
        known = np.broadcast_to(brief.present, told["relative"].shape[:-1])
        return state, Estimate(told["relative"], known, told["covariance"], no_indicator(known))

    def centre(self, swarm):
        return SwarmFilter(swarm, 1.0) if self.filter == "swarm" else Blended(swarm, self.gain)

    def checks(self, swarm):
        level = "error" if self.gain >= 1.0 else "note"
        return [Finding("own gain", level, f"{self.gain:g} of {swarm.agents} agents in {swarm.ticks} ticks")]
"""

PILOTED = """\
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from affinet import Finding, Wants, stress_force


class Nothing(NamedTuple):
    pass


@dataclass(frozen=True)
class Own:
    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = True
    gain: float = 3.0
    pull: float = 0.0

    @property
    def wants(self):
        return Wants(mission=True, position=self.pull > 0.0)

    def init(self, brief, batch):
        return Nothing()

    def command(self, brief, state, tick, own, estimate, inputs):
        flown = brief.mission.velocity(tick, brief.nominal, brief.dt) - self.gain * stress_force(brief, estimate)
        if self.pull:
            flown = flown + self.pull * (brief.mission.target(tick, brief.nominal) - own.position)
        return state, flown

    def checks(self, swarm):
        level = "error" if self.gain * swarm.dt > 1.0 else "ok"
        return [Finding("own step", level, f"{int((~swarm.leader).sum())} followers at {self.gain * swarm.dt:g}")]

    def step_matrix(self, stress, degree, dt):
        return np.eye(len(stress)) * (1.0 - dt * self.pull) - dt * self.gain * stress
"""
