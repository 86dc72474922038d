"""Normalised errors and their chi-square bands."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from analysis import consistency

DRAWS = np.random.default_rng(7)


def covariances(dimension, number):
    """Random covariances, and their upper triangles."""
    factor = DRAWS.normal(size=(number, dimension, dimension))
    whole = factor @ factor.swapaxes(-1, -2) + 0.1 * np.eye(dimension)
    return whole, whole[:, *np.triu_indices(dimension)]


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_a_normalised_error_is_what_the_inverse_makes_of_it(dimension):
    whole, triangle = covariances(dimension, 20)
    error = DRAWS.normal(size=(20, dimension))
    by_hand = [e @ np.linalg.inv(P) @ e for e, P in zip(error, whole, strict=True)]
    np.testing.assert_allclose(consistency.nees(error, triangle), by_hand, rtol=1e-9)


def test_it_is_the_exponent_of_the_normal_density():
    whole, triangle = covariances(3, 1)
    error = DRAWS.normal(size=3)
    peak, here = multivariate_normal(cov=whole[0]).logpdf([np.zeros(3), error])
    assert consistency.nees(error, triangle[0]) == pytest.approx(2.0 * (peak - here))


def test_any_axes_may_lead():
    _, triangle = covariances(2, 24)
    error = DRAWS.normal(size=(24, 2))
    stacked = consistency.nees(error.reshape(2, 3, 4, 2), triangle.reshape(2, 3, 4, 3))
    np.testing.assert_array_equal(stacked.ravel(), consistency.nees(error, triangle))


def test_a_covariance_ten_times_too_small_makes_it_ten_times_too_large():
    _, triangle = covariances(2, 5)
    error = DRAWS.normal(size=(5, 2))
    np.testing.assert_allclose(consistency.nees(error, 0.1 * triangle), 10 * consistency.nees(error, triangle))


@pytest.mark.parametrize("level", [0.5, 0.9, 0.95, 0.99, 0.999])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("number", [1, 7, 24, 2400])
def test_the_band_is_the_chi_square_interval(level, dimension, number):
    low, high = chi2.interval(level, dimension * number)
    assert consistency.band(level, dimension, number) == pytest.approx((low / number, high / number), rel=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_band_narrows_around_the_dimension(dimension):
    bands = [consistency.band(0.95, dimension, number) for number in (1, 10, 100, 10_000)]
    assert all(a[0] < b[0] < dimension < b[1] < a[1] for a, b in pairwise(bands))
    assert bands[-1] == pytest.approx((dimension, dimension), rel=0.03)


@pytest.mark.parametrize(("level", "dimension", "number"), [(0.9, 2, 24), (0.99, 3, 5), (0.5, 2, 1)])
def test_so_many_means_of_normal_errors_lie_in_the_band(level, dimension, number):
    trials = 20_000
    whole, triangle = covariances(dimension, number)
    error = (np.linalg.cholesky(whole) @ DRAWS.normal(size=(trials, number, dimension, 1)))[..., 0]
    mean = consistency.nees(error, np.broadcast_to(triangle, (trials, *triangle.shape))).mean(axis=1)
    low, high = consistency.band(level, dimension, number)
    below, above = (mean < low).mean(), (mean > high).mean()
    spread = np.sqrt((1 - level) / 2 * (1 + level) / 2 / trials)
    assert abs(below - (1 - level) / 2) < 4 * spread
    assert abs(above - (1 - level) / 2) < 4 * spread
