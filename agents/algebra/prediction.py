"""What was last known of a target, carried on to now with its derivatives: the optimal estimate of paper 002, (5) and (6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.models import jets
from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers
from analysis.models.pursuit import Target, diffusion, transition


class Prediction(NamedTuple):
    """An optimal estimate (5): mean (..., m, D), covariance (..., m, m), and the tick of which it is, (...)."""

    mean: Array
    covariance: Array
    made: Integers


def carried(target: Target, prediction: Prediction, seconds: Array) -> tuple[Array, Array]:
    """Mean and covariance after some time (6)."""
    A = transition(target.order, seconds)
    spread = product(A, prediction.covariance, np.swapaxes(A, -1, -2)) + diffusion(
        target.order, seconds, target.intensity
    )
    return product(A, prediction.mean), spread


def predicted(target: Target, prediction: Prediction, now: Integers, dt: float) -> tuple[Array, Array]:
    """Jets of the information of an optimal estimate carried on (6), by the differential equations that it follows."""
    order = target.order
    elapsed = np.maximum(now - prediction.made, 0)  # a clock that is set right goes back
    first, spread = carried(target, prediction, elapsed * dt)
    shift, driven = np.eye(order, k=1), np.zeros((order, order))
    driven[-1, -1] = target.intensity
    mean, covariance = [first], [spread]
    for derivative in range(order):
        mean.append(product(shift, mean[-1]))
        moved = product(shift, covariance[-1])
        covariance.append(moved + np.swapaxes(moved, -1, -2) + (driven if derivative == 0 else 0.0))
    Q = jets.inverse(np.stack(covariance))
    return Q, jets.times(Q, np.stack(mean))
