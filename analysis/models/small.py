"""Determinant, inverse and nearest rotation of stacks of D x D matrices: closed forms where there are any, or LAPACK.

At this size a call into LAPACK is mostly preparation.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from analysis.kernels.kernel import Part, Plain, kernel, scratch
from analysis.models.algebra import product
from analysis.models.arrays import Array
from analysis.models.elementary import hypot

_CLOSED = 3  # the largest size for which there is a closed form


def determinant(matrix: Array) -> Array:
    """Determinants, shape (...), of matrices (..., D, D)."""
    found: Array = _determinants(matrix)
    return found


def inverse(matrix: Array) -> Array:
    """Inverses of regular matrices (..., D, D)."""
    if matrix.shape[-1] > _CLOSED:
        return _inverted(matrix)
    inverted: Array = _inverses(matrix)
    return inverted


def _inverted(matrix: Array) -> Array:
    try:
        return np.linalg.inv(matrix).astype(np.float64, copy=False)
    except np.linalg.LinAlgError:
        # A swarm that diverges overflows at last, which is not to end the flight. A sign does not underflow, as a
        # determinant does: the other matrices of the stack have the inverses that they have alone.
        regular = (np.linalg.slogdet(matrix).sign != 0.0)[..., None, None]
        inverted = np.linalg.inv(np.where(regular, matrix, np.eye(matrix.shape[-1])))
        return np.where(regular, inverted, np.nan)


@Part
def invert(matrix: Array, inverse: Array) -> float:
    """Fill in the inverse of a matrix (D, D) by its adjugate, and give its determinant."""
    if len(matrix) == 1:
        determinant = matrix[0, 0]
        inverse[0, 0] = 1.0
    elif len(matrix) == 2:
        determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
        inverse[0, 0], inverse[1, 1] = matrix[1, 1], matrix[0, 0]
        inverse[0, 1], inverse[1, 0] = -matrix[0, 1], -matrix[1, 0]
    else:
        for row in range(3):
            for column in range(3):
                up, down, left, right = (column + 1) % 3, (column + 2) % 3, (row + 1) % 3, (row + 2) % 3
                inverse[row, column] = matrix[up, left] * matrix[down, right] - matrix[up, right] * matrix[down, left]
        determinant = matrix[0, 0] * inverse[0, 0] + matrix[0, 1] * inverse[1, 0] + matrix[0, 2] * inverse[2, 0]
    for row in range(len(matrix)):
        for column in range(len(matrix)):
            inverse[row, column] /= determinant
    return determinant


@kernel("(D,D)->(D,D)", "d->d")
def _inverses(_: int) -> Plain:
    def plain(matrix: Array, inverse: Array) -> None:
        invert(matrix, inverse)

    return plain


@kernel("(D,D)->()", "d->d")
def _determinants(D: int) -> Plain:
    def plain(matrix: Array, found: Array) -> None:
        found[0] = invert(matrix, scratch(D, D))

    return plain


def rotation(matrix: Array) -> Array:
    """The rotations nearest to matrices (..., D, D): U V^T of their singular vectors, the determinant fixed to +1.

    Where all are as near, as to 0, it is the identity.
    """
    if matrix.shape[-1] == 2:
        return _turn(matrix[..., 0, 0] + matrix[..., 1, 1], matrix[..., 1, 0] - matrix[..., 0, 1])
    # A swarm that diverges overflows at last: LAPACK would raise, and end the flight.
    finite = np.isfinite(matrix).all(axis=(-2, -1), keepdims=True)
    U, _, Vt = np.linalg.svd(np.where(finite, matrix, 0.0))
    U[..., -1] *= np.where(determinant(product(U, Vt)) < 0.0, -1.0, 1.0)[..., None]
    nearest: Array = product(U, Vt)
    return nearest


def _turn(along: Array, across: Array) -> Array:
    length = hypot(along, across)
    somewhere = length > 0.0
    size = np.where(somewhere, length, 1.0)
    cosine, sine = np.where(somewhere, along, 1.0) / size, across / size
    return np.stack([cosine, -sine, sine, cosine], axis=-1).reshape(*cosine.shape, 2, 2)


def triangle(matrix: Array) -> Array:
    """The upper triangles of matrices (..., D, D), row by row, shape (..., D (D + 1) / 2)."""
    rows, columns = _upper(matrix.shape[-1])
    upper: Array = matrix[..., rows, columns]
    return upper


@cache
def _upper(size: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    # Looking for them takes ten times as long as taking them, and an agent does so in every tick.
    return np.triu_indices(size)
