"""The control laws for double integrators (Zhao 2018, Affine formation maneuver control of multiagent systems), and a pilot.

They are the laws of paper 000, Table II, one derivative up: the input is an acceleration, and relative velocities damp what
relative positions drive. A neighbour's velocity is what it communicated last, or what the estimator makes of its motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, NamedTuple

import numpy as np

from agents.brief import Brief, Own, Reading
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.laws import heard_late
from agents.laws.base import Law, by_degree, stress_force, weighted
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited

Source = Literal["communicated", "estimated"]


class LastSaid(NamedTuple):
    """The neighbours' velocities and accelerations as last heard, (..., n, D), and who was ever heard, shape (..., n)."""

    velocity: Array
    acceleration: Array
    ever: Mask


@dataclass(frozen=True)
class _Damped(Law[LastSaid]):
    """What both laws share: the pull of the estimated edges, damped by how the neighbours' velocities differ from one's own."""

    order: ClassVar[int] = 2
    by_stress: ClassVar[bool] = True
    position_gain: float
    velocity_gain: float
    source: Source = "communicated"

    def init(self, brief: Brief, batch: tuple[int, ...]) -> LastSaid:
        """Nobody heard yet."""
        rest = np.zeros((*batch, *brief.relative.shape[-2:]))
        return LastSaid(rest, rest, np.zeros(rest.shape[:-1], dtype=bool))

    def _pull(self, brief: Brief, own: Own, estimate: Estimate, said: LastSaid) -> Array:
        """sum_j l_ij (k_p zhat_ij + k_v (zdot_i - zdot_j)), shape (..., D), in metres per second squared."""
        closing = _closing(brief, self.source, own, estimate, said)
        return self.position_gain * stress_force(brief, estimate) + self.velocity_gain * closing


@dataclass(frozen=True)
class DoubleConstantVelocity(_Damped):
    """u_i = -sum_j l_ij (k_p zhat_ij + k_v (zdot_i - zdot_j)), for leaders at rest or at constant velocity.

    Parameters
    ----------
    position_gain
        Gain k_p on positions, per second squared.
    velocity_gain
        Gain k_v on velocities, per second.
    source
        Where zdot_j comes from.
    """

    position_gain: float = 10.0
    velocity_gain: float = 30.0

    def command(
        self,
        brief: Brief,
        state: LastSaid,
        tick: Reading,  # noqa: ARG002
        own: Own,
        estimate: Estimate,
        inputs: Heard,
    ) -> tuple[LastSaid, Array]:
        """Fall toward the formation, damped."""
        said = _hear(state, inputs)
        return said, -self._pull(brief, own, estimate, said)

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:  # noqa: ARG002
        """Of positions and velocities."""
        identity = np.eye(len(stress))
        pull = np.block([-self.position_gain * stress, -self.velocity_gain * stress])
        coasting = np.block([[identity, dt * identity], [0.0 * identity, identity]])
        return np.asarray(coasting + _integrated(pull, dt), dtype=np.float64)


@dataclass(frozen=True)
class DoubleVaryingVelocity(_Damped):
    """u_i = -(1 / gamma_i) sum_j l_ij (k_p zhat_ij + k_v (zdot_i - zdot_j) - zddot_j), gamma_i = sum_j l_ij.

    For leaders that accelerate. As with velocities in Table II, the neighbours' accelerations are heard one tick late: an
    iteration that need not converge (`affinet check` gives the radius).

    Parameters
    ----------
    position_gain
        Gain k_p on positions, per second squared.
    velocity_gain
        Gain k_v on velocities, per second.
    source
        Where zdot_j comes from.
    relaxation
        eta in u <- (1 - eta) u_before + eta u_law, in (0, 1].
    """

    position_gain: float = 1.0
    velocity_gain: float = 2.0
    relaxation: float = 1.0

    def command(
        self,
        brief: Brief,
        state: LastSaid,
        tick: Reading,  # noqa: ARG002
        own: Own,
        estimate: Estimate,
        inputs: Heard,
    ) -> tuple[LastSaid, Array]:
        """Accelerate as the neighbours do, and fall toward the formation, damped."""
        said = _hear(state, inputs)
        accelerations = weighted(brief.stress, said.acceleration)
        law = by_degree(accelerations - self._pull(brief, own, estimate, said), brief.degree)
        return said, (1.0 - self.relaxation) * own.input + self.relaxation * law

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether accelerations that are heard one tick late settle."""
        return [heard_late.finding(self, swarm, "accelerations")]

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:
        """Of positions, velocities and the last input."""
        identity, share = np.eye(len(stress)), self.relaxation * stress / degree[:, None]
        law_of_state = np.block([-self.position_gain * share, -self.velocity_gain * share, identity - share])
        moves = np.block([[identity, dt * identity, 0.0 * identity], [0.0 * identity, identity, 0.0 * identity]])
        return np.vstack([moves + _integrated(law_of_state, dt), law_of_state])


def _hear(state: LastSaid, inputs: Heard) -> LastSaid:
    fresh = inputs.fresh[..., None]
    return LastSaid(
        np.where(fresh, inputs.fields["velocity"], state.velocity),
        np.where(fresh, inputs.fields["acceleration"], state.acceleration),
        state.ever | inputs.fresh,
    )


def _integrated(acceleration: Array, dt: float) -> Array:
    """What accelerations, rows (F, S) over the state, do to positions and velocities in a tick, shape (2 F, S)."""
    return np.vstack([0.5 * dt * dt * acceleration, dt * acceleration])


def _closing(brief: Brief, source: Source, own: Own, estimate: Estimate, heard: LastSaid) -> Array:
    """sum_j l_ij (zdot_i - zdot_j) over the neighbours whose velocity is known, shape (..., D), in metres per second."""
    if source == "communicated":
        stress = np.where(heard.ever, brief.stress, 0.0)
        return weighted(stress, own.velocity[..., None, :] - heard.velocity)
    if estimate.relative_velocity is None:
        raise Unsuited("the velocity source 'estimated' needs an estimator that tracks relative velocities")
    return weighted(np.where(estimate.known, brief.stress, 0.0), estimate.relative_velocity)
