"""What the geometry of an affine formation tells about its edges (paper 000, sections IV and V)."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from agents.brief import Array, Mask
from agents.estimators.small import determinant, inverse

# Relative to the mean eigenvalue: neighbours closer to a line (plane) than this do not determine an affine map.
_SINGULAR = 1e-9


class Fit(NamedTuple):
    """A local affine map.

    Parameters
    ----------
    theta
        Shape (..., D, D); 0 where not feasible.
    feasible
        Where enough neighbours are seen to determine it, shape (...).
    inverse_gram
        (H H^T)^-1 of the neighbours behind it, shape (..., D, D); the identity where not feasible.
    """

    theta: Array
    feasible: Mask
    inverse_gram: Array


def gram(relative: Array, seen: Mask) -> tuple[Array, Mask]:
    """The inverse of H H^T over the edges seen, and where it exists: the rank test is on the nominal H, never on Y.

    Parameters
    ----------
    relative
        Nominal relative positions p_ij, shape (..., n, D).
    seen
        Shape (..., n).

    Returns
    -------
    inverse : Array
        Shape (..., D, D); the identity where not feasible.
    feasible : Mask
        Whether rank H = D (Remark 1), shape (...).
    """
    dimension = relative.shape[-1]
    H = np.where(seen[..., None], relative, 0.0)
    HHt = np.swapaxes(H, -1, -2) @ H
    scale = np.einsum("...ii", HHt) / dimension
    feasible = determinant(HHt) > _SINGULAR * scale**dimension
    return inverse(np.where(feasible[..., None, None], HHt, identity(dimension))), feasible


def fit(relative: Array, measured: Array, seen: Mask) -> Fit:
    """Least-squares affine map from the edges seen (eq. 10).

    Parameters
    ----------
    relative, measured
        p_ij and y_ij, shape (..., n, D); the latter 0 where not seen.
    seen
        Shape (..., n).
    """
    inverse_gram, feasible = gram(relative, seen)
    theta = np.swapaxes(measured, -1, -2) @ relative @ inverse_gram
    return Fit(np.where(feasible[..., None, None], theta, 0.0), feasible, inverse_gram)


def covariance(relative: Array, inverse_gram: Array, R: Array) -> Array:
    """Covariance of the geometric estimate Theta p_ij, shape (..., n, D, D) (eq. 12).

    With one R for all edges, and an identity of size N_i,k as it must be, (12) is (p_ij^T (H H^T)^-1 p_ij) R.
    """
    leverage = (relative @ inverse_gram * relative).sum(axis=-1)
    return leverage[..., None, None] * R


def apply(theta: Array, relative: Array) -> Array:
    """Relative positions Theta p_ij under a map (..., D, D), shape (..., n, D) (eq. 11)."""
    return relative @ np.swapaxes(theta, -1, -2)


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
    mean = total(counts, difference * difference).sum(axis=(-2, -1)) / np.maximum(number, 1)
    return np.where(own.feasible & (number > 0), mean, np.nan)


def total(counts: Mask, maps: Array) -> Array:
    """Sum of the maps (..., n, D, D) that count, shape (..., D, D)."""
    flat = maps.reshape(*maps.shape[:-2], -1)
    summed = counts[..., None, :].astype(np.float64) @ flat
    return summed.reshape(*maps.shape[:-3], *maps.shape[-2:])


@cache
def identity(dimension: int) -> Array:
    """The identity matrix."""
    return np.eye(dimension)
