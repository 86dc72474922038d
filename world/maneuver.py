"""Manoeuvres: the affine map of every tick, from a closed form or from keyframes."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator
from scipy.special import ndtr

from analysis.affine import Array, Manoeuvre
from numerics.algebra import product
from numerics.elementary import cos, exp, sin

_QUARTER_TURN = np.array([[0.0, 1.0], [-1.0, 0.0]])
_COLLAPSE = np.array([[-1.375, -0.375], [0.0, 0.0]])
_ANCHOR = np.array([4.0, 0.0])


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


def keyframes(seconds: Array, times: Sequence[float], theta: Array, offset: Array) -> Manoeuvre:
    """Monotone cubic interpolation between affine maps: no overshoot, continuous velocity, at rest before and after.

    Parameters
    ----------
    seconds
        Times of the ticks, shape (T,).
    times
        Of the keyframes, increasing, at least two, in seconds.
    theta, offset
        The maps at these times, shapes (F, D, D) and (F, D).
    """
    within = np.clip(seconds, times[0], times[-1])
    return Manoeuvre(_smooth(times, theta)(within), _smooth(times, offset)(within))


def _smooth(times: Sequence[float], values: Array) -> CubicHermiteSpline:
    slopes = PchipInterpolator(times, values).derivative()(times)
    slopes[0], slopes[-1] = 0.0, 0.0  # from rest, and to rest
    return CubicHermiteSpline(times, values, slopes)


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
