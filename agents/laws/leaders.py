"""How leaders are steered: after the manoeuvre, or holding their distances; and what no body can exceed."""

from __future__ import annotations

import numpy as np

from agents.brief import Brief, Reading
from agents.estimate import Estimate
from analysis.kernels.kernel import Plain, kernel
from analysis.models.affine import Manoeuvre, placed, travelling
from analysis.models.arrays import Array, Mask


def pilot(brief: Brief, mission: Manoeuvre, gain: float, tick: Reading, position: Array) -> Array:
    """A leader's input: the target's velocity, and a pull toward the target, shape (..., D), in metres per second.

    Parameters
    ----------
    brief, mission, tick
        Its place in the formation, the manoeuvre, and what its clock says.
    gain
        Of the pull, per second.
    position
        The leader's own, shape (..., D), in metres.
    """
    led: Array = _piloted(mission.theta, mission.offset, tick, brief.nominal, position, brief.dt, gain)
    return led


@kernel("(t,D,D),(t,D),(),(D),(D),(),()->(D)", "ddldddd->d")
def _piloted(D: int) -> Plain:
    def plain(
        theta: Array, offset: Array, tick: int, nominal: Array, position: Array, dt: float, gain: float, led: Array
    ) -> None:
        for axis in range(D):
            behind = placed(theta, offset, tick, nominal, axis) - position[axis]
            led[axis] = travelling(theta, offset, tick, nominal, dt, axis) + gain * behind

    return plain


def hold_distances(brief: Brief, gain: float, estimate: Estimate) -> Array:
    """A leader's input among leaders that keep their distances, shape (..., D), in metres per second (paper 004, section 3.5).

    The gradient of sum_j (|z_ij|^2 - |p_ij|^2)^2 / 4 over the other leaders, which all know each other.

    Parameters
    ----------
    brief
        Its place in the formation.
    gain
        Per second and square metre.
    estimate
        What it believes of its edges.
    """
    held: Array = _held(estimate.relative, brief.relative, brief.leads & estimate.known)
    return -gain * held


@kernel("(n,D),(n,D),(n)->(D)", "dd?->d")
def _held(D: int) -> Plain:
    def plain(z: Array, p: Array, led: Mask, held: Array) -> None:
        for axis in range(D):
            held[axis] = 0.0
        for edge in range(len(led)):
            if led[edge]:
                stretch = 0.0
                for axis in range(D):
                    stretch += z[edge, axis] * z[edge, axis] - p[edge, axis] * p[edge, axis]
                for axis in range(D):
                    held[axis] += stretch * z[edge, axis]

    return plain


def saturated(command: Array, limit: float) -> Array:
    """Inputs (..., D) shortened to this length, in their unit, where they are longer."""
    length = np.sqrt((command * command).sum(axis=-1, keepdims=True))
    return command * (limit / np.maximum(length, limit))


def pilot_of_accelerations(
    brief: Brief, mission: Manoeuvre, gain: float, tick: Reading, position: Array, velocity: Array
) -> Array:
    """A leader's input: the target's acceleration, and a critically damped pull, shape (..., D), in metres per second squared.

    Parameters
    ----------
    brief, mission, tick
        Its place in the formation, the manoeuvre, and what its clock says.
    gain
        Natural frequency of the pull, per second.
    position, velocity
        The leader's own, shape (..., D), in metres and metres per second.
    """
    acceleration = mission.acceleration(tick, brief.nominal, brief.dt)
    # The velocity at the tick itself; that from one tick to the next would be half a tick ahead.
    wanted = mission.velocity(tick, brief.nominal, brief.dt) - 0.5 * brief.dt * acceleration
    astray = mission.target(tick, brief.nominal) - position
    pull = gain * gain * astray + 2.0 * gain * (wanted - velocity)
    return acceleration + pull
