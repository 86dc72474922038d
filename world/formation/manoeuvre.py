"""Manoeuvres: the affine map of every tick, from a closed form or from keyframes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtr

from analysis.models.affine import Manoeuvre
from analysis.models.algebra import product
from analysis.models.arrays import Array
from analysis.models.elementary import arctan2, cos, exp, sin

if TYPE_CHECKING:
    from scipy.interpolate import CubicHermiteSpline

_QUARTER_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
_COLLAPSE = np.array([[-1.375, -0.375], [0.0, 0.0]])
_ANCHOR = np.array([4.0, 0.0])
_LOOKS = 65  # at the way from one keyframe to the next, its middle among them

# What the presets fly between, for pictures: lines through points, in metres.
WALLS: Mapping[str, Sequence[Sequence[tuple[float, ...]]]] = {
    "corridor": (
        ((-6.0, 4.0), (48.0, 4.0), (48.0, -8.0)),
        ((-6.0, -4.0), (19.0, -4.0), (19.0, -1.4), (25.0, -1.4), (25.0, -4.0), (38.5, -4.0), (38.5, -8.0)),
        ((19.0, 4.0), (19.0, 1.4), (25.0, 1.4), (25.0, 4.0)),
    ),
    "ravine": (
        *(((15.5, y, 3.0), (21.0, y, 3.0), (21.0, y, 9.0), (15.5, y, 9.0), (15.5, y, 3.0)) for y in (-1.3, 1.3)),
        *(
            ((32.0, -11.0, z), (38.0, -11.0, z), (38.0, -14.5, z), (32.0, -14.5, z), (32.0, -11.0, z))
            for z in (5.5, 6.5)
        ),
    ),
}


def corridor(seconds: Array) -> Manoeuvre:
    """The 125 s manoeuvre of Zhao 2018 that paper 000 flies for 60 s: through two gaps, around two corners, to a line.

    Parameters
    ----------
    seconds
        Times of the ticks, shape (T,).

    Returns
    -------
    Manoeuvre
        In two dimensions, written for the nominal positions 2 P of `zhao7`.
    """

    def turn(start: float, duration: float) -> Array:
        return _bell_step(seconds, start, duration)[:, None, None]

    identity = np.eye(2)
    squeeze = np.diag([0.0, 0.5])
    theta = (
        identity
        + (turn(30, 10) - turn(15, 10)) * squeeze
        + turn(50, 10) * (_QUARTER_TURN - identity)
        - turn(75, 10) * (identity + _QUARTER_TURN)
        + turn(90, 20) * (_COLLAPSE + identity)
        - turn(120, 5) * (_COLLAPSE + identity)
    )
    course = np.stack(
        [
            4.0 + _travel(seconds, 0, 15) - _travel(seconds, 45, 5) - _travel(seconds, 75, 10),
            _travel(seconds, 70, 5) - _travel(seconds, 50, 10),
        ],
        axis=-1,
    )
    return Manoeuvre(theta, course - product(theta, _ANCHOR))


def ravine(seconds: Array) -> Manoeuvre:
    """60 s in three dimensions: a climb, a narrow slot, a quarter turn, and a low ceiling that leaves everybody in a plane.

    Parameters
    ----------
    seconds
        Times of the ticks, shape (T,).

    Returns
    -------
    Manoeuvre
        In three dimensions, written for the nominal positions of `octa10`.
    """
    blend = partial(_bell_step, seconds)
    turned = 0.5 * np.pi * blend(34, 10)
    cosine, sine, nothing, one = cos(turned), sin(turned), np.zeros_like(turned), np.ones_like(turned)
    yaw = _matrix([[cosine, sine, nothing], [-sine, cosine, nothing], [nothing, nothing, one]])
    width = 1.0 - 0.6 * (blend(12, 8) - blend(24, 8))
    height = 1.0 - blend(44, 6) + blend(53, 6)
    course = [
        _travel(seconds, 0, 8) - _travel(seconds, 34, 10),
        -_travel(seconds, 34, 10),
        0.5 * (_travel(seconds, 3, 6) - _travel(seconds, 15, 6)),
    ]
    scale = _matrix([[one, nothing, nothing], [nothing, width, nothing], [nothing, nothing, height]])
    return Manoeuvre(product(yaw, scale), np.stack(course, axis=-1))


def hover(seconds: Array, dimension: int) -> Manoeuvre:
    """The nominal formation at rest."""
    ticks = len(seconds)
    return Manoeuvre(
        np.broadcast_to(np.eye(dimension), (ticks, dimension, dimension)).copy(), np.zeros((ticks, dimension))
    )


def keyframes(
    seconds: Array, times: Sequence[float], theta: Array, offset: Array, angle: Array | None = None
) -> Manoeuvre:
    """Monotone cubic interpolation between affine maps: no overshoot, continuous velocity, at rest before and after.

    Parameters
    ----------
    seconds
        Times of the ticks, shape (T,).
    times
        Of the keyframes, increasing, at least two, in seconds.
    theta, offset
        The maps at these times, shapes (F, D, D) and (F, D).
    angle
        By which what theta makes is turned at these times, counterclockwise, in three dimensions about the third axis, shape
        (F,), in radians. It passes through all angles between, where the entries of a theta that turns go straight.
    """
    within = np.clip(seconds, times[0], times[-1])
    shape = _smooth(times, theta)(within)
    if angle is not None:
        shape = product(_turn(_smooth(times, angle)(within), theta.shape[-1]), shape)
    return Manoeuvre(shape, _smooth(times, offset)(within))


def course(seconds: Array, times: Sequence[float], points: Array, order: int) -> Array:
    """A way through points by monotone cubics, at rest before and after, and its derivatives, shape (T, order, D).

    Parameters
    ----------
    seconds
        Times of the ticks, shape (T,).
    times
        When it is at the points, increasing, at least two, in seconds.
    points
        Shape (F, D), in metres.
    order
        How many of position, velocity and so on.
    """
    within, on_the_way = np.clip(seconds, times[0], times[-1]), (times[0] <= seconds) & (seconds < times[-1])
    way = _smooth(times, points)
    derivatives = [np.where(on_the_way[:, None], way(within, nu), 0.0) for nu in range(1, order)]
    return np.stack([way(within), *derivatives], axis=1)


def led_by(nominal: Array, flown: Array) -> tuple[Manoeuvre, Array]:
    """The affine map of every tick by which leaders come nearest to where they fly, and how far off they are, (T, K).

    Parameters
    ----------
    nominal
        Of K leaders that span the space, shape (K, D), in metres.
    flown
        Where they fly, shape (T, K, D).
    """
    with_one = np.concatenate([nominal, np.ones((len(nominal), 1))], axis=1)
    fitted = product(np.linalg.pinv(with_one), flown)
    off = flown - product(with_one, fitted)
    theta = np.swapaxes(fitted[:, :-1], -1, -2)
    return Manoeuvre(np.ascontiguousarray(theta), fitted[:, -1]), np.sqrt((off * off).sum(axis=-1))


def narrowest(times: Sequence[float], theta: Array) -> Array:
    """How narrow a formation gets from each keyframe to the next, shape (F - 1,), as a share of its width at the narrower end.

    By the smallest singular value of the map: 1 where it is nowhere smaller than at the ends, 0 where the formation collapses.
    """
    way = np.array([np.linspace(*leg, _LOOKS) for leg in pairwise(times)])
    smallest = np.linalg.svd(_smooth(times, theta)(way), compute_uv=False)[..., -1]
    ends = np.minimum(smallest[:, 0], smallest[:, -1])
    narrow = smallest.min(axis=-1)
    return np.where(narrow < ends, narrow / np.where(ends > 0.0, ends, 1.0), 1.0)


def turned(theta: Array, angle: Array) -> Array:
    """How far a formation turns from each keyframe to the next, shape (F - 1,), in radians.

    By theta it turns the shortest way, by angle as far as that says. In three dimensions a turn by theta has no sign.
    """
    U, _, Vt = np.linalg.svd(theta)
    rotation = product(U, Vt)
    between = product(rotation[1:], np.swapaxes(rotation[:-1], -1, -2))
    if theta.shape[-1] == 2:
        by_theta = arctan2(between[:, 1, 0] - between[:, 0, 1], between[:, 0, 0] + between[:, 1, 1])
    else:
        cosine = np.clip((np.trace(between, axis1=-2, axis2=-1) - 1.0) / 2.0, -1.0, 1.0)
        by_theta = arctan2(np.sqrt(1.0 - cosine * cosine), cosine)
    total: Array = by_theta + np.diff(angle)
    return total


def _smooth(times: Sequence[float], values: Array) -> CubicHermiteSpline:
    # Takes half a second to import, and only keyframes need it.
    from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

    slopes = PchipInterpolator(times, values).derivative()(times)
    slopes[0], slopes[-1] = 0.0, 0.0  # from rest, and to rest
    return CubicHermiteSpline(times, values, slopes)


def _turn(angle: Array, dimension: int) -> Array:
    """Rotations by angles (T,), shape (T, D, D)."""
    cosine, sine = cos(angle), sin(angle)
    rotation = np.broadcast_to(np.eye(dimension), (len(angle), dimension, dimension)).copy()
    rotation[:, :2, :2] = _matrix([[cosine, -sine], [sine, cosine]])
    return rotation


def _matrix(rows: list[list[Array]]) -> Array:
    """Entries over time, each (T,), as matrices (T, D, D)."""
    return np.moveaxis(np.array(rows), -1, 0)


def _bell_step(seconds: Array, start: float, duration: float) -> Array:
    """F(t; t0, T) of the benchmark: the integral of a normal speed profile cut off at 4 sigma; it ends at 0.9989."""
    u = np.clip(seconds, start, start + duration)
    sigma = duration / 8
    edge = exp(-8.0) / np.sqrt(2 * np.pi)
    step: Array = ndtr((u - start - duration / 2) / sigma) - ndtr(-4.0) - 8 * edge * (u - start) / duration
    return step


def _travel(seconds: Array, start: float, duration: float) -> Array:
    """S(t; t0, T) of the benchmark: metres covered when the speed rises from 0 to 1 m/s along half a cosine."""
    v = np.clip(seconds - start, 0.0, duration)
    rising = (v - duration / np.pi * sin(np.pi * v / duration)) / 2
    return rising + np.maximum(seconds - start - duration, 0.0)
