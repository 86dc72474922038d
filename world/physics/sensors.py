"""The relative position sensor of paper 000, eq. 7, and how it fails."""

from __future__ import annotations

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.faults.conditions import Conditions


def relative(position: Array, links: Links) -> Array:
    """z_ij = z_i - z_j of every directed link j -> i, shape (..., L, D), for positions (..., N, D), in metres."""
    between: Array = _between(position[..., None, :, :], links.dst, links.src)
    return between


@kernel("(n,D),(),()->(D)", "dll->d")
def _between(D: int) -> Plain:
    def plain(position: Array, dst: int, src: int, between: Array) -> None:
        for axis in range(D):
            between[axis] = position[dst - 1, axis] - position[src - 1, axis]

    return plain


def noise(standard: Array, covariance: Array) -> Array:
    """Measurement noise v_ij with this covariance (D, D), from standard normal draws (..., D)."""
    coloured: Array = product(standard, np.linalg.cholesky(covariance).T)
    return coloured


def stray(draw: Array, now: Conditions) -> Mask:
    """Which measurements are outliers, shape (L,), from uniform draws (L,)."""
    return draw < now.outlier


def last(before: Array, measured: Array) -> Array:
    """What was measured last, shape (L, D), where what is measured now has gaps, of NaN."""
    return np.where(np.isnan(measured), before, measured)


def astray(measured: Array, before: Array, struck: Mask, standard: Array, now: Conditions) -> Array:
    """What failing sensors say, shape (L, D), in metres.

    Parameters
    ----------
    measured, before
        What they would say if they worked, and what they said in the tick before, shape (L, D).
    struck
        Which measurements are outliers, shape (L,).
    standard
        Standard normal, shape (L, D): how far outliers stray, in their deviations.
    now
        Which sensors are biased, stray, or repeat themselves.
    """
    wrong = measured + now.bias + np.where(struck[:, None], now.deviation[:, None] * standard, 0.0)
    return np.where(now.frozen[:, None], before, wrong)
