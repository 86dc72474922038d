"""What the geometry of an affine formation tells about its edges (paper 000, sections IV and V)."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from agents.algebra.small import determinant, inverse
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import whole_power

# Relative to the mean eigenvalue: neighbours closer to a line (plane) than this do not determine an affine map.
SINGULAR = 1e-9


class Fit(NamedTuple):
    """A local map.

    Parameters
    ----------
    theta
        Shape (..., D, D); 0 where not feasible.
    feasible
        Where enough neighbours are seen to determine it, shape (...).
    gram
        H H^T of the neighbours behind it, shape (..., D, D), in square metres.
    """

    theta: Array
    feasible: Mask
    gram: Array


def gram(relative: Array, seen: Mask) -> Array:
    """H H^T over the edges seen, shape (..., D, D), in square metres.

    Parameters
    ----------
    relative
        Nominal relative positions p_ij, shape (..., n, D).
    seen
        Shape (..., n).
    """
    H = np.where(seen[..., None], relative, 0.0)
    return product(np.swapaxes(H, -1, -2), H)


def regular(gram: Array) -> Mask:
    """Whether rank H = D (Remark 1), shape (...): the test is on the nominal H, never on Y."""
    dimension = gram.shape[-1]
    scale = np.einsum("...ii", gram) / dimension
    spans: Mask = determinant(gram) > SINGULAR * whole_power(scale, dimension)
    return spans


def inverse_gram(gram: Array, feasible: Mask) -> Array:
    """(H H^T)^-1, shape (..., D, D); the identity where not feasible."""
    return inverse(np.where(feasible[..., None, None], gram, identity(gram.shape[-1])))


def apply(theta: Array, relative: Array) -> Array:
    """Relative positions Theta p_ij under a map (..., D, D), shape (..., n, D) (eq. 11)."""
    return product(relative, np.swapaxes(theta, -1, -2))


def indicator(own: Fit, theirs: Array, counts: Mask) -> Array:
    """Local convergence indicator psi_i, shape (...) (eq. 16).

    Only neighbours heard, and feasible, count; NaN where there is none, or the agent itself is not feasible.

    Parameters
    ----------
    own
        The agent's map.
    theirs
        Its neighbours' maps, shape (..., n, D, D).
    counts
        Which of them count, shape (..., n).
    """
    difference = theirs - own.theta[..., None, :, :]
    number = counts.sum(axis=-1)
    mean = sum_over(total(counts, difference * difference), (-2, -1)) / np.maximum(number, 1)
    return np.where(own.feasible & (number > 0), mean, np.nan)


def total(counts: Mask, maps: Array) -> Array:
    """Sum of the maps (..., n, D, D) that count, shape (..., D, D)."""
    flat = maps.reshape(*maps.shape[:-2], -1)
    summed = product(counts[..., None, :].astype(np.float64), flat)
    return summed.reshape(*maps.shape[:-3], *maps.shape[-2:])


@cache
def identity(dimension: int) -> Array:
    """The identity matrix."""
    return np.eye(dimension)
