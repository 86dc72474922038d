"""What the geometry of an affine formation tells about its edges (paper 000, sections IV and V)."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Part, Plain, kernel, scratch
from analysis.models.arrays import Array, Mask
from analysis.models.small import inverse, invert

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
    return cross(relative, relative, seen)


def cross(relative: Array, measured: Array, seen: Mask) -> Array:
    """Y H^T over the edges seen, shape (..., D, D), in square metres; both (..., n, D), and seen (..., n)."""
    crossed: Array = _crossed(relative, measured, seen)
    return crossed


@kernel("(n,D),(n,D),(n)->(D,D)", "dd?->d")
def _crossed(D: int) -> Plain:
    def plain(relative: Array, measured: Array, seen: Mask, crossed: Array) -> None:
        for i in range(D):
            for j in range(D):
                summed = 0.0
                for edge in range(len(seen)):
                    if seen[edge]:
                        summed += measured[edge, i] * relative[edge, j]
                crossed[i, j] = summed

    return plain


def regular(gram: Array) -> Mask:
    """Whether rank H = D (Remark 1), shape (...): the test is on the nominal H, never on Y."""
    spans: Mask = _regular(gram)
    return spans


@Part
def spans(gram: Array, inverse: Array) -> bool:
    """Whether a gram (D, D) is regular; its inverse, or the identity where it is not, is filled in."""
    D = len(gram)
    trace = 0.0
    for i in range(D):
        trace += gram[i, i]
    bound = SINGULAR
    for _ in range(D):
        bound *= trace / D
    if invert(gram, inverse) > bound:
        return True
    for i in range(D):
        for j in range(D):
            inverse[i, j] = 1.0 if i == j else 0.0
    return False


def inverse_gram(gram: Array, feasible: Mask) -> Array:
    """(H H^T)^-1, shape (..., D, D); the identity where not feasible."""
    return inverse(np.where(feasible[..., None, None], gram, identity(gram.shape[-1])))


@kernel("(D,D)->()", "d->?")
def _regular(D: int) -> Plain:
    def plain(gram: Array, found: Mask) -> None:
        found[0] = spans(gram, scratch(D, D))

    return plain


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
    found: Array = _indicated(own.theta, own.feasible, theirs, counts)
    return found


@Part
def disagreement(own: Array, theirs: Array, counts: Mask) -> float:
    """Mean |Theta_i - Theta_j|_F^2 over the maps (n, D, D) that count, NaN where none does."""
    number, summed = 0, 0.0
    for edge in range(len(counts)):
        if counts[edge]:
            number += 1
            for i in range(len(own)):
                for j in range(len(own)):
                    difference = theirs[edge, i, j] - own[i, j]
                    summed += difference * difference
    return summed / number if number else np.nan


@kernel("(D,D),(),(n,D,D),(n)->()", "d?d?->d")
def _indicated(_: int) -> Plain:
    def plain(own: Array, feasible: bool, theirs: Array, counts: Mask, found: Array) -> None:
        found[0] = disagreement(own, theirs, counts) if feasible else np.nan

    return plain


@cache
def identity(dimension: int) -> Array:
    """The identity matrix."""
    return np.eye(dimension)
