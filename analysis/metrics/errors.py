"""How well a swarm does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log, whole_power


def tracking_error(position: Array, target: Array, present: Mask) -> Array:
    """Mean squared distance to the target over the agents present, in square metres (paper 000, eq. 15).

    Parameters
    ----------
    position, target
        Shape (..., N, D), in metres.
    present
        Agents that take part, shape (..., N); departed and dead agents leave the mean.

    Returns
    -------
    Array
        Shape (...); NaN where nobody is present.
    """
    error: Array = _mean_squares(position, target, present)
    return error


@kernel("(n,D),(n,D),(n)->()", "dd?->d")
def _mean_squares(D: int) -> Plain:
    def plain(position: Array, target: Array, present: Mask, error: Array) -> None:
        number, total = 0, 0.0
        for agent in range(len(present)):
            if present[agent]:
                number += 1
                for axis in range(D):
                    astray = position[agent, axis] - target[agent, axis]
                    total += astray * astray
        error[0] = total / number if number else np.nan

    return plain


def root_mean_square(vectors: Array, present: Mask) -> Array:
    """Of vectors (..., N, D) over the agents present (..., N), shape (...), in their unit; NaN where nobody is present."""
    return np.sqrt(tracking_error(vectors, np.zeros(vectors.shape[-2:]), present))


def procrustes_error(position: Array, nominal: Array, present: Mask) -> Array:
    """How far a swarm is from its nominal shape, turned, mirrored and moved at will (paper 004, definition 2.9).

    Parameters
    ----------
    position
        Shape (..., N, D), in metres.
    nominal
        Shape (N, D), in metres.
    present
        Agents that take part, shape (..., N).

    Returns
    -------
    Array
        min |Z Omega + 1 t^T - P|_F / N over those present, shape (...), in metres; NaN where a position is no number.
    """
    number = np.maximum(present.sum(axis=-1), 1)
    Z, P = _centred(position, present), _centred(np.broadcast_to(nominal, position.shape), present)
    finite: Mask = np.asarray(np.isfinite(Z).all(axis=(-2, -1)))
    spread: Array = product(np.swapaxes(np.where(finite[..., None, None], Z, 0.0), -1, -2), P)
    U, _, Vt = np.linalg.svd(spread)
    squared = sum_over(whole_power(product(Z, product(U, Vt)) - P, 2), (-2, -1))
    return np.where(finite, np.sqrt(squared) / number, np.nan)


class TickFlown(NamedTuple):
    """What is followed of a swarm tick by tick, shape (...) each.

    Parameters
    ----------
    error
        Tracking error (15), in square metres; infinite where somebody present has left the numbers, NaN where nobody is.
    change
        Mean square over those present of how much their last step differs from the one before, in square metres: it is what
        makes a path rough, and goes with the fourth power of the tick along a smooth one.
    longest
        The longest input of any agent, NaN where one is no number.
    """

    error: Array
    change: Array
    longest: Array


def tick_flown(path: Sequence[Array], target: Array, steered: Array, present: Mask) -> TickFlown:
    """How swarms have flown a tick.

    Parameters
    ----------
    path
        Where the agents were two ticks ago, in the tick before, and are now, shape (..., N, D) each, in metres.
    target
        Where they should be, shape (..., N, D), in metres.
    steered
        Their inputs, shape (..., N, D).
    present
        Agents that take part, shape (..., N).
    """
    return TickFlown(*_tick_flown(*path, target, steered, present))


@kernel("(n,D),(n,D),(n,D),(n,D),(n,D),(n)->(),(),()", "ddddd?->ddd")
def _tick_flown(D: int) -> Plain:
    def plain(
        earlier: Array,
        before: Array,
        position: Array,
        target: Array,
        steered: Array,
        present: Mask,
        error: Array,
        change: Array,
        longest: Array,
    ) -> None:
        number, lost, total, changed, most = 0, False, 0.0, 0.0, 0.0
        for agent in range(len(present)):
            squared = 0.0
            for axis in range(D):
                squared += steered[agent, axis] * steered[agent, axis]
            if not squared <= most and most == most:  # what is no number stays
                most = squared
            if present[agent]:
                number += 1
                for axis in range(D):
                    here = position[agent, axis]
                    astray = here - target[agent, axis]
                    total += astray * astray
                    turned = (here - before[agent, axis]) - (before[agent, axis] - earlier[agent, axis])
                    changed += turned * turned
                    if here - here != 0.0:
                        lost = True
        root = np.sqrt(changed / number) if number else np.nan
        error[0] = np.inf if lost else (total / number if number else np.nan)
        change[0] = root * root
        longest[0] = np.sqrt(most)

    return plain


def rate_of_fall(seconds: Array, error: Array) -> Array:
    """By which rate errors (..., T) have fallen since the moment before, shape (..., T), per second: 1/s is to 1/e in a second.

    Its mean over a span is that of the whole fall. NaN in the first moment, and where an error is 0 or no number.
    """
    finite = np.isfinite(error) & (error > 0.0)
    fallen = -np.diff(log(np.where(finite, error, 1.0)), axis=-1) / np.diff(seconds)
    both = finite[..., 1:] & finite[..., :-1]
    first = np.full((*error.shape[:-1], 1), np.nan)
    rates: Array = np.concatenate([first, np.where(both, fallen, np.nan)], axis=-1)[..., : error.shape[-1]]
    return rates


def estimation_error(estimate: Array, true: Array, known: Mask) -> Array:
    """The length of all errors of the relative positions together (paper 004, eq. 4.34), shape (...), in metres.

    Parameters
    ----------
    estimate, true
        Shape (..., N, n, D), in metres.
    known
        Which edges have an estimate, shape (..., N, n).
    """
    squared = sum_over(whole_power(estimate - true, 2), -1)
    return np.sqrt(sum_over(np.where(known, squared, 0.0), (-2, -1)))


def covariance_trace(triangles: Array, dimension: int) -> Array:
    """The trace of the covariances of all edges, from their upper triangles (..., N, n, D (D + 1) / 2), shape (...), in m2."""
    diagonal = np.cumsum([0, *range(dimension, 1, -1)])
    return sum_over(triangles[..., diagonal], (-3, -2, -1))


def _centred(points: Array, present: Mask) -> Array:
    taking_part = present[..., None]
    centre = sum_over(np.where(taking_part, points, 0.0), -2)[..., None, :]
    centre = centre / np.maximum(present.sum(axis=-1), 1)[..., None, None]
    return np.where(taking_part, points - centre, 0.0)
