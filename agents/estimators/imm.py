"""Interacting multiple models (named in paper 000, section VI-A): three ways to move, weighed by how well they predict.

The estimator is the one of Blom and Bar-Shalom (1988). All models share a state of position, velocity and acceleration
(`kalman.embedded`), so that mixing compares like with like. Each filter starts at zero with a wide prior, so the first
measurement sets it; before that, its edge is not known.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from agents.algebra import kalman, missed_ticks
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import exp, log
from analysis.models.reports import NIS
from analysis.models.small import determinant, inverse


class Modes(NamedTuple):
    """The filters of every edge, one a model.

    Their means (..., n, 3, S) and covariances (..., n, 3, S, S), how probable each model is (..., n, 3), `nis` (..., n), and
    which edges were ever corrected (..., n). S = 3 D.
    """

    mean: Array
    covariance: Array
    probability: Array
    nis: Array
    known: Mask


@dataclass(frozen=True)
class InteractingMultipleModel(Estimator[Modes]):
    """IMM over constant acceleration, constant velocity and a random walk, in this order.

    Parameters
    ----------
    stay
        Probability that an edge moves by the same model in the next tick, in (0, 1); the other two share the rest.
    sigma_constant_acceleration, sigma_constant_velocity
        Standard deviations of the acceleration that drives these models, in metres per second squared.
    sigma_random_walk
        Standard deviation of the velocity that drives this one, in metres per second.
    prior_position
        Standard deviation of a relative position before the first measurement, in metres.
    prior_velocity
        Of a relative velocity, in metres per second.
    prior_acceleration
        Of a relative acceleration, in metres per second squared.
    """

    stay: float = 0.98
    sigma_constant_acceleration: float = 0.5
    sigma_constant_velocity: float = 0.5
    sigma_random_walk: float = 1.0
    prior_position: float = 10.0
    prior_velocity: float = 2.0
    prior_acceleration: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.stay < 1.0:
            raise ValueError(f"stay is a probability strictly between 0 and 1, not {self.stay}")
        refuse_negative(**{name: value for name, value in vars(self).items() if name != "stay"})

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing: a neighbour's measurements of others say nothing of this edge."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Modes:
        """All edges unknown, all models as probable."""
        shape = (*batch, brief.relative.shape[-2])
        deviations = (self.prior_position, self.prior_velocity, self.prior_acceleration)
        filters = kalman.unknown((*shape, 3), brief.dimension, deviations)
        alike = np.full((*shape, 3), 1.0 / 3.0)
        return Modes(*filters, alike, np.full(shape, np.nan), np.zeros(shape, dtype=bool))

    def missed(self, brief: Brief, state: Modes, gap: Gap) -> Modes:
        """Mix and predict, tick after tick."""
        nothing, no = np.zeros((*state.known.shape, brief.dimension)), np.zeros_like(state.known)
        return missed_ticks.lived(
            state,
            gap.ticks,
            live=lambda modes, _: self.sense(brief, modes, nothing, no)[0],
            fresh=lambda: self.init(brief, gap.ticks.shape),
        )

    def sense(self, brief: Brief, state: Modes, measured: Array, seen: Mask) -> tuple[Modes, Mapping[str, Fields]]:
        """Mix, predict every edge by every model, correct those measured, and weigh the models that predicted them."""
        F, Q, chain = self._models(brief.dt)
        expected = product(state.probability[..., None, :], chain)[..., 0, :]
        weights = chain * state.probability[..., :, None] / expected[..., None, :]
        mean, covariance = _mix(state.mean, state.covariance, weights)
        mean, covariance = kalman.predict(mean, covariance, F, Q)
        place, doubt = self._predicted(mean, covariance, expected, brief.dimension)
        R = brief.sensor.weight(measured, place, doubt)
        nis = kalman.normalised(measured - place, inverse(doubt + R), seen)
        observed, R, usable = measured[..., None, :], R[..., None, :, :], seen[..., None]
        surprise = _surprise(mean, covariance, observed, R)
        mean, covariance, _ = kalman.correct(mean, covariance, observed, R, usable)
        probability = np.where(usable, _weighed(expected, surprise), expected)
        return Modes(mean, covariance, probability, nis, state.known | seen), {}

    def fuse(
        self,
        brief: Brief,
        state: Modes,
        heard: Mapping[str, Heard],  # noqa: ARG002
        own: Own,  # noqa: ARG002
    ) -> tuple[Modes, Estimate]:
        """The mean over the models, and the covariance about it."""
        mixed = _mix(state.mean, state.covariance, state.probability[..., :, None])
        mean, covariance = mixed[0][..., 0, :], mixed[1][..., 0, :, :]
        dimension = brief.dimension
        return state, Estimate(
            relative=mean[..., :dimension],
            known=state.known,
            covariance=covariance[..., :dimension, :dimension],
            psi=no_indicator(state.known),
            relative_velocity=mean[..., dimension : 2 * dimension],
            reports={NIS: state.nis},
        )

    def _predicted(self, mean: Array, covariance: Array, probability: Array, dimension: int) -> tuple[Array, Array]:
        """The position that all models together predict, and its covariance."""
        place, doubt = mean[..., :dimension], covariance[..., :dimension, :dimension]
        mixed = _mix(place, doubt, probability[..., :, None])
        return mixed[0][..., 0, :], mixed[1][..., 0, :, :]

    def _models(self, dt: float) -> tuple[Array, Array, Array]:
        sigmas = (self.sigma_constant_acceleration, self.sigma_constant_velocity, self.sigma_random_walk)
        return _stacked(dt, sigmas, self.stay)


@cache
def _stacked(dt: float, sigmas: tuple[float, float, float], stay: float) -> tuple[Array, Array, Array]:
    """F and Q of all models, (3, O, O) each, and the Markov chain (3, 3) between them, from the row to the column."""
    names: tuple[kalman.Model, ...] = ("constant-acceleration", "constant-velocity", "random-walk")
    pairs = [kalman.embedded(name, dt, sigma) for name, sigma in zip(names, sigmas, strict=True)]
    chain = np.full((3, 3), (1.0 - stay) / 2) + (stay - (1.0 - stay) / 2) * np.eye(3)
    return np.stack([F for F, _ in pairs]), np.stack([Q for _, Q in pairs]), chain


def _mix(mean: Array, covariance: Array, weights: Array) -> tuple[Array, Array]:
    """Means (..., m, S) and covariances (..., m, S, S) of m mixtures of the filters.

    Parameters
    ----------
    mean, covariance
        Of the filters, shapes (..., 3, S) and (..., 3, S, S).
    weights
        Shape (..., 3, m).
    """
    size = mean.shape[-1]
    columns = np.swapaxes(weights, -1, -2)
    centre = product(columns, mean)
    within = product(columns, covariance.reshape(*covariance.shape[:-2], size * size)).reshape(*centre.shape, size)
    apart = mean[..., None, :, :] - centre[..., :, None, :]
    between = product(np.swapaxes(apart, -1, -2), columns[..., None] * apart)
    return centre, within + between


def _surprise(mean: Array, covariance: Array, observed: Array, R: Array) -> Array:
    """Twice the negative log-likelihood of a position under each filter, shape (..., 3), up to a constant."""
    dimension = observed.shape[-1]
    S = covariance[..., :dimension, :dimension] + R
    innovation = observed - mean[..., :dimension]
    squared = (innovation * product(inverse(S), innovation[..., None])[..., 0]).sum(axis=-1)
    surprise: Array = squared + log(determinant(S))
    return surprise


def _weighed(expected: Array, surprise: Array) -> Array:
    # Against the least surprised, so that a measurement far from all of them does not underflow to 0 / 0.
    likelihood = exp(-0.5 * (surprise - surprise.min(axis=-1, keepdims=True)))
    weighed = expected * likelihood
    probability: Array = weighed / weighed.sum(axis=-1, keepdims=True)
    return probability
