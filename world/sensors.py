"""The relative position sensor of paper 000, eq. 7."""

from __future__ import annotations

import numpy as np

from netem.links import Links
from world.formation import Array


def relative(position: Array, links: Links) -> Array:
    """z_ij = z_i - z_j of every directed link j -> i, shape (..., L, D), for positions (..., N, D), in metres."""
    seen: Array = position[..., links.dst - 1, :] - position[..., links.src - 1, :]
    return seen


def noise(standard: Array, covariance: Array) -> Array:
    """Measurement noise v_ij with this covariance (D, D), from standard normal draws (..., D)."""
    coloured: Array = standard @ np.linalg.cholesky(covariance).T
    return coloured
