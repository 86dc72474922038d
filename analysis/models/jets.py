"""Jets: a quantity and its first m derivatives in time, along a leading axis of length m + 1.

Products and inverses are exact (paper 002, lemma 1), whatever the derivatives are of.
"""

from __future__ import annotations

from functools import reduce
from math import comb

import numpy as np

from analysis.models import small
from analysis.models.algebra import product
from analysis.models.arrays import Array
from analysis.models.elementary import whole_power


def times(one: Array, other: Array) -> Array:
    """The jet of a matrix product, of jets (m + 1, ..., r, s) and (m + 1, ..., s, c)."""
    return np.stack(
        [
            reduce(
                np.add, [comb(order, lower) * product(one[lower], other[order - lower]) for lower in range(order + 1)]
            )
            for order in range(len(one))
        ]
    )


def scaled(factor: Array, other: Array) -> Array:
    """The jet of numbers (m + 1, ...) times matrices (m + 1, ..., r, c)."""
    wide = factor[..., None, None]
    return np.stack(
        [
            reduce(np.add, [comb(order, lower) * wide[lower] * other[order - lower] for lower in range(order + 1)])
            for order in range(len(factor))
        ]
    )


def inverse(matrix: Array) -> Array:
    """The jet of the inverses of matrices (m + 1, ..., r, r) (lemma 1, i)."""
    inverted = [small.inverse(matrix[0])]
    for order in range(1, len(matrix)):
        drawn = reduce(
            np.add, [comb(order, lower) * product(matrix[order - lower], inverted[lower]) for lower in range(order)]
        )
        inverted.append(product(-inverted[0], drawn))
    return np.stack(inverted)


def quotient(numerator: Array, denominator: Array) -> Array:
    """The jet of a quotient of numbers (m + 1, ...)."""
    found: list[Array] = []
    for order, rest in enumerate(numerator):
        drawn = [comb(order, lower) * found[lower] * denominator[order - lower] for lower in range(order)]
        found.append(reduce(np.subtract, drawn, rest) / denominator[0])
    return np.stack(found)


def power(base: Array, exponent: int, rate: Array, orders: int) -> Array:
    """The jet of x^n where x moves at a rate, shape (orders, ...)."""
    jet = []
    for order in range(orders):
        falling = float(np.prod(np.arange(exponent - order + 1, exponent + 1))) if order <= exponent else 0.0
        jet.append(falling * whole_power(base, max(exponent - order, 0)) * whole_power(rate, order))
    return np.stack(jet)
