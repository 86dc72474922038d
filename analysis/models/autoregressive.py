"""Autoregressive models of control inputs, fitted by the Yule-Walker equations (paper 004, section 6.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz

from analysis.models.algebra import product
from analysis.models.arrays import Array


@dataclass(frozen=True)
class Model:
    """u_t = sum_l a_l u_t-l + n_t (6.5), the same for all axes.

    Parameters
    ----------
    coefficients
        a_1 .. a_p.
    sigma_n
        Standard deviation of what drives it, per axis, in the unit of the signal.
    sigma_u
        That of the signal itself: the square root of R_u(0).
    """

    coefficients: tuple[float, ...]
    sigma_n: float
    sigma_u: float


def fit(signals: Array, order: int) -> Model:
    """The model of many signals, each taken for stationary with mean zero.

    Parameters
    ----------
    signals
        Shape (T, ...): over time, each component of each agent a signal of its own.
    order
        p.

    Raises
    ------
    ValueError
        When there are too few moments, or nothing moves.
    """
    ticks = len(signals)
    if ticks <= order:
        raise ValueError(f"a model of order {order} needs more than {order} ticks, not {ticks}")
    flat = signals.reshape(ticks, -1)
    # Divided by T at every lag, so that the model is stable.
    covariance = np.array([(flat[lag:] * flat[: ticks - lag]).sum() for lag in range(order + 1)]) / flat.size
    if covariance[0] == 0.0:
        raise ValueError("the inputs are zero throughout: there is nothing to fit")
    a = solve_toeplitz(covariance[:order], covariance[1:])
    driven = max(covariance[0] - float(product(a, covariance[1:])), 0.0)
    return Model(tuple(a.tolist()), float(np.sqrt(driven)), float(np.sqrt(covariance[0])))
