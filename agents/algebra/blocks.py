"""Block matrices: the covariances of an agent's edges, each by itself and all together."""

from __future__ import annotations

import numpy as np

from analysis.models.arrays import Array


def block_diagonal(blocks: Array) -> Array:
    """Blocks (..., n, D, D) on the diagonal of matrices (..., n D, n D)."""
    slots, dimension = blocks.shape[-3], blocks.shape[-1]
    apart = np.zeros((*blocks.shape[:-3], slots, dimension, slots, dimension))
    for slot in range(slots):
        apart[..., slot, :, slot, :] = blocks[..., slot, :, :]
    return apart.reshape(*blocks.shape[:-3], slots * dimension, slots * dimension)


def diagonal_blocks(matrix: Array, dimension: int) -> Array:
    """The blocks (..., n, D, D) on the diagonal of matrices (..., n D, n D)."""
    slots = matrix.shape[-1] // dimension
    blocks = matrix.reshape(*matrix.shape[:-2], slots, dimension, slots, dimension)
    diagonal: Array = np.moveaxis(np.diagonal(blocks, axis1=-4, axis2=-2), -1, -3)
    return diagonal
