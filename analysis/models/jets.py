"""Jets: a quantity and its first m derivatives in time, along a leading axis of length m + 1.

Products and inverses are exact (paper 002, lemma 1), whatever the derivatives are of.
"""

from __future__ import annotations

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models import small
from analysis.models.arrays import Array


def times(one: Array, other: Array) -> Array:
    """The jet of a matrix product, of jets (m + 1, ..., r, s) and (m + 1, ..., s, c)."""
    return _jet(_times(_row(one, 2), _row(other, 2)), 2)


def scaled(factor: Array, other: Array) -> Array:
    """The jet of numbers (m + 1, ...) times matrices (m + 1, ..., r, c)."""
    return _jet(_scaled(_row(factor, 0), _row(other, 2)), 2)


def inverse(matrix: Array) -> Array:
    """The jet of the inverses of matrices (m + 1, ..., r, r) (lemma 1, i)."""
    return _jet(_inverse(_row(matrix, 2), small.inverse(matrix[0])), 2)


def quotient(numerator: Array, denominator: Array) -> Array:
    """The jet of a quotient of numbers (m + 1, ...)."""
    return _jet(_quotient(_row(numerator, 0), _row(denominator, 0)), 0)


def power(base: Array, exponent: int, rate: Array, orders: int) -> Array:
    """The jet of x^n where x moves at a rate, shape (orders, ...)."""
    return _jet(_power(np.asarray(base), exponent, np.asarray(rate), np.empty(orders)), 0)


def _row(jet: Array, axes: int) -> Array:
    """A jet (m + 1, ..., *), as kernels have it: (..., m + 1, *)."""
    return np.moveaxis(jet, 0, -1 - axes)


def _jet(row: Array, axes: int) -> Array:
    return np.moveaxis(row, -1 - axes, 0)


@kernel("(j,r,s),(j,s,c)->(j,r,c)", "dd->d")
def _times() -> Plain:
    def plain(one: Array, other: Array, made: Array) -> None:
        for order in range(len(one)):
            for row in range(one.shape[1]):
                for column in range(other.shape[2]):
                    summed, ways = 0.0, 1.0
                    for lower in range(order + 1):
                        product = 0.0
                        for between in range(other.shape[1]):
                            product += one[lower, row, between] * other[order - lower, between, column]
                        summed += ways * product
                        ways = ways * (order - lower) / (lower + 1)
                    made[order, row, column] = summed

    return plain


@kernel("(j),(j,r,c)->(j,r,c)", "dd->d")
def _scaled() -> Plain:
    def plain(factor: Array, other: Array, made: Array) -> None:
        for order in range(len(factor)):
            for row in range(other.shape[1]):
                for column in range(other.shape[2]):
                    summed, ways = 0.0, 1.0
                    for lower in range(order + 1):
                        summed += ways * factor[lower] * other[order - lower, row, column]
                        ways = ways * (order - lower) / (lower + 1)
                    made[order, row, column] = summed

    return plain


@kernel("(j,r,r),(r,r)->(j,r,r)", "dd->d")
def _inverse() -> Plain:
    def plain(matrix: Array, first: Array, made: Array) -> None:
        size = len(first)
        for row in range(size):
            for column in range(size):
                made[0, row, column] = first[row, column]
        for order in range(1, len(matrix)):
            for row in range(size):
                for column in range(size):
                    made[order, row, column] = 0.0
            for column in range(size):
                for between in range(size):
                    drawn, ways = 0.0, 1.0
                    for lower in range(order):
                        product = 0.0
                        for inner in range(size):
                            product += matrix[order - lower, between, inner] * made[lower, inner, column]
                        drawn += ways * product
                        ways = ways * (order - lower) / (lower + 1)
                    for row in range(size):
                        made[order, row, column] -= first[row, between] * drawn

    return plain


@kernel("(j),(j)->(j)", "dd->d")
def _quotient() -> Plain:
    def plain(numerator: Array, denominator: Array, made: Array) -> None:
        for order in range(len(numerator)):
            rest, ways = numerator[order], 1.0
            for lower in range(order):
                rest -= ways * made[lower] * denominator[order - lower]
                ways = ways * (order - lower) / (lower + 1)
            made[order] = rest / denominator[0]

    return plain


@kernel("(),(),(),(j)->(j)", "dldd->d")
def _power() -> Plain:
    def plain(base: float, exponent: int, rate: float, orders: Array, made: Array) -> None:
        for order in range(len(orders)):
            term = 1.0
            for number in range(exponent - order + 1, exponent + 1):
                term *= number
            for _ in range(exponent - order):
                term *= base
            for _ in range(order):
                term *= rate
            made[order] = term if order <= exponent else 0.0

    return plain
