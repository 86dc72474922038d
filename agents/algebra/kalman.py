"""The Kalman core: predict and correct, over stacks of independent filters.

The state of one relative edge stacks position, velocity and acceleration, D numbers each, as far as the model of motion has
them, so that the observed position is its first D entries.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Literal, NamedTuple

import numpy as np

from analysis.kernels.kernel import Part, Plain, kernel, scratch
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Integers, Mask, chosen
from analysis.models.small import invert

Model = Literal["constant-acceleration", "constant-velocity", "random-walk"]

# How many of position, velocity and acceleration are in the state.
ORDER: Mapping[Model, int] = {"random-walk": 1, "constant-velocity": 2, "constant-acceleration": 3}


@cache
def motion(model: Model, dt: float, sigma_w: float) -> tuple[Array, Array]:
    """Transition F and process covariance Q of a model of motion.

    The model of paper 000, (20)-(21), is "constant-acceleration". The others end the Taylor series earlier: what drives them is
    a white acceleration or a white velocity, held for a tick.

    Parameters
    ----------
    model
        Which.
    dt
        Tick, in seconds.
    sigma_w
        Standard deviation of what drives it: of the acceleration, in metres per second squared, with constant acceleration
        (its step from tick to tick) and with constant velocity; of the velocity, in metres per second, with a random walk.

    Returns
    -------
    tuple of Array
        Both (O, O), of the O derivatives of one axis: all axes are alike, and independent.
    """
    F, Q = embedded(model, dt, sigma_w)
    order = ORDER[model]
    return F[:order, :order], Q[:order, :order]


@cache
def embedded(model: Model, dt: float, sigma_w: float) -> tuple[Array, Array]:
    """A model of motion in a state of three derivatives, whichever it has itself: F and Q, both (3, 3), of one axis.

    The first derivative that the model leaves out is the noise that drives it, a fresh one in every tick; those beyond are 0.
    The rest moves exactly as in `motion`.

    Parameters
    ----------
    model
        Of motion.
    dt
        Tick, in seconds.
    sigma_w
        Deviation of the noise that drives it.
    """
    order = ORDER[model]
    taylor = np.array([[1.0, dt, dt * dt / 2], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    deflection = np.array([dt, 1.0, 0.0]) if model == "random-walk" else np.array([dt * dt / 2, dt, 1.0])
    return np.where(np.arange(3) < order, taylor, 0.0), sigma_w * sigma_w * np.outer(deflection, deflection)


def unknown(shape: tuple[int, ...], dimension: int, deviations: Sequence[float]) -> tuple[Array, Array]:
    """Means and covariances of filters before the first measurement: zero, and as wide as the standard deviations say.

    Parameters
    ----------
    shape
        Of the stack of filters.
    dimension
        D.
    deviations
        Of position, and of its derivatives as far as the state has them, in SI units.
    """
    prior = np.repeat(deviations, dimension)
    covariance = np.broadcast_to(np.diag(prior * prior), (*shape, len(prior), len(prior))).copy()
    return np.zeros((*shape, len(prior))), covariance


def predict(mean: Array, covariance: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """One step ahead (Algorithm 1, lines 4-5): mean (..., S), covariance (..., S, S).

    Parameters
    ----------
    mean, covariance
        Of filters, shapes (..., S) and (..., S, S).
    F, Q
        Of a model of motion, by derivatives, shape (..., O, O); the former upper triangular.
    """
    ahead: tuple[Array, Array] = _ahead(mean, covariance, F, Q)
    return ahead


@Part
def move(mean: Array, P: Array, F: Array, Q: Array, ahead: Array, spread: Array, FP: Array) -> None:
    """One filter a step ahead: F x and F P F^T + Q, by derivatives, into `ahead` and `spread`; FP is room, (O, O)."""
    O = len(F)  # noqa: E741
    D = len(mean) // O
    for one in range(D):
        for order in range(O):
            moved = 0.0
            for higher in range(order, O):
                moved += F[order, higher] * mean[higher * D + one]
            ahead[order * D + one] = moved
        for other in range(D):
            for order in range(O):
                for column in range(O):
                    moved = 0.0
                    for higher in range(order, O):
                        moved += F[order, higher] * P[higher * D + one, column * D + other]
                    FP[order, column] = moved
            for order in range(O):
                for column in range(O):
                    moved = Q[order, column] if one == other else 0.0
                    for higher in range(column, O):
                        moved += FP[order, higher] * F[column, higher]
                    spread[order * D + one, column * D + other] = moved


@kernel("(S),(S,S),(O,O),(O,O)->(S),(S,S)", "dddd->dd")
def _ahead(_: int, O: int) -> Plain:  # noqa: E741
    def plain(mean: Array, P: Array, F: Array, Q: Array, ahead: Array, spread: Array) -> None:
        move(mean, P, F, Q, ahead, spread, scratch(O, O))

    return plain


def coasted(mean: Array, covariance: Array, F: Array, Q: Array, ticks: Integers) -> tuple[Array, Array]:
    """So many steps ahead, shape (...), at once: 0 leave a filter as it is."""
    for many in np.unique(ticks[ticks > 0]).tolist():
        those, far = ticks == many, predict(mean, covariance, *_repeated(F, Q, many))
        mean, covariance = chosen(those, far[0], mean), chosen(those, far[1], covariance)
    return mean, covariance


def _repeated(F: Array, Q: Array, ticks: int) -> tuple[Array, Array]:
    """F and Q of so many ticks together, from those of a half of them, a quarter, and so on."""
    if ticks == 1:
        return F, Q
    half, driven = _repeated(F, Q, ticks // 2)
    whole, twice = product(half, half), product(half, driven, half.T) + driven
    return (product(F, whole), product(F, twice, F.T) + Q) if ticks % 2 else (whole, twice)


class Corrected(NamedTuple):
    """Mean (..., S) and covariance (..., S, S) of filters, and how far off their predictions were: `nis`, shape (...).

    The innovation squared, normalised by its covariance; NaN where there was no observation.
    """

    mean: Array
    covariance: Array
    nis: Array


def correct(mean: Array, covariance: Array, observed: Array, R: Array, usable: Mask) -> Corrected:
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
    return Corrected(*_corrected(mean, covariance, observed, R, usable))


def tracked(mean: Array, covariance: Array, F: Array, Q: Array, observed: Array, R: Array, usable: Mask) -> Corrected:
    """The filters a tick later: `predict`, and `correct` where there is an observation (Algorithm 1), in one go.

    Parameters
    ----------
    mean, covariance
        Of filters, shapes (..., S) and (..., S, S).
    F, Q
        Of a model of motion, by derivatives, shape (..., O, O).
    observed, R, usable
        As in `correct`.
    """
    return Corrected(*_tracked(mean, covariance, F, Q, observed, R, usable))


@Part
def observe(mean: Array, P: Array, observed: Array, R: Array, corrected: Array, left: Array, room: Array) -> float:
    """One filter observed, into `corrected` and `left`; its innovation squared and normalised. `room` is (4 D, D)."""
    S, D = len(mean), len(observed)
    doubt, precision, pull, gain = room[:D], room[D : 2 * D], room[2 * D : 3 * D], room[3 * D :]
    for i in range(D):
        for j in range(D):
            doubt[i, j] = P[i, j] + R[i, j]
    invert(doubt, precision)
    surprise = 0.0
    for i in range(D):
        pull[i, 0] = 0.0
        for j in range(D):
            pull[i, 0] += precision[i, j] * (observed[j] - mean[j])
        surprise += (observed[i] - mean[i]) * pull[i, 0]
    for row in range(S):
        moved = mean[row]
        for i in range(D):
            moved += P[row, i] * pull[i, 0]
            gain[i, 0] = 0.0
            for j in range(D):
                gain[i, 0] += P[row, j] * precision[j, i]
        corrected[row] = moved
        for column in range(S):
            known = P[row, column]
            for i in range(D):
                known -= gain[i, 0] * P[i, column]
            left[row, column] = known
    return surprise


@kernel("(S),(S,S),(D),(D,D),()->(S),(S,S),()", "dddd?->ddd")
def _corrected(S: int, D: int) -> Plain:
    rows = 4 * D

    def plain(
        mean: Array, P: Array, observed: Array, R: Array, usable: bool, corrected: Array, left: Array, nis: Array
    ) -> None:
        if usable:
            nis[0] = observe(mean, P, observed, R, corrected, left, scratch(rows, D))
            return
        nis[0] = np.nan
        for row in range(S):
            corrected[row] = mean[row]
            for column in range(S):
                left[row, column] = P[row, column]

    return plain


@kernel("(S),(S,S),(O,O),(O,O),(D),(D,D),()->(S),(S,S),()", "dddddd?->ddd")
def _tracked(S: int, O: int, D: int) -> Plain:  # noqa: E741
    rows = 4 * D

    def plain(
        mean: Array,
        P: Array,
        F: Array,
        Q: Array,
        observed: Array,
        R: Array,
        usable: bool,
        corrected: Array,
        left: Array,
        nis: Array,
    ) -> None:
        nis[0] = np.nan
        if usable:
            ahead, spread = scratch(1, S)[0], scratch(S, S)
            move(mean, P, F, Q, ahead, spread, scratch(O, O))
            nis[0] = observe(ahead, spread, observed, R, corrected, left, scratch(rows, D))
        else:
            move(mean, P, F, Q, corrected, left, scratch(O, O))

    return plain


def normalised(innovation: Array, precision: Array, made: Mask) -> Array:
    """Innovations (..., D) squared, by the inverses (..., D, D) of their covariances, shape (...); NaN where none was made."""
    return np.where(made, sum_over(innovation * product(precision, innovation[..., None])[..., 0], -1), np.nan)
