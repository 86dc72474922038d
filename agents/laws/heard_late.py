"""Whether laws settle that follow what their neighbours flew, and hear of it one tick late (errata of Table II)."""

from __future__ import annotations

from dataclasses import Field, replace
from typing import Any, ClassVar, Protocol

import numpy as np

from agents.algebra import stability
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array
from analysis.models.finding import Finding


class Relaxed(Protocol):
    """A law that mixes what it flew last into what it flies: a dataclass with a parameter `relaxation`, eta."""

    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]

    @property
    def relaxation(self) -> float:
        """Eta."""

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:
        """One tick of the followers."""


def finding(law: Relaxed, swarm: SwarmBrief, inputs: str, instead: str = "") -> Finding:
    """Whether the iteration of inputs settles, and which relaxation of the law makes it.

    Parameters
    ----------
    law, swarm
        Which law, and whom it is to fly.
    inputs
        What they are: velocities, or accelerations.
    instead
        What else one could do.
    """
    radius = one_tick_radius(swarm.follower_stress, swarm.follower_degree, law.relaxation)
    if radius < 1.0:
        return Finding("one-tick radius", "ok", f"{radius:.3f} < 1: {inputs} heard one tick late settle")
    remedy = _relaxation_that_settles(law, swarm)
    relax = f"relax the law (relaxation = {remedy:.2f} settles), " if remedy else ""
    says = f"{radius:.3f} >= 1: {inputs} heard one tick late diverge; {relax}choose other leaders{instead}"
    return Finding("one-tick radius", "error", says)


def one_tick_radius(stress: Array, degree: Array, relaxation: float) -> float:
    """Radius of the iteration I - eta D^-1 L_ff of inputs; D has the degrees (F,), and L_ff shape (F, F)."""
    return stability.radius(np.eye(len(stress)) - relaxation * stress / degree[:, None])


def _relaxation_that_settles(law: Relaxed, swarm: SwarmBrief) -> float | None:
    stress, degree = swarm.follower_stress, swarm.follower_degree
    for relaxation in np.arange(0.95, 0.0, -0.05).tolist():
        step = replace(law, relaxation=relaxation).step_matrix(stress, degree, swarm.dt)
        if stability.radius(step) < 1.0:
            return float(relaxation)
    return None
