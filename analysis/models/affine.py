"""Affine formations: a nominal shape under a sequence of affine maps (paper 000, section II-B)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.kernels.kernel import Part, Plain, kernel
from analysis.models.arrays import Array, Integers


@dataclass(frozen=True)
class Manoeuvre:
    """A sequence of affine maps: agent i's target in tick k is theta[k] p_i + offset[k].

    Parameters
    ----------
    theta
        Shape (ticks + 1, D, D).
    offset
        Shape (ticks + 1, D), in metres.
    """

    theta: Array
    offset: Array

    def target(self, tick: int | Integers, nominal: Array) -> Array:
        """Target positions of agents at nominal positions (..., D), in metres (paper 000, eq. 3), in a tick each.

        Ticks and agents broadcast against each other; before its first and after its last tick the manoeuvre rests.
        """
        target: Array = _targets(self.theta, self.offset, np.asarray(tick), nominal)
        return target

    def velocity(self, tick: int | Integers, nominal: Array, dt: float) -> Array:
        """Mean target velocity from this tick to the next, shape (..., D), in metres per second."""
        velocity: Array = _velocities(self.theta, self.offset, np.asarray(tick), nominal, dt)
        return velocity

    def acceleration(self, tick: int | Integers, nominal: Array, dt: float) -> Array:
        """Second difference of the target about this tick, shape (..., D), in metres per second squared."""
        acceleration: Array = _accelerations(self.theta, self.offset, np.asarray(tick), nominal, dt)
        return acceleration


@Part
def placed(theta: Array, offset: Array, tick: int, nominal: Array, axis: int) -> float:
    """A coordinate of the target in a tick of an agent at a nominal position (D,) (paper 000, eq. 3)."""
    reached, turned = min(max(tick, 0), len(theta) - 1), 0.0
    for other in range(len(nominal)):
        turned += theta[reached, axis, other] * nominal[other]
    return float(turned + offset[reached, axis])


@Part
def travelling(theta: Array, offset: Array, tick: int, nominal: Array, dt: float, axis: int) -> float:
    """A coordinate of its mean velocity from this tick to the next, in metres per second."""
    here = placed(theta, offset, tick, nominal, axis)
    return (placed(theta, offset, tick + 1, nominal, axis) - here) / dt


@kernel("(t,D,D),(t,D),(),(D)->(D)", "ddld->d")
def _targets(D: int) -> Plain:
    def plain(theta: Array, offset: Array, tick: int, nominal: Array, target: Array) -> None:
        for axis in range(D):
            target[axis] = placed(theta, offset, tick, nominal, axis)

    return plain


@kernel("(t,D,D),(t,D),(),(D),()->(D)", "ddldd->d")
def _velocities(D: int) -> Plain:
    def plain(theta: Array, offset: Array, tick: int, nominal: Array, dt: float, velocity: Array) -> None:
        for axis in range(D):
            velocity[axis] = travelling(theta, offset, tick, nominal, dt, axis)

    return plain


@kernel("(t,D,D),(t,D),(),(D),()->(D)", "ddldd->d")
def _accelerations(D: int) -> Plain:
    def plain(theta: Array, offset: Array, tick: int, nominal: Array, dt: float, acceleration: Array) -> None:
        for axis in range(D):
            before = travelling(theta, offset, tick - 1, nominal, dt, axis)
            acceleration[axis] = (travelling(theta, offset, tick, nominal, dt, axis) - before) / dt

    return plain
