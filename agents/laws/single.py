"""The control laws of paper 000, Table II, for single integrators.

Each law is a frozen dataclass of its gains with two pure methods over arrays with any leading axes. All steer by
sum_j l_ij zhat_ij over the edges for which there is an estimate; an edge without one contributes nothing.
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
from agents.laws.base import Law, Nothing, stress_force
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited


class Integral(NamedTuple):
    """The running sum of the stress force, shape (..., D)."""

    force: Array


class LastHeard(NamedTuple):
    """The neighbours' velocities as last heard, shape (..., n, D)."""

    velocity: Array


@dataclass(frozen=True)
class Rest(Law[Nothing]):
    """u_i = 0: agents that stay where they are, to find out where that is."""

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = False

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Nothing:  # noqa: ARG002
        """Nothing to remember."""
        return Nothing()

    def command(
        self,
        brief: Brief,
        state: Nothing,
        tick: Reading,  # noqa: ARG002
        own: Own,
        estimate: Estimate,  # noqa: ARG002
        inputs: Heard,  # noqa: ARG002
    ) -> tuple[Nothing, Array]:
        """Stay."""
        return state, np.zeros(np.broadcast_shapes(own.input.shape, brief.nominal.shape))


@dataclass(frozen=True)
class Static(Law[Nothing]):
    """u_i = -alpha sum_j l_ij zhat_ij (Table II, static leaders).

    Parameters
    ----------
    alpha
        Gain, per second.
    """

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = True
    alpha: float = 10.0

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Nothing:  # noqa: ARG002
        """Nothing to remember."""
        return Nothing()

    def command(
        self,
        brief: Brief,
        state: Nothing,
        tick: Reading,  # noqa: ARG002
        own: Own,  # noqa: ARG002
        estimate: Estimate,
        inputs: Heard,  # noqa: ARG002
    ) -> tuple[Nothing, Array]:
        """Fall toward the formation."""
        return state, -self.alpha * stress_force(brief, estimate)

    @property
    def step_gain(self) -> float:
        """Alpha."""
        return self.alpha

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:  # noqa: ARG002
        """Of positions."""
        return np.asarray(np.eye(len(stress)) - dt * self.alpha * stress, dtype=np.float64)


@dataclass(frozen=True)
class ConstantVelocity(Law[Integral]):
    """u_i,k = -alpha sum_j l_ij zhat_ij,k - eta sum_t sum_j l_ij zhat_ij,t (Table II, constant-velocity leaders).

    Parameters
    ----------
    alpha
        Proportional gain, per second.
    eta
        Integral gain, per second, dt included. The sum over ticks is bare, so eta stands for a continuous gain times dt.
    """

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = True
    alpha: float = 10.0
    eta: float = 0.1

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Integral:
        """No force yet."""
        return Integral(np.zeros((*batch, brief.dimension)))

    def command(
        self,
        brief: Brief,
        state: Integral,
        tick: Reading,  # noqa: ARG002
        own: Own,  # noqa: ARG002
        estimate: Estimate,
        inputs: Heard,  # noqa: ARG002
    ) -> tuple[Integral, Array]:
        """Fall toward the formation, and learn the velocity it moves with."""
        force = stress_force(brief, estimate)
        total = state.force + force
        return Integral(total), -self.alpha * force - self.eta * total

    @property
    def step_gain(self) -> float:
        """Alpha."""
        return self.alpha

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:  # noqa: ARG002
        """Of positions and the integral."""
        identity, at_once = np.eye(len(stress)), self.alpha + self.eta
        return np.block([[identity - dt * at_once * stress, -dt * self.eta * identity], [stress, identity]])


