"""Values with their derivatives, against polynomials, exponentials and closed forms."""

import numpy as np
import pytest
from numpy.polynomial import polynomial
from scipy.linalg import expm

from analysis.models import jets


def jet_of(matrix, size, t, orders):
    """The jet of exp(t matrix)."""
    return np.stack([np.linalg.matrix_power(matrix, order) @ expm(t * matrix) for order in range(orders)]).reshape(
        orders, size, size
    )


def derivatives(coefficients, t, orders):
    """Of polynomials in t, coefficients (n, ...)."""
    return np.stack([polynomial.polyval(t, polynomial.polyder(coefficients, order)) for order in range(orders)])


def test_the_jet_of_a_product_of_polynomials_is_that_of_the_polynomial():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(4, 2, 3)), rng.normal(size=(3, 3, 2))
    product = np.zeros((6, 2, 2))
    for low, left in enumerate(one):
        for high, right in enumerate(other):
            product[low + high] += left @ right
    found = jets.times(derivatives(one, 0.7, 5), derivatives(other, 0.7, 5))
    np.testing.assert_allclose(found, derivatives(product, 0.7, 5), rtol=1e-12, atol=1e-12)


def test_the_jet_of_the_inverse_of_an_exponential_is_that_of_the_exponential_backwards():
    matrix = np.random.default_rng(1).normal(size=(3, 3))
    np.testing.assert_allclose(
        jets.inverse(jet_of(matrix, 3, 0.4, 5)), jet_of(-matrix, 3, 0.4, 5), rtol=1e-9, atol=1e-9
    )


def test_the_jet_of_a_product_of_jets_with_leading_axes_is_that_of_each():
    rng = np.random.default_rng(2)
    one, other = rng.normal(size=(3, 5, 2, 2)), rng.normal(size=(3, 5, 2, 2))
    for row in range(5):
        np.testing.assert_array_equal(jets.times(one, other)[:, row], jets.times(one[:, row], other[:, row]))
        np.testing.assert_allclose(jets.inverse(one)[:, row], jets.inverse(one[:, row]), rtol=1e-9)


def test_the_jet_of_a_number_times_a_matrix():
    matrix, rate = np.random.default_rng(3).normal(size=(2, 2)), 0.6
    growing = np.array([rate**order * np.exp(0.5 * rate) for order in range(4)])
    expected = jet_of(matrix + rate * np.eye(2), 2, 0.5, 4)
    np.testing.assert_allclose(jets.scaled(growing, jet_of(matrix, 2, 0.5, 4)), expected, rtol=1e-11, atol=1e-11)


def test_the_jet_of_a_quotient_is_that_of_the_tangent():
    t = np.array([0.3, -0.8])
    sine, cosine = (np.stack([wave(t + order * np.pi / 2) for order in range(4)]) for wave in (np.sin, np.cos))
    tan = np.tan(t)
    slope = 1 + tan**2
    np.testing.assert_allclose(
        jets.quotient(sine, cosine), [tan, slope, 2 * tan * slope, 2 * slope**2 + 4 * tan**2 * slope], rtol=1e-12
    )


@pytest.mark.parametrize("exponent", [0, 1, 2, 3, 5])
def test_the_jet_of_a_power_is_that_of_the_polynomial(exponent):
    rate, start, t = np.array([0.5, -2.0]), np.array([0.1, 1.3]), 0.7
    found = jets.power(start + rate * t, exponent, rate, 5)
    for row in range(2):
        coefficients = polynomial.polypow([start[row], rate[row]], exponent)
        np.testing.assert_allclose(found[:, row], derivatives(coefficients, t, 5), rtol=1e-11, atol=1e-12)
