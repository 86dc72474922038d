"""How bodies move under their inputs, and bodies that do not obey.

Chains of integrators (paper 000, eq. 4; paper 002, eq. 1), and unicycles. A body joins by a class here and its line in
`BODIES`, and by its name and keys in `affinet/scenario/sections.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from math import factorial
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array
from analysis.models.elementary import cos, sin, whole_power
from netem.faults.conditions import Conditions


class Motion(NamedTuple):
    """Where bodies are, and how they move.

    Parameters
    ----------
    position
        Shape (N, D), in metres.
    derivatives
        Velocity, and higher derivatives as far as the bodies integrate them, shape (N, K, D), in metres per second, per second
        squared ...; where the input is the velocity, that of the tick before.
    pose
        What else there is to where a body is, shape (N, S): of a unicycle its heading, in radians.
    """

    position: Array
    derivatives: Array
    pose: Array


class Body(Protocol):
    """A kind of body.

    `dimensions` are those in which it moves; `odometry` says whether agents are told the derivatives, as those are who cannot
    know them from their input.
    """

    dimensions: ClassVar[tuple[int, ...]]

    @property
    def order(self) -> int:
        """Of the derivative that it takes as its input: 1 for a velocity."""

    @property
    def odometry(self) -> bool:
        """Whether agents are told the derivatives."""

    def rest(self, position: Array) -> Motion:
        """At rest at these positions (N, D)."""

    def coasting(self, at: Motion) -> Array:
        """The inputs (N, D) of bodies that go on as they did."""

    def moved(self, at: Motion, flown: Array, push: Array, dt: float) -> Motion:
        """A tick later, under inputs (N, D), and pushed along (N, D), in metres per second."""


@dataclass(frozen=True)
class Integrators:
    """Bodies whose input is a derivative of their position.

    Parameters
    ----------
    order
        Of that derivative: 1 for single integrators.
    """

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    order: int

    @property
    def odometry(self) -> bool:
        """Single integrators know their velocity: it is their input."""
        return self.order > 1

    def rest(self, position: Array) -> Motion:
        """Nothing moves."""
        still = np.repeat(np.zeros_like(position)[:, None], max(1, self.order - 1), axis=1)
        return Motion(position, still, np.zeros((len(position), 0)))

    def coasting(self, at: Motion) -> Array:
        """The velocity stays, or what is integrated to it is 0."""
        return at.derivatives[:, 0] if self.order == 1 else np.zeros_like(at.position)

    def moved(self, at: Motion, flown: Array, push: Array, dt: float) -> Motion:
        """Each derivative is carried by those above it, up to the input, which is held."""
        if self.order == 1:
            return Motion(at.position + dt * (flown + push), flown[:, None], at.pose)
        position, derivatives = _integrated(at.position, at.derivatives, flown, push, dt)
        return Motion(position, derivatives, at.pose)


@kernel("(D),(k,D),(D),(p),()->(D),(k,D)", "ddddd->dd")
def _integrated(D: int) -> Plain:
    """As `carried` has it, for the position and each derivative of one body; a push along one axis is one along all."""

    def plain(
        position: Array, derivatives: Array, flown: Array, push: Array, dt: float, moved: Array, led: Array
    ) -> None:
        number = len(derivatives)
        for axis in range(D):
            for level in range(number + 1):
                value = derivatives[level - 1, axis] if level else position[axis]
                weight, ways = 1.0, 1.0
                for order in range(level, number + 1):
                    rate = derivatives[order, axis] if order < number else flown[axis]
                    if order == 0:
                        rate += push[min(axis, len(push) - 1)]
                    weight *= dt
                    ways *= order - level + 1
                    value += weight / ways * rate
                if level:
                    led[level - 1, axis] = value
                else:
                    moved[axis] = value

    return plain


@dataclass(frozen=True)
class Unicycle:
    """A body on wheels: it rolls along its heading, and turns (Siciliano et al., Robotics, 2009, section 11.6.1).

    What it is told is a velocity u for a point at a distance ahead of its wheels: it rolls at v = e' u, with e its heading, and
    turns at omega = n' u / ahead, with n to the left of it, which is what gives that point the velocity u. Both are held for a
    tick, so it moves on an arc of a circle. Under them, whatever u falls along falls too, since u' e e' u >= 0.

    Parameters
    ----------
    ahead
        In metres.
    """

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    order: ClassVar[int] = 1
    odometry: ClassVar[bool] = True
    ahead: float

    def rest(self, position: Array) -> Motion:
        """Everybody heads along the first axis."""
        return Motion(position, np.zeros_like(position)[:, None], np.zeros((len(position), 1)))

    def coasting(self, at: Motion) -> Array:
        """The velocity that it had: it goes straight on."""
        return at.derivatives[:, 0]

    def moved(self, at: Motion, flown: Array, push: Array, dt: float) -> Motion:
        """Along the arc; the velocity is the chord over the tick."""
        heading = at.pose[:, 0]
        east, north = cos(heading), sin(heading)
        speed = east * flown[:, 0] + north * flown[:, 1]
        turn = (east * flown[:, 1] - north * flown[:, 0]) / self.ahead * dt
        half = turn / 2.0
        chord = speed * np.where(half == 0.0, 1.0, sin(half) / np.where(half == 0.0, 1.0, half))
        velocity = chord[:, None] * np.stack([cos(heading + half), sin(heading + half)], axis=-1)
        return Motion(carried([at.position, velocity + push], dt), velocity[:, None], (heading + turn)[:, None])


BODIES: Mapping[str, Callable[..., Body]] = {
    "single-integrator": partial(Integrators, 1),
    "double-integrator": partial(Integrators, 2),
    "triple-integrator": partial(Integrators, 3),
    "quadruple-integrator": partial(Integrators, 4),
    "unicycle": Unicycle,
}


@dataclass(frozen=True)
class BodyModel:
    """Which bodies there are, as it travels.

    Parameters
    ----------
    model
        A name in `BODIES`.
    parameters
        What the body is made with.
    """

    model: str
    parameters: Mapping[str, float]

    def build(self) -> Body:
        """The body."""
        return BODIES[self.model](**self.parameters)


def carried(derivatives: Sequence[Array], dt: float) -> Array:
    """A quantity a tick later, of which these are the value and its derivatives (...), the last of them held.

    z_k+1 = z_k + dt u_k for single integrators, z_k + dt zdot_k + dt^2 / 2 u_k for double ones, and so on.
    """
    value, *rates = derivatives
    return reduce(
        np.add, [whole_power(dt, order) / factorial(order) * rate for order, rate in enumerate(rates, 1)], value
    )


def flown(commanded: Array, coasting: Array, now: Conditions) -> Array:
    """The inputs that bodies fly, shape (N, D).

    Parameters
    ----------
    commanded, coasting
        What their agents command, and what a body without a command flies, so that it goes on as it did, shape (N, D).
    now
        Who has none; a body that holds does not fly at all.
    """
    flown: Array = _flown(commanded, coasting, now.coasting, now.still)
    return flown


@kernel("(D),(D),(),()->(D)", "dd??->d")
def _flown(D: int) -> Plain:
    def plain(commanded: Array, going_on: Array, coasts: bool, holds: bool, flown: Array) -> None:
        for axis in range(D):
            flown[axis] = going_on[axis] if coasts else 0.0 if holds else commanded[axis]

    return plain
