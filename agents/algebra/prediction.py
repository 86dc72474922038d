"""What was last known of a target, carried on to now with its derivatives: the optimal estimate of paper 002, (5) and (6)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models import jets
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Integers
from analysis.models.pursuit import Sighting, Target, diffusion, transition


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
    elapsed = np.maximum(now - prediction.made, 0)  # a clock that is set right goes back
    first, spread = carried(target, prediction, elapsed * dt)
    mean, covariance = _derived(first, spread, target.intensity, np.empty(target.order + 1))
    Q = jets.inverse(np.moveaxis(covariance, -3, 0))
    return Q, jets.times(Q, np.moveaxis(mean, -3, 0))


@kernel("(m,d),(m,m),(),(j)->(j,m,d),(j,m,m)", "dddd->dd")
def _derived() -> Plain:
    """Jets of mean and covariance, which follow dx = S x dt + dw, with S the shift of derivatives."""

    def plain(first: Array, spread: Array, intensity: float, orders: Array, mean: Array, covariance: Array) -> None:
        size = len(first)
        for order in range(len(orders)):
            for row in range(size):
                for axis in range(first.shape[1]):
                    mean[order, row, axis] = first[row + order, axis] if row + order < size else 0.0
                for column in range(size):
                    if order == 0:
                        covariance[order, row, column] = spread[row, column]
                    else:
                        below = covariance[order - 1, row + 1, column] if row + 1 < size else 0.0
                        beside = covariance[order - 1, column + 1, row] if column + 1 < size else 0.0
                        covariance[order, row, column] = below + beside
            if order == 1:
                covariance[1, size - 1, size - 1] += intensity

    return plain


def detected(target: Target, last: Prediction, now: Integers, sighting: Sighting, gate: float, dt: float) -> Prediction:
    """The optimal estimate of the tick in which a detection was done (5).

    Parameters
    ----------
    target, last
        What is pursued, and the estimate before.
    now
        The tick, shape (...).
    sighting
        The detection. One of nothing, NaN, leaves the prediction, and so does one that is too far off.
    gate
        How far off it may be, in standard deviations of what is expected; 0 for any distance.
    dt
        Tick, in seconds.
    """
    latency, R = target.latencies[sighting.by], target.variances[sighting.by]
    seconds = np.asarray(latency * dt, dtype=np.float64)
    # As a rule the last estimate is of the tick in which this detection began; after a pause it is older.
    lag = np.maximum(now - last.made - latency, 0)
    mean, P = carried(target, last, lag * dt)
    A, W = transition(target.order, seconds), diffusion(target.order, seconds, target.intensity)
    innovation, doubt = sighting.position - mean[..., 0, :], P[..., 0, 0] + R
    counts = np.asarray(~np.isnan(innovation).any(axis=-1))
    innovation = np.where(counts[..., None], innovation, 0.0)
    if gate > 0.0:
        counts = counts & (sum_over(innovation * innovation, -1) <= gate * gate * doubt)
    L = np.where(counts[..., None, None], product(A, P[..., :, :1]) / doubt[..., None, None], 0.0)
    corrected = product(A, mean) + product(L, innovation[..., None, :])
    closed = A - product(L, np.eye(1, target.order))
    covariance = (
        product(closed, P, np.swapaxes(closed, -1, -2)) + R[..., None, None] * product(L, np.swapaxes(L, -1, -2)) + W
    )
    return Prediction(corrected, covariance, now)
