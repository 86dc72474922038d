"""Ends of the spectrum of symmetric matrices: of small ones whole, of large ones by Lanczos on their few nonzero entries."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import eigsh

from analysis.models.arrays import Array

_DENSE = 200  # rows up to which the whole spectrum is as fast
_SHIFT = 1e-12  # of the largest eigenvalue: what is inverted about it is regular even where the matrix is not
_GOLDEN = 0.6180339887498949


def largest(matrix: sparse.csr_array) -> float:
    """The largest eigenvalue of a symmetric matrix without negative ones, shape (F, F)."""
    if matrix.shape[0] <= _DENSE:
        return float(np.linalg.eigvalsh(matrix.toarray())[-1])
    return float(eigsh(matrix, k=1, which="LA", v0=_start(matrix), return_eigenvectors=False)[0])


def slowest(matrix: sparse.csr_array, scale: float) -> tuple[float, Array]:
    """The smallest eigenvalue of a symmetric matrix (F, F) without negative ones, and its mode (F,).

    Parameters
    ----------
    matrix, scale
        The matrix, and about how large its eigenvalues are.
    """
    if matrix.shape[0] <= _DENSE:
        values, modes = np.linalg.eigh(matrix.toarray())
        return float(values[0]), modes[:, 0]
    values, modes = eigsh(matrix.tocsc(), k=1, sigma=-_SHIFT * scale, v0=_start(matrix))
    return float(values[0]), modes[:, 0]


def _start(matrix: sparse.csr_array) -> Array:
    """Neither random, nor as symmetric as a formation may be: a mode across which it is would never be found."""
    steps = np.arange(1.0, matrix.shape[0] + 1.0) * _GOLDEN
    return steps - np.floor(steps) - 0.4
