"""Normalised errors and their chi-square bands."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from agents.algebra import kalman
from analysis.metrics import consistency
from analysis.models.small import triangle

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


# Means over the edges of a swarm


def edges(rng, dimension, *shape, scale=1.0):
    """Random covariances of these edges."""
    factor = rng.normal(size=(*shape, dimension, dimension))
    return scale * (factor @ factor.swapaxes(-1, -2) + 0.1 * np.eye(dimension))


@pytest.mark.parametrize("dimension", [1, 2, 3])
def test_whole_matrices_come_of_their_triangles(dimension):
    rng = np.random.default_rng(21)
    matrices = edges(rng, dimension, 2, 5)
    np.testing.assert_array_equal(consistency.whole(triangle(matrices)), matrices)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_errors_of_a_swarm_are_the_mean_over_its_known_edges_whatever_the_others_hold(dimension):
    rng = np.random.default_rng(22)
    true, error = rng.normal(size=(2, 3, 5, 4, dimension))
    covariance, known = triangle(edges(rng, dimension, 3, 5, 4)), rng.random((3, 5, 4)) < 0.6
    estimate, unknown = true + error, ~known
    number = known.sum(axis=(1, 2))
    expected = [
        np.mean([consistency.nees(error[t, i, j], covariance[t, i, j]) for i, j in np.argwhere(known[t])])
        for t in range(3)
    ]
    assert len(set(number.tolist())) > 1
    for nothing in (0.0, np.nan):
        estimate[unknown], true[unknown], covariance[unknown] = nothing, nothing, nothing
        found = consistency.of_errors(estimate, true, covariance, known)
        np.testing.assert_allclose(found.mean, expected, rtol=1e-12)
        np.testing.assert_array_equal(found.number, number)


def test_without_an_edge_there_is_no_mean():
    counted = np.zeros((2, 5, 4), dtype=bool)
    counted[1, 3, 2] = True
    P, e = np.array([[0.5, 0.1], [0.1, 0.4]]), np.array([0.3, -0.2])
    estimate, covariance = (np.where(counted[..., None], given, np.nan) for given in (e, triangle(P)))
    errors = consistency.of_errors(estimate, np.zeros_like(estimate), covariance, counted)
    assert errors.mean[1] == pytest.approx(e @ np.linalg.inv(P) @ e)
    innovations = consistency.of_innovations(np.where(counted, 3.0, np.nan), counted)
    assert innovations.mean[1] == 3.0
    for found in (errors, innovations):
        assert found.number.tolist() == [0, 1]
        assert np.isnan(found.mean[0])


def test_an_edge_that_is_sure_of_all_makes_the_mean_infinite():
    estimate, known = np.ones((1, 2, 2)), np.ones((1, 2), dtype=bool)
    covariance = np.array([[[0.5, 0.1, 0.4], [0.0, 0.0, 0.4]]])
    assert consistency.of_errors(estimate, np.zeros_like(estimate), covariance, known) == (np.inf, 2)


@pytest.mark.parametrize("turn", [0.3, 0.7, 1.1])
def test_an_error_where_the_covariance_sees_nothing_is_not_negative_for_rounding(turn):
    # All of the uncertainty is along a line; rounding leaves a determinant of either sign.
    line = np.array([np.cos(turn), np.sin(turn)])
    P = 0.01 * np.outer(line, line)
    assert consistency.nees(np.array([1.0, 0.5]), triangle(P)) > 1e9


# Innovations


@pytest.mark.parametrize("dimension", [1, 2, 3])
@pytest.mark.parametrize("derivatives", [0, 1, 2])
@pytest.mark.parametrize("ratio", [1e-2, 1.0, 1e2])
def test_innovations_are_normalised_by_their_covariance(dimension, derivatives, ratio):
    rng = np.random.default_rng(23)
    size = dimension * (1 + derivatives)
    mean, prior = rng.normal(size=(3, 5, 4, size)), edges(rng, size, 3, 5, 4, scale=ratio)
    y, R = rng.normal(size=(3, 5, 4, dimension)), edges(rng, dimension, 3, 5, 4)
    seen = rng.random((3, 5, 4)) < 0.6
    nu, S = y - mean[..., :dimension], prior[..., :dimension, :dimension] + R
    explicit = (nu * np.linalg.solve(S, nu[..., None])[..., 0]).sum(axis=-1)
    nis = kalman.correct(mean, prior, y, R, seen).nis
    np.testing.assert_allclose(nis, np.where(seen, explicit, np.nan), rtol=1e-9)
    found = consistency.of_innovations(nis, seen)
    np.testing.assert_allclose(found.mean, [explicit[t][seen[t]].mean() for t in range(3)], rtol=1e-9)
    np.testing.assert_array_equal(found.number, seen.sum(axis=(1, 2)))


def test_innovations_of_filters_that_believe_their_sensors_too_much_are_too_long():
    rng = np.random.default_rng(26)
    mean, prior = np.zeros((1, 4000, 2)), np.broadcast_to(0.5 * np.eye(2), (1, 4000, 2, 2))
    seen = np.ones((1, 4000), dtype=bool)
    for noise, expected in ((1.0, 2.0), (4.0, 2.0 * 4.5 / 1.5)):
        y = np.sqrt(0.5 + noise) * rng.normal(size=(1, 4000, 2))
        nis = kalman.correct(mean, prior, y, np.broadcast_to(np.eye(2), (1, 4000, 2, 2)), seen).nis
        assert consistency.of_innovations(nis, seen).mean == pytest.approx(expected, rel=0.05)


def test_an_innovation_of_a_filter_that_diverged_is_not_passed_over():
    seen = np.array([[True, True, False]])
    assert np.isnan(consistency.of_innovations(np.array([[2.0, np.nan, np.nan]]), seen).mean)
    assert consistency.of_innovations(np.array([[2.0, 4.0, np.nan]]), seen) == (3.0, 2)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("diverged", [np.nan, np.inf])
def test_an_edge_that_diverged_ends_nothing(dimension, diverged):
    y = np.ones((1, 2, dimension))
    P = np.stack([np.full((dimension, dimension), diverged), 0.5 * np.eye(dimension)])[None]
    known = np.ones((1, 2), dtype=bool)
    with np.errstate(invalid="ignore"):
        assert not np.isfinite(consistency.of_errors(np.inf * y, y, triangle(P), known).mean)
