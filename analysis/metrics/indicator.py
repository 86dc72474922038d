"""What the convergence indicator can tell of the tracking error (paper 000, Theorem 1 and Corollary 1).

In expectation psi_i <= c_i delta + b_i. Both are of the affine local fits (10); the constraints of Table III fit otherwise.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array, Mask
from analysis.models.graph import grams, regular

_ROUNDING = 1e-12


class Bounds(NamedTuple):
    """Slope c_i (17), per square metre, and offset b_i (18b), shape (..., N) each; NaN where psi is undefined."""

    slope: Array
    offset: Array


def bounds(
    nominal: Array, heard: Mask, covariance: Array, seen: Mask | None = None, present: Mask | None = None
) -> Bounds:
    """The bounds of every agent's indicator over a functional graph.

    Only neighbours heard count, and feasible ones (errata to (16)); an agent that is not feasible, or hears no such neighbour,
    has no indicator.

    Parameters
    ----------
    nominal
        Nominal positions, shape (..., N, D), in metres.
    heard
        Who heard whom, shape (..., N, N): [i - 1, j - 1] where i heard j, as from `analysis.models.graph.adjacency`.
    covariance
        Of one relative measurement, shape (D, D), in square metres.
    seen
        Who measured whom, shape (..., N, N); those heard by default (Assumption 1).
    present
        Agents over which the tracking error (15) is averaged, shape (..., N); all by default. The others neither see nor are
        seen.
    """
    agents, dimension = nominal.shape[-2:]
    here = np.ones(agents, dtype=np.bool_) if present is None else present
    both = here[..., :, None] & here[..., None, :] & ~np.eye(agents, dtype=np.bool_)
    sees = both & (heard if seen is None else seen)
    relative = nominal[..., :, None, :] - nominal[..., None, :, :]

    HHt = grams(sees, nominal)
    feasible = regular(HHt)
    inverse = np.linalg.inv(np.where(feasible[..., None, None], HHt, np.eye(dimension)))

    counts = both & heard & feasible[..., None, :]
    number = counts.sum(axis=-1)
    defined = feasible & (number > 0)
    share = np.where(defined, 1.0 / np.maximum(number, 1), np.nan)

    apart = _squared_distances(_readings(relative, sees, inverse))
    slope = here.sum(axis=-1)[..., None] * share * sum_over(np.where(counts, apart, 0.0), -1)
    spread = np.einsum("...ii", inverse)  # ||Phi_i||_F^2
    pairs = sum_over(np.where(counts, spread[..., :, None] + spread[..., None, :], 0.0), -1)
    return Bounds(slope, np.trace(covariance) * share * pairs)


def _readings(relative: Array, sees: Mask, inverse: Array) -> Array:
    """B_i Phi_i^T, flat, shape (..., N, N D): how agent i's fit reads everybody's position."""
    phi = np.where(sees[..., None], product(relative, inverse), 0.0)
    own = np.eye(sees.shape[-1])[..., None] * sum_over(phi, -2)[..., None, :]
    return (own - phi).reshape(*phi.shape[:-2], -1)


def _squared_distances(rows: Array) -> Array:
    """Between all pairs of rows (..., N, M), shape (..., N, N)."""
    products = product(rows, np.swapaxes(rows, -1, -2))
    squares = np.einsum("...ii->...i", products)
    sizes = squares[..., :, None] + squares[..., None, :]
    apart = sizes - 2.0 * products
    # Two agents that see the same simplex fit the same map whatever it looks like: what rounding leaves is no slope.
    return np.where(apart > _ROUNDING * sizes, apart, 0.0)
