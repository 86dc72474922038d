"""The bounds of the convergence indicator: Theorem 1 on a thousand swarms, Corollary 1 in expectation."""

import numpy as np
import pytest
from scipy.stats import sem

from agents.algebra import geometry
from agents.algebra.constraints import MAPS
from analysis.metrics.errors import tracking_error
from analysis.metrics.indicator import bounds
from analysis.models import graph
from netem.core.links import Links
from world.formation.nominal import PRESETS

R = np.array([[0.01, 0.003], [0.003, 0.02]])
NOWHERE = np.zeros((2, 2))


def indicators(nominal, position, heard, seen=None, noise=0.0):
    """psi (16) of every agent (..., N), as the estimators make it, at positions (..., N, D)."""
    seen = heard if seen is None else seen
    relative = np.broadcast_to(nominal[..., :, None, :] - nominal[..., None, :, :], (*seen.shape, nominal.shape[-1]))
    measured = position[..., :, None, :] - position[..., None, :, :] + noise
    fit = MAPS["affine"].fit(relative, np.where(seen[..., None], measured, 0.0), seen)
    theirs = np.broadcast_to(fit.theta[..., None, :, :, :], (*fit.theta.shape[:-2], *fit.theta.shape[-3:]))
    return geometry.indicator(fit, theirs, heard & fit.feasible[..., None, :])


def below(psi, slope, error):
    """Whether psi <= slope error, up to rounding, wherever both are defined."""
    np.testing.assert_array_equal(np.isnan(psi), np.isnan(slope))
    defined = np.isfinite(psi)
    bound = (slope * error[:, None])[defined]
    return (psi[defined] <= bound * (1 + 1e-9) + 1e-12 * error.max()).all()


def graphs(rng, number, agents, share):
    """Random directed graphs, (number, N, N)."""
    return (rng.random((number, agents, agents)) < share) & ~np.eye(agents, dtype=bool)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("share", [0.3, 0.6, 1.0])
def test_theorem_1_bounds_the_indicator_of_a_thousand_random_swarms(dimension, share):
    rng = np.random.default_rng(dimension)
    nominal, target = rng.normal(size=(1000, 8, dimension)), rng.normal(size=(1000, dimension, dimension))
    targets = nominal @ target + rng.normal(size=(1000, 1, dimension))
    position = targets + rng.lognormal(sigma=2, size=(1000, 1, 1)) * rng.normal(size=nominal.shape)
    heard = graphs(rng, 1000, 8, share)
    psi = indicators(nominal, position, heard)
    slope, offset = bounds(nominal, heard, np.zeros((dimension, dimension)))
    error = tracking_error(position, targets, np.ones((1000, 8), dtype=bool))
    assert below(psi, slope, error)
    assert np.isfinite(psi).sum() > 1000
    np.testing.assert_array_equal(offset[np.isfinite(psi)], 0.0)


@pytest.mark.parametrize("name", PRESETS)
def test_theorem_1_bounds_the_indicator_of_the_presets_over_parts_of_their_graphs(name):
    formation, rng = PRESETS[name], np.random.default_rng(1)
    links = Links.both_ways(formation.agents, formation.edges)
    up = rng.random((1000, len(links))) < 0.7
    heard = graph.adjacency(up, links.src, links.dst, formation.agents)
    position = formation.nominal + rng.normal(size=(1000, *formation.nominal.shape))
    psi = indicators(formation.nominal, position, heard)
    slope, _ = bounds(formation.nominal, heard, np.zeros((formation.dimension, formation.dimension)))
    error = tracking_error(position, formation.nominal, np.ones((1000, formation.agents), dtype=bool))
    feasible = graph.feasible(up, links.src, links.dst, formation.nominal)
    np.testing.assert_array_equal(np.isfinite(slope), feasible & (heard & feasible[:, None, :]).any(axis=-1))
    assert below(psi, slope, error)


