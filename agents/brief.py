"""What an agent is told before take-off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from analysis.models.affine import Manoeuvre
from analysis.models.algebra import sum_over
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.pursuit import Sighting, Target
from analysis.models.sensor import Sensor

# What an input is, by the order of the bodies that fly it, up to quadruple integrators; lower derivatives are motion.
DERIVATIVES = ("velocity", "acceleration", "jerk", "snap")
Reading = int | Integers  # of a clock, in ticks; one for all, or each its own


class Own(NamedTuple):
    """What an agent knows by itself: of its own motion, and of a target.

    Parameters
    ----------
    velocity
        Shape (..., D), in metres per second: what odometry says, or a single integrator's input.
    input
        Now flying, shape (..., D), in metres per second, or per second squared.
    tick
        What its clock says.
    position
        Shape (..., D), in metres; of agents that have positioning.
    sighting
        What its detector says, if there is a target.
    higher
        Derivatives of the velocity that its body integrates, shape (..., m - 2, D), of integrators of an order m above 2.
    """

    velocity: Array
    input: Array
    tick: Reading = 0
    position: Array | None = None
    sighting: Sighting | None = None
    higher: Array | None = None


class Gap(NamedTuple):
    """Ticks that an agent missed: it was paused, or killed and restarted with what it remembered.

    Parameters
    ----------
    ticks
        How many, shape (...); 0 where none.
    before
        Its velocity from the tick before them to the first, shape (..., D), in metres per second.
    within
        From one of them to the next, shape (..., D), as far as it knows: paused bodies fly on, those of the dead hold.
    """

    ticks: Integers
    before: Array
    within: Array


@dataclass(frozen=True)
class Brief:
    """An agent's place in the formation; with leading axes, the places of many.

    Parameters
    ----------
    dt
        Tick, in seconds.
    number
        Which agent of the swarm it is, from 1, shape (...).
    nominal
        Own nominal position p_i, shape (..., D), in metres.
    relative
        Nominal relative positions p_ij = p_i - p_j, shape (..., n, D), in metres; 0 in padding.
    present
        Which neighbour slots are real, shape (..., n).
    back
        In which of its slots each neighbour has this agent, shape (..., n): where what it says to every neighbour apart is for
        this one. Any slot in padding.
    stress
        Weights l_ij, shape (..., n); 0 in padding.
    leads
        Which neighbours are leaders, shape (..., n).
    sensor
        What measures the edges.
    process
        B_i^T Q B_i, of what displaces the edges in a tick, all together, shape (..., n D, n D), in square metres; 0 in padding.
    persistence
        Correlation of such a displacement with that of the tick before, in [0, 1).
    lateness
        How many ticks late what neighbours say may be heard, at the most; those of the run where the network sets no bound.
    leader
        Whether it follows the mission rather than its neighbours, shape (...).
    target
        What there is to pursue, if anything.
    mission
        The manoeuvre, for those who are told it: leaders, and everybody where estimator or law want it.
    """

    dt: float
    number: Integers
    nominal: Array
    relative: Array
    present: Mask
    back: Integers
    stress: Array
    leads: Mask
    sensor: Sensor
    process: Array
    persistence: float
    lateness: int
    leader: Mask
    target: Target | None
    mission: Manoeuvre | None

    def of(self, row: int) -> Brief:
        """One place among those of a batch; the mission goes with it."""
        return replace(self, **{name: getattr(self, name)[row] for name in _OWN})

    @cached_property
    def degree(self) -> Array:
        """gamma_i = sum_j l_ij, shape (...)."""
        return sum_over(self.stress, -1)

    @property
    def dimension(self) -> int:
        """D."""
        return self.nominal.shape[-1]


_OWN = ("number", "nominal", "relative", "present", "back", "stress", "leads", "process", "leader")


def together(briefs: Sequence[Brief]) -> Brief:
    """The places of several agents as those of a batch; who is told the manoeuvre tells the others of it."""
    missions = [brief.mission for brief in briefs if brief.mission is not None]
    own: dict[str, Any] = {name: np.stack([getattr(brief, name) for brief in briefs]) for name in _OWN}
    return replace(briefs[0], mission=missions[0] if missions else None, **own)
