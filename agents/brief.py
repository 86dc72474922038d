"""What an agent is told before take-off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np

from analysis.models.affine import Manoeuvre
from analysis.models.algebra import sum_over
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.pursuit import Sighting, Target
from analysis.models.sensor import Sensor

# What an input is, by the order of the bodies that fly it, up to quadruple integrators; lower derivatives are motion.
DERIVATIVES = ("velocity", "acceleration", "jerk", "snap")

_READING = """What a clock says: ticks since take-off.

An `int` where one reading holds for all agents that are computed together, as it does of an agent in a process of its own,
and of all while their clocks agree; else int64 of shape (...), each agent its own. It counts the ticks of the agent's own
clock, which the verb `clock` makes wrong. Times `brief.dt` it is in seconds. `numpy.asarray(tick)[..., None]` goes beside
arrays (..., D) in both forms, which `Manoeuvre.target`, `velocity` and `acceleration` take, too.
"""
Reading = Annotated[int | Integers, "ticks"]
Reading.__doc__ = _READING


class Own(NamedTuple):
    """What an agent knows by itself: of its own motion, and of a target.

    Shapes begin with the axes of the state: none for an agent in a process of its own, (agents,) for several as a batch. D is
    2 or 3. All arrays are float64 and read-only, in axes that all agents share.

    Parameters
    ----------
    velocity
        Its velocity, shape (..., D), in metres per second; of a single integrator its `input`.
    input
        What it flies from the tick before on, shape (..., D): what it commanded last, shortened to `agents.limit`, or what
        odometry says where its body does not fly just what it is told; 0 at first. In metres per second, of double integrators
        per second squared, and so on.
    tick
        What its clock says, as an `affinet.Reading`.
    position
        Where it is, shape (..., D), in metres; None unless it leads, or law or estimator want it (`Wants(position=True)`).
        Of several as a batch there is a row for everybody; only that of an agent that has it alone may be used.
    sighting
        What its detector says of a target (`position`, `done`, `by`, `method`); None where there is none.
    higher
        Derivatives of the velocity that its body integrates, shape (..., m - 2, D), of integrators of an order m: acceleration,
        in metres per second squared, and jerk, per second cubed. With m = 2 there are none, and with m = 1 it is None.
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
    """What an agent is told before take-off: its place in the formation. With leading axes, the places of many.

    Shapes begin with axes that are none for an agent in a process of its own, and (agents,) for several as a batch. n is the
    number of neighbour slots, the same for all: the most neighbours that anybody has. A neighbour has the same slot here, in
    `Estimate`, in `Heard` and in what was measured; who has fewer has padding in the last ones, where `present` is false. D is
    2 or 3. Numbers are float64, truths bool, and all of it is read-only.

    Parameters
    ----------
    dt
        Tick, in seconds.
    number
        Which agent of the swarm it is, from 1, int64 of shape (...).
    nominal
        Own nominal position p_i, shape (..., D), in metres.
    relative
        Nominal relative positions p_ij = p_i - p_j, from the neighbour to the agent itself, shape (..., n, D), in metres; 0 in
        padding.
    present
        Which neighbour slots are real, shape (..., n).
    back
        In which of its slots each neighbour has this agent, int64 of shape (..., n): where what it says to every neighbour
        apart is for this one. Any slot in padding.
    stress
        Weights l_ij, shape (..., n), without a unit and of either sign: the sum of l_ij p_ij over j is 0 for a follower. 0 in
        padding, and everywhere under a law that weighs no edges by the stress (`by_stress`).
    leads
        Which neighbours are leaders, shape (..., n).
    sensor
        What measures the edges: `sensor.spread(relative)` is the covariance of a measurement of each (..., n, D), shape
        (..., n, D, D), in square metres.
    process
        B_i^T Q B_i, of what displaces the edges in a tick, all together, shape (..., n D, n D), in square metres; 0 in padding.
    persistence
        Correlation of such a displacement with that of the tick before, in [0, 1).
    lateness
        How many ticks late what neighbours say may be heard, at the most; those of the run where the network sets no bound.
    leader
        Whether it leads, shape (...): then it flies the manoeuvre, or keeps its distances, and not what its law says.
    target
        What there is to pursue (`order`, `intensity`, `latencies`, `variances`); None where there is nothing.
    mission
        The manoeuvre, for those who are told it: leaders, and everybody where estimator or law want it (`Wants(mission=True)`);
        None for others, unless they are a batch together with one who is told. `mission.target(tick, nominal)`,
        `.velocity(tick, nominal, dt)` and `.acceleration(tick, nominal, dt)` are where an agent of that nominal position is to
        be, shape (..., D), in metres, and how fast.
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
        """gamma_i, the sum of its weights l_ij over j, shape (...)."""
        return sum_over(self.stress, -1)

    @property
    def dimension(self) -> int:
        """D, 2 or 3."""
        return self.nominal.shape[-1]


_OWN = ("number", "nominal", "relative", "present", "back", "stress", "leads", "process", "leader")


def together(briefs: Sequence[Brief]) -> Brief:
    """The places of several agents as those of a batch; who is told the manoeuvre tells the others of it."""
    missions = [brief.mission for brief in briefs if brief.mission is not None]
    own: dict[str, Any] = {name: np.stack([getattr(brief, name) for brief in briefs]) for name in _OWN}
    return replace(briefs[0], mission=missions[0] if missions else None, **own)