def test_theorem_1_holds_over_those_present():
    formation, rng = PRESETS["zhao7"], np.random.default_rng(1)
    present = np.broadcast_to(np.arange(7) != 4, (1000, 7))
    heard = graphs(rng, 1000, 7, 0.8)
    position = formation.nominal + np.where(present, 1.0, 100.0)[..., None] * rng.normal(size=(1000, 7, 2))
    among = heard & present[:, None, :] & present[:, :, None]
    slope, _ = bounds(formation.nominal, heard, NOWHERE, present=present)
    error = tracking_error(position, formation.nominal, present)
    psi = indicators(formation.nominal, position, among)
    assert np.isnan(slope[:, 4]).all()
    assert below(psi, slope, error)


def test_theorem_1_holds_where_other_edges_are_seen_than_heard():
    formation, rng = PRESETS["zhao7"], np.random.default_rng(1)
    heard, seen = graphs(rng, 1000, 7, 0.5), graphs(rng, 1000, 7, 0.5)
    position = formation.nominal + rng.normal(size=(1000, 7, 2))
    slope, _ = bounds(formation.nominal, heard, NOWHERE, seen)
    psi = indicators(formation.nominal, position, heard, seen)
    error = tracking_error(position, formation.nominal, np.ones((1000, 7), dtype=bool))
    assert below(psi, slope, error)


def noisy(position, heard, number=20_000):
    """Mean indicator over the noise, and its standard error, (N,) each."""
    formation = PRESETS["zhao7"]
    noise = np.random.default_rng(1).multivariate_normal([0, 0], R, size=(number, 7, 7))
    psi = indicators(formation.nominal, position, np.broadcast_to(heard, (number, 7, 7)), noise=noise)
    return psi.mean(axis=0), sem(psi, axis=0)


@pytest.mark.parametrize("seed", range(5))
def test_corollary_1_bounds_the_indicator_in_expectation_over_the_noise(seed):
    formation, rng = PRESETS["zhao7"], np.random.default_rng(seed)
    (heard,) = graphs(rng, 1, 7, 0.8)
    position = formation.nominal + 0.3 * rng.normal(size=(7, 2))
    mean, error = noisy(position, heard)
    slope, offset = bounds(formation.nominal, heard, R)
    delta = tracking_error(position, formation.nominal, np.ones(7, dtype=bool))
    defined = np.isfinite(slope)
    assert defined.sum() >= 4
    assert (mean - 4 * error <= slope * delta + offset)[defined].all()
    # The noise adds its part and no more: what is left is the indicator without it.
    quiet = indicators(formation.nominal, position, heard)
    assert (np.abs(mean - offset - quiet) < 4.5 * error)[defined].all()


def test_in_formation_the_indicator_is_the_offset_in_expectation():
    formation = PRESETS["zhao7"]
    (heard,) = graphs(np.random.default_rng(1), 1, 7, 1.0)
    mean, error = noisy(formation.nominal @ np.array([[2.0, 1.0], [0.0, 1.0]]) + 5.0, heard)
    _, offset = bounds(formation.nominal, heard, R)
    assert (np.abs(mean - offset) < 4.5 * error).all()


def test_bounds_by_hand():
    # Agents at 0, e1, e2, all heard and seen by 1 and 2; agent 3 hears nobody.
    nominal = np.array([[0.0, 0], [1, 0], [0, 1]])
    heard = np.array([[False, True, True], [True, False, True], [False, False, False]])
    slope, offset = bounds(nominal, heard, np.diag([1.0, 2.0]))
    # Theta_1 = [z_2 - z_1, z_3 - z_1] = Theta_2: two triangles of the same agents agree whatever they are.
    # H_1 H_1^T = I; H_2 has columns (1, 0), (1, -1): its inverse Gram is [[1, 1], [1, 2]]; traces 2 and 3, tr R = 3.
    np.testing.assert_allclose(slope, [0.0, 0.0, np.nan], atol=1e-12)
    np.testing.assert_allclose(offset, [15.0, 15.0, np.nan], atol=1e-12)


def test_an_agent_that_hears_only_the_infeasible_has_no_bound():
    nominal = np.array([[0.0, 0], [1, 0], [0, 1]])
    heard = np.array([[False, True, True], [True, False, False], [True, False, False]])
    assert np.isnan(bounds(nominal, heard, R)).all()
