"""A target that is driven by noise, and detectors that find it with a latency (paper 002, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from math import factorial
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from analysis.models.elementary import whole_powers


class Sighting(NamedTuple):
    """What detectors say in a tick.

    Parameters
    ----------
    position
        Of the target, when the detection began, shape (..., D), in metres; NaN of one that found nothing, of no meaning where
        none is done.
    done
        Whether a detection is done in this tick, shape (...).
    by
        Which method found it, shape (...).
    method
        Which the detector uses from now on, shape (...).
    """

    position: Array
    done: Mask
    by: Integers
    method: Integers


@dataclass(frozen=True)
class Target:
    """What is pursued, and how it can be found; all axes are alike and independent.

    Parameters
    ----------
    order
        m: how often what drives it is integrated to a position.
    intensity
        W of the Wiener process that drives it, as far as is known, per axis, in m2/s^(2m - 1).
    latencies
        How long each method of detection takes, shape (M,), in ticks.
    variances
        Of a position that it finds, per axis, shape (M,), in square metres.
    """

    order: int
    intensity: float
    latencies: Integers
    variances: Array


def transition(order: int, seconds: Array) -> Array:
    """A_d: how position and derivatives go on undisturbed for times (...), shape (..., m, m) (4)."""
    steps = np.arange(order)[None, :] - np.arange(order)[:, None]
    forward = np.maximum(steps, 0)
    factorials = np.array([float(factorial(step)) for step in range(order)])
    powers = whole_powers(seconds, order)[..., forward] / factorials[forward]
    return np.where(steps >= 0, powers, 0.0)


def diffusion(order: int, seconds: Array, intensity: float) -> Array:
    """W_d: the covariance of what noise has done to them after times (...), shape (..., m, m) (4)."""
    lower = order - 1 - np.arange(order)
    exponent = lower[:, None] + lower[None, :] + 1
    scale = np.array([float(factorial(step)) for step in range(order)])[lower]
    spread: Array = (
        intensity * whole_powers(seconds, 2 * order)[..., exponent] / (exponent * scale[:, None] * scale[None, :])
    )
    return spread
