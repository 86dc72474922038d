"""The stress that agents fly by where edges are missing and their own fits put them in place (paper 000, (10) and (11))."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agents.algebra import geometry
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask


class Completed(NamedTuple):
    """What RAL makes of the stress in one graph.

    Parameters
    ----------
    weights
        Of the edges that are measured, shape (..., n); 0 on the others.
    fits
        Who measures enough edges for a fit of its own, shape (...); the others drop what they miss.
    """

    weights: Array
    fits: Mask


def completed(weights: Array, relative: Array, seen: Mask) -> Completed:
    """Each edge that is missing, spread over those that are measured, as its place Theta_i p_ij depends on them.

    Parameters
    ----------
    weights
        Stress l_ij of all edges, shape (..., n); 0 in padding.
    relative
        Nominal relative positions p_ij, shape (..., n, D), in metres.
    seen
        Which edges are measured, shape (..., n).
    """
    H = geometry.gram(relative, seen)
    fits = geometry.regular(H)
    missing = np.where(seen, 0.0, weights)
    pull = product(missing[..., None, :], relative)  # sum_k l_ik p_ik^T over the missing
    share = product(relative, product(pull, geometry.inverse_gram(H, fits)).swapaxes(-1, -2))[..., 0]
    return Completed(np.where(seen, weights + np.where(fits[..., None], share, 0.0), 0.0), fits)