@dataclass(frozen=True)
class VaryingVelocity(Law[LastHeard]):
    """u_i = -(1 / gamma_i) sum_j l_ij (alpha zhat_ij - zdot_j), gamma_i = sum_j l_ij (Table II, varying-velocity leaders).

    The law needs the neighbours' current velocities, which is an algebraic loop; over a network it becomes an iteration
    that need not converge, so the velocities' source and a relaxation are choices (`affinet check` gives the radius).

    Parameters
    ----------
    alpha
        Gain, per second.
    source
        Where zdot_j comes from: what the neighbour communicated last; one's own velocity less the estimated relative
        one; or the manoeuvre, known beforehand.
    relaxation
        eta in u <- (1 - eta) u_before + eta u_law, in (0, 1].
    """

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = True
    alpha: float = 1.0
    source: Literal["communicated", "estimated", "feed-forward"] = "communicated"
    relaxation: float = 1.0

    def init(self, brief: Brief, batch: tuple[int, ...]) -> LastHeard:
        """Neighbours at rest."""
        return LastHeard(np.zeros((*batch, *brief.relative.shape[-2:])))

    def command(
        self, brief: Brief, state: LastHeard, tick: Reading, own: Own, estimate: Estimate, inputs: Heard
    ) -> tuple[LastHeard, Array]:
        """Move as the neighbours do, and fall toward the formation."""
        heard = np.where(inputs.fresh[..., None], inputs.fields["velocity"], state.velocity)
        theirs = self._neighbours_velocity(brief, tick, own, estimate, heard)
        edges = (brief.stress, estimate.known, estimate.relative, theirs)
        return LastHeard(heard), _moved_on(*edges, brief.degree, own.input, self.alpha, self.relaxation)

    def _neighbours_velocity(self, brief: Brief, tick: Reading, own: Own, estimate: Estimate, heard: Array) -> Array:
        if self.source == "communicated":
            return heard
        if self.source == "estimated":
            if estimate.relative_velocity is None:
                raise Unsuited("the velocity source 'estimated' needs an estimator that tracks relative velocities")
            return own.velocity[..., None, :] - estimate.relative_velocity
        if brief.mission is None:
            raise Unsuited("the velocity source 'feed-forward' needs the mission in the brief")
        of_edges = tick if isinstance(tick, int) else tick[..., None]
        return brief.mission.velocity(of_edges, brief.nominal[..., None, :] - brief.relative, brief.dt)

    @property
    def wants(self) -> Wants:
        """The manoeuvre, to feed it forward."""
        return Wants(mission=self.source == "feed-forward")

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether velocities that are heard one tick late settle."""
        if self.source == "feed-forward":
            return [Finding("one-tick radius", "ok", "velocities are fed forward: no loop through the network")]
        return [heard_late.finding(self, swarm, "velocities", ", or feed velocities forward")]

    @property
    def step_gain(self) -> float:
        """Alpha."""
        return self.alpha

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array:
        """Of positions and the last input."""
        identity, share = np.eye(len(stress)), stress / degree[:, None]
        held = (1.0 - self.relaxation) * identity
        if self.source != "feed-forward":
            held = held + self.relaxation * (identity - share)
        pull = -self.relaxation * self.alpha * share
        return np.block([[identity + dt * pull, dt * held], [pull, held]])


@kernel("(n),(n),(n,D),(n,D),(),(D),(),()->(D)", "d?dddddd->d")
def _moved_on(D: int) -> Plain:
    """(1 - eta) u_before + eta u_law; who weighs nobody, as leaders, has no law."""

    def plain(
        stress: Array,
        known: Mask,
        relative: Array,
        theirs: Array,
        degree: float,
        before: Array,
        alpha: float,
        relaxation: float,
        moved_on: Array,
    ) -> None:
        for axis in range(D):
            velocity, force = 0.0, 0.0
            for edge in range(len(known)):
                velocity += stress[edge] * theirs[edge, axis]
                if known[edge]:
                    force += stress[edge] * relative[edge, axis]
            law = 0.0 if degree == 0.0 else (velocity - alpha * force) / degree
            moved_on[axis] = (1.0 - relaxation) * before[axis] + relaxation * law

    return plain
