"""Jacobi over-relaxation: where it leads, and how fast, against dense eigenvalues and paper 003."""

import numpy as np
import pytest
from measured_graphs import SPACES, campaign, chain, edges_of, iteration, least_squares, middle, own_weights

from analysis.claims import random_graphs
from analysis.models import jacobi
from analysis.models.jacobi import spectrum, system, weights


def dense(edges):
    """D^-1 Upsilon, block by block."""
    agents, dimension = edges.pull.shape[-3], edges.pull.shape[-1]
    matrix = np.zeros((agents, dimension, agents, dimension))
    for i in range(agents):
        own = sum(edges.information[i])
        for j in range(agents):
            matrix[i, :, j] = np.eye(dimension) if i == j else -np.linalg.inv(own) @ edges.information[i, j]
    return matrix.reshape(agents * dimension, -1)


def radius(matrix):
    return np.abs(np.linalg.eigvals(matrix)).max()


def limit(edges, h, start, doublings):
    """Where 2^doublings iterations (12) lead: an affine map, squared again and again."""
    own, eta = weights(edges), edges.pull.sum(axis=-2)
    M, shift = iteration(edges, h), h * np.linalg.solve(own, eta[..., None]).ravel()
    for _ in range(doublings):
        M, shift = M @ M, M @ shift + shift
    return (M @ start.ravel() + shift).reshape(start.shape)


def test_jor_comes_to_the_optimum_about_the_weighted_centroid_of_where_it_began():
    for seed in range(100):
        agents, made, rng = campaign(seed)
        edges, own = edges_of(agents, made), own_weights(agents, made)
        start, h = 5 * rng.normal(size=(agents, 2)), rng.uniform(0.1, 0.98)
        best = least_squares(agents, made, 0)
        expected = best - middle(best, own) + middle(start, own)  # (20)
        np.testing.assert_allclose(limit(edges, h, start, 16), expected, atol=1e-9)


def test_rates_are_the_spectral_radii_of_the_iteration():
    for seed in range(20):
        agents, made, _ = campaign(seed)
        edges, own = edges_of(agents, made), own_weights(agents, made)
        for h, anchor in ((0.49, 0), (0.9, agents - 1)):
            M = iteration(edges, h)
            np.testing.assert_allclose(M, np.eye(2 * agents) - h * dense(edges), atol=1e-12)
            ones = np.tile(np.eye(2), (agents, 1))
            M_c = ones @ np.linalg.inv(sum(own)) @ np.concatenate(own, axis=1)
            kept = [row for row in range(2 * agents) if row // 2 != anchor]
            found = jacobi.rates(edges, h, anchor)
            assert found.centroid == pytest.approx(radius(M - M_c), abs=1e-9)
            assert found.anchor == pytest.approx(radius(M[np.ix_(kept, kept)]), abs=1e-9)


@pytest.mark.parametrize("h", [0.1, 0.3, 0.49])
def test_below_one_half_the_eigenvalues_are_positive_and_as_many_as_dimensions_are_one(h):
    for dimension in (2, 3):
        for seed in range(30):
            agents, made, _ = campaign(seed, dimension)
            values = np.linalg.eigvals(iteration(edges_of(agents, made, dimension), h))
            assert np.abs(values.imag).max() < 1e-7
            assert values.real.min() > 0.0
            assert values.real.max() <= 1.0 + 1e-9
            assert (values.real > 1.0 - 1e-7).sum() == dimension


def test_a_chain_with_a_step_near_one_has_negative_eigenvalues():
    values = np.linalg.eigvals(iteration(chain(), 0.99)).real
    assert -1.0 < values.min() < -0.9
    assert np.linalg.eigvals(iteration(chain(), 0.49)).real.min() > 0.0


@SPACES
def test_the_spectrum_is_that_of_the_jacobi_matrix_in_ascending_order(dimension):
    for seed in range(10):
        agents, made, _ = campaign(seed, dimension)
        edges = edges_of(agents, made, dimension)
        found = spectrum(edges)
        np.testing.assert_allclose(found, np.sort(np.linalg.eigvals(dense(edges)).real), atol=1e-9)
        np.testing.assert_allclose(found[:dimension], 0.0, atol=1e-12)
        assert found[dimension] > 1e-4


def test_the_fastest_steps_are_those_of_section_v():
    for seed in range(20):
        edges = random_graphs.edges(seed, 6)
        values = np.sort(np.linalg.eigvals(dense(edges)).real)
        smooth, fast = (jacobi.step(edges, kind) for kind in ("smooth", "fast"))
        assert smooth == pytest.approx(1.0 / values[-1], rel=1e-9)
        assert fast == pytest.approx(2.0 / (values[2] + values[-1]), rel=1e-9)
        assert np.linalg.eigvals(iteration(edges, smooth)).real.min() == pytest.approx(0.0, abs=1e-9)
        best = jacobi.rates(edges, fast, 0).centroid
        assert all(jacobi.rates(edges, fast + off, 0).centroid > best for off in (-0.01, 0.01))


def test_a_system_is_symmetric_and_blind_to_the_common_frame():
    agents, made, _ = campaign(11)
    matrix, eta = system(edges_of(agents, made))
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    np.testing.assert_allclose(matrix @ np.tile(np.eye(2), (agents, 1)), 0.0, atol=1e-12)
    np.testing.assert_allclose(eta.reshape(agents, 2).sum(axis=0), 0.0, atol=1e-12)
