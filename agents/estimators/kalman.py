"""The Kalman core: predict and correct, over stacks of independent filters.

The state of one relative edge stacks position, velocity and acceleration, D numbers each, so that the observed position is
its first D entries. Sums run in `matmul`, matrix by matrix: a stack of filters gives the bits of each alone.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from agents.brief import Array, Mask
from agents.estimators.small import inverse


@cache
def constant_acceleration(dimension: int, dt: float, sigma_w: float) -> tuple[Array, Array]:
    """Transition F and process covariance Q of the constant-acceleration model (paper 000, eqs. 20-21).

    Parameters
    ----------
    dimension
        D.
    dt
        Tick, in seconds.
    sigma_w
        Standard deviation of the acceleration, in metres per second squared.

    Returns
    -------
    tuple of Array
        Both (3 D, 3 D), ordered (position, velocity, acceleration).
    """
    identity = np.eye(dimension)
    transition = np.array([[1.0, dt, dt**2 / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    deflection = np.array([dt**2 / 2, dt, 1.0])
    F = np.kron(transition, identity)
    Q = sigma_w**2 * np.kron(np.outer(deflection, deflection), identity)
    return np.asarray(F, dtype=np.float64), np.asarray(Q, dtype=np.float64)


def predict(mean: Array, covariance: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """One step ahead (Algorithm 1, lines 4-5): mean (..., S), covariance (..., S, S)."""
    return mean @ F.T, F @ covariance @ F.T + Q


def correct(mean: Array, covariance: Array, observed: Array, R: Array, usable: Mask) -> tuple[Array, Array]:
    """The filters after an observation of their position, where it is usable (Algorithm 1, lines 7-11).

    Parameters
    ----------
    mean, covariance
        Predicted, shapes (..., S) and (..., S, S).
    observed
        Positions, shape (..., D).
    R
        Their covariance, shape (..., D, D).
    usable
        Where there is an observation, shape (...); the others are left as predicted.
    """
    dimension = observed.shape[-1]
    innovation = observed - mean[..., :dimension]
    gain = covariance[..., :dimension] @ inverse(covariance[..., :dimension, :dimension] + R)
    gain = np.where(usable[..., None, None], gain, 0.0)
    corrected = mean + (gain @ innovation[..., None])[..., 0]
    return corrected, covariance - gain @ covariance[..., :dimension, :]
