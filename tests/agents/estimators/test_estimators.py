"""Every estimator against its formula, a textbook, or a case worked out by hand."""

import numpy as np
import pytest
from axes import of_axes
from briefs import HEXA4, OCTAHEDRON, REST, brief, hears, only, silence, swarm
from hypothesis import given, settings
from hypothesis import strategies as st

from agents.algebra import geometry, kalman
from agents.algebra.constraints import MAPS
from agents.estimators.conral import ConsensusLocalization
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.imm import InteractingMultipleModel
from agents.estimators.joint_kf import JointEdgeFilter
from agents.estimators.mmse import MinimumMeanSquareError
from agents.estimators.none import NoEstimator
from agents.estimators.ral import THETA, RelativeAffineLocalization
from agents.estimators.rkf import RelativeKalmanFilter
from analysis.models import small
from world.formation.nominal import PRESETS

R = np.array([[0.01, 0.003], [0.003, 0.02]])
AFFINE = MAPS["affine"]


# No estimator


def test_none_says_what_is_measured_and_nothing_else():
    y, seen = np.array([[1.0, 2.0], [0.0, 0.0]]), np.array([True, False])
    four, none = brief([[1, 0], [0, 1]], R), NoEstimator()
    state, said = none.sense(four, none.init(four, ()), y, seen)
    _, estimate = none.fuse(four, state, {}, REST)
    assert said == {}
    np.testing.assert_array_equal(estimate.relative, y)
    np.testing.assert_array_equal(estimate.known, seen)
    np.testing.assert_array_equal(estimate.covariance, [R, R])
    assert np.isnan(estimate.psi)


# Relative affine localization

numbers = st.floats(-5, 5).filter(lambda x: abs(x) > 1e-6 or x == 0)


@pytest.mark.parametrize("relative", [HEXA4, np.ones(3) - OCTAHEDRON], ids=["plane", "space"])
@settings(deadline=None, derandomize=True, database=None, max_examples=100)
@given(data=st.data())
def test_ral_is_exact_on_affine_formations_wherever_it_is_feasible(relative, data):
    n, dimension = relative.shape
    theta = np.array(data.draw(st.lists(numbers, min_size=dimension**2, max_size=dimension**2)))
    seen = np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n)))
    z = relative @ theta.reshape(dimension, dimension).T
    ral, agent = RelativeAffineLocalization(), brief(relative)
    state, said = ral.sense(agent, ral.init(agent, ()), np.where(seen[:, None], z, 0.0), seen)
    _, estimate = ral.fuse(agent, state, silence(n, dimension), REST)
    if np.linalg.matrix_rank(relative[seen]) == dimension:
        assert said[THETA]["feasible"]
        np.testing.assert_allclose(said[THETA]["local"].ravel(), theta, atol=1e-9)
        np.testing.assert_allclose(estimate.relative, z, atol=1e-9)
        assert estimate.known.all()
    else:
        assert not said[THETA]["feasible"]
        np.testing.assert_array_equal(estimate.known, seen)
        np.testing.assert_array_equal(estimate.relative[seen], z[seen])


def test_ral_is_infeasible_when_the_neighbours_are_nominally_on_a_line_whatever_is_measured():
    on_a_line = [[1, 1], [2, 2], [-3, -3]]
    fit = AFFINE.fit(np.array(on_a_line, float), np.array([[1.0, 0], [0, 1], [5, -2]]), np.ones(3, dtype=bool))
    assert not fit.feasible
    np.testing.assert_array_equal(fit.theta, np.zeros((2, 2)))


def test_ral_is_infeasible_when_the_neighbours_are_nominally_in_a_plane_of_space():
    in_a_plane = np.array([[1.0, 0, 1], [0, 1, 1], [1, 1, 2], [2, -1, 1]])
    measured = np.random.default_rng(1).normal(size=(4, 3))
    assert not AFFINE.fit(in_a_plane, measured, np.ones(4, dtype=bool)).feasible


def test_ral_is_feasible_when_the_formation_itself_has_collapsed_to_a_line():
    collapsed = np.array([[-1.375, -0.375], [0.0, 0.0]])
    seen = only(6, 1, 4)
    fit = AFFINE.fit(HEXA4, np.where(seen[:, None], HEXA4 @ collapsed.T, 0.0), seen)
    assert fit.feasible
    np.testing.assert_allclose(fit.theta, collapsed, atol=1e-12)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_feasibility_does_not_depend_on_the_size_of_the_formation(scale):
    assert geometry.regular(geometry.gram(scale * HEXA4, only(6, 0, 1)))
    assert not geometry.regular(geometry.gram(scale * HEXA4, only(6, 0, 3)))


def test_covariance_of_the_geometric_estimate_is_that_of_its_scatter():
    seen = only(6, 0, 1, 2)
    rng = np.random.default_rng(1)
    noise = rng.multivariate_normal([0, 0], R, size=(100_000, 3))
    measured = np.zeros((100_000, 6, 2))
    measured[:, seen] = HEXA4[seen] + noise
    fit = AFFINE.fit(HEXA4, measured, np.broadcast_to(seen, (100_000, 6)))
    said = AFFINE.covariance(geometry.Fit(*(part[0] for part in fit)), HEXA4, R)
    scatter = (HEXA4 @ np.swapaxes(fit.theta, -1, -2))[:, ~seen]
    for edge, expected in zip(range(3), said[~seen], strict=True):
        assert np.linalg.norm(np.cov(scatter[:, edge].T) - expected) < 0.03 * np.linalg.norm(expected)


def test_covariance_of_the_geometric_estimate_by_hand():
    # H = [[1, 0], [0, 2]]: (H H^T)^-1 = diag(1, 1/4), so the edge (3, 2) has 9 + 1 times R.
    H = np.array([[1.0, 0.0], [0.0, 2.0]])
    fit = AFFINE.fit(H, H, np.array([True, True]))
    np.testing.assert_allclose(AFFINE.covariance(fit, np.array([[3.0, 2.0]]), R), [10 * R])


def test_ral_keeps_measured_edges_as_measured():
    seen = only(6, 0, 1, 2, 4)
    y = np.where(seen[:, None], HEXA4 + np.random.default_rng(1).normal(size=(6, 2)), 0.0)
    ral, agent = RelativeAffineLocalization(), brief(HEXA4, R)
    state, said = ral.sense(agent, ral.init(agent, ()), y, seen)
    _, estimate = ral.fuse(agent, state, silence(6), REST)
    np.testing.assert_array_equal(estimate.relative[seen], y[seen])
    np.testing.assert_array_equal(estimate.covariance[seen], np.broadcast_to(R, (4, 2, 2)))
    np.testing.assert_allclose(estimate.relative[~seen], HEXA4[~seen] @ said[THETA]["local"].T, atol=1e-12)


def test_ral_knows_no_edge_of_a_padded_slot():
    padded = brief(np.concatenate([HEXA4, np.zeros((2, 2))]))
    seen = only(8, 0, 1)
    ral = RelativeAffineLocalization()
    state, _ = ral.sense(padded, ral.init(padded, ()), np.where(seen[:, None], padded.relative, 0.0), seen)
    _, estimate = ral.fuse(padded, state, silence(8), REST)
    np.testing.assert_array_equal(estimate.known, only(8, *range(6)))


# The convergence indicator

# Maps of the neighbours of an agent whose own is the identity: 5 and 9 away, and far.
THEIRS = np.array([[[2, 2], [0, 1]], [[1, 0], [3, 1]], [[99, 0], [0, 99]], [[999, 0], [0, 999]]], dtype=float)


def indicator(fresh, feasible, own_seen=(0, 1)):
    seen, agent = only(4, *own_seen), brief([[1, 0], [0, 1], [1, 1], [1, 2]])
    ral = RelativeAffineLocalization()
    state, _ = ral.sense(agent, ral.init(agent, ()), np.where(seen[:, None], agent.relative, 0.0), seen)
    return ral.fuse(agent, state, hears(only(4, *fresh), local=THEIRS, feasible=only(4, *feasible)), REST)[1].psi


def test_indicator_is_the_mean_squared_distance_of_the_neighbours_maps():
    assert indicator(fresh=(0, 1), feasible=(0, 1)) == pytest.approx((5 + 9) / 2)


def test_indicator_counts_only_neighbours_that_were_heard():
    assert indicator(fresh=(1,), feasible=(0, 1, 2, 3)) == pytest.approx(9)


def test_indicator_counts_only_neighbours_that_are_feasible():
    assert indicator(fresh=(0, 1, 2, 3), feasible=(0,)) == pytest.approx(5)


def test_indicator_is_undefined_when_no_neighbour_counts():
    assert np.isnan(indicator(fresh=(), feasible=(0, 1, 2, 3)))
    assert np.isnan(indicator(fresh=(2, 3), feasible=(0, 1)))


def test_indicator_is_undefined_when_the_agent_itself_is_not_feasible():
    assert np.isnan(indicator(fresh=(0, 1), feasible=(0, 1), own_seen=(0,)))


def test_indicator_is_zero_in_an_affine_formation():
    agents, links = swarm(PRESETS["zhao7"])
    theta = np.array([[0.3, 2.0], [-1.0, 0.7]])
    ral = RelativeAffineLocalization()
    state, said = ral.sense(agents, ral.init(agents, (7,)), agents.relative @ theta.T, links.present)
    heard = {name: field[links.neighbours] for name, field in said[THETA].items()}
    _, estimate = ral.fuse(agents, state, hears(links.present, **heard), REST)
    np.testing.assert_allclose(estimate.psi, 0.0, atol=1e-24)


# Consensus


def test_consensus_takes_one_step_of_eq_14():
    conral, agent = ConsensusLocalization(epsilon=0.1), brief([[1, 0], [0, 1], [1, 1]])
    theta = np.array([[2.0, 0.0], [0.0, 3.0]])
    seen = only(3, 0, 1)
    state, said = conral.sense(
        agent, conral.init(agent, ()), np.where(seen[:, None], agent.relative @ theta, 0.0), seen
    )
    np.testing.assert_allclose(said[THETA]["local"], theta)
    np.testing.assert_allclose(said[THETA]["consensus"], theta)
    # The first is heard, with a map of its own; the second is heard, and infeasible; the third is not heard.
    local, agreed = np.array([theta + 1, theta + 77, theta + 99]), np.array([theta + 2, theta + 4, theta + 99])
    heard = hears(only(3, 0, 1), local=local, feasible=only(3, 0, 2), consensus=agreed, started=only(3, 0, 1, 2))
    _, estimate = conral.fuse(agent, state, heard, REST)
    stepped = theta + 0.1 * ((2 + 4) + 1)
    np.testing.assert_allclose(estimate.relative, [[2, 0], [0, 3], stepped @ [1, 1]], atol=1e-12)


def test_conral_keeps_measured_edges_as_measured():
    seen = only(6, 0, 1, 2, 4)
    y = np.where(seen[:, None], HEXA4 + np.random.default_rng(1).normal(size=(6, 2)), 0.0)
    conral, agent = ConsensusLocalization(), brief(HEXA4, R)
    state, _ = conral.sense(agent, conral.init(agent, ()), y, seen)
    maps, yes = np.full((6, 2, 2), 5.0), np.ones(6, dtype=bool)
    _, estimate = conral.fuse(agent, state, hears(yes, local=maps, feasible=yes, consensus=maps, started=yes), REST)
    np.testing.assert_array_equal(estimate.relative[seen], y[seen])
    assert not np.allclose(estimate.relative[~seen], HEXA4[~seen], atol=0.5)


def consensus_error(epsilon, ticks=300):
    """Distance from the common map, when the first tick is seen through heavy noise and the rest through none."""
    agents, links = swarm(PRESETS["zhao7"])
    theta = np.array([[0.3, 2.0], [-1.0, 0.7]])
    exact = agents.relative @ theta.T
    conral = ConsensusLocalization(epsilon)
    state = conral.init(agents, (7,))
    for tick in range(ticks):
        noise = np.random.default_rng(1).normal(size=exact.shape) if tick == 0 else 0.0
        measured = np.where(links.present[..., None], exact + noise, 0.0)
        state, said = conral.sense(agents, state, measured, links.present)
        heard = {name: field[links.neighbours] for name, field in said[THETA].items()}
        state, _ = conral.fuse(agents, state, hears(links.present, **heard), REST)
    return np.abs(state.consensus.theta - theta).max()


def test_consensus_converges_to_the_common_map_at_epsilon_005():
    assert consensus_error(0.05, ticks=1) > 0.1
    assert consensus_error(0.05) < 1e-9


def test_consensus_diverges_at_epsilon_02():
    assert consensus_error(0.2) > 1e9


def test_an_agent_that_sees_too_little_adopts_what_its_neighbours_agree_on():
    conral, agent = ConsensusLocalization(), brief([[1, 0], [2, 0], [0, 3]])
    seen = only(3, 0)
    state, said = conral.sense(agent, conral.init(agent, ()), np.where(seen[:, None], [7.0, 7.0], 0.0), seen)
    assert not said[THETA]["started"]
    a, b = np.array([[1.0, 2.0], [3.0, 4.0]]), np.array([[3.0, 2.0], [1.0, 0.0]])
    maps = np.array([a, b, 99 * a])
    heard = hears(only(3, 0, 1), local=maps, feasible=only(3), consensus=maps, started=only(3, 0, 1, 2))
    state, estimate = conral.fuse(agent, state, heard, REST)
    np.testing.assert_allclose(estimate.relative, [[7, 7], (a + b) / 2 @ [2, 0], (a + b) / 2 @ [0, 3]])
    assert estimate.known.all()
    _, said = conral.sense(agent, state, np.zeros((3, 2)), only(3))
    assert said[THETA]["started"]
    np.testing.assert_allclose(said[THETA]["consensus"], (a + b) / 2)


def test_an_agent_that_nobody_tells_anything_knows_only_what_it_measures():
    conral, agent = ConsensusLocalization(), brief([[1, 0], [2, 0], [0, 3]])
    seen = only(3, 0)
    state, _ = conral.sense(agent, conral.init(agent, ()), np.where(seen[:, None], [7.0, 7.0], 0.0), seen)
    _, estimate = conral.fuse(agent, state, silence(3), REST)
    np.testing.assert_array_equal(estimate.known, seen)
    assert np.isnan(estimate.psi)


def test_consensus_outlasts_ticks_in_which_nothing_is_seen_or_heard():
    conral, agent = ConsensusLocalization(), brief(HEXA4)
    state, _ = conral.sense(agent, conral.init(agent, ()), HEXA4 @ [[2.0, 0], [0, 2]], np.ones(6, dtype=bool))
    for _ in range(5):
        state, estimate = conral.fuse(agent, state, silence(6), REST)
        state, _ = conral.sense(agent, state, np.zeros((6, 2)), np.zeros(6, dtype=bool))
    _, estimate = conral.fuse(agent, state, silence(6), REST)
    np.testing.assert_allclose(estimate.relative, 2 * HEXA4, atol=1e-12)


# Relative Kalman filter


def textbook(dimension, measured, seen, sigma_w, noise, prior):
    """A Kalman filter under intermittent observations, written out: means and covariances of every tick."""
    dt = 0.1
    A = np.array([[1, dt, dt**2 / 2], [0, 1, dt], [0, 0, 1]])
    g = np.array([[dt**2 / 2], [dt], [1]])
    F, Q = np.kron(A, np.eye(dimension)), sigma_w**2 * np.kron(g @ g.T, np.eye(dimension))
    G = np.hstack([np.eye(dimension), np.zeros((dimension, 2 * dimension))])
    x, P = np.zeros(3 * dimension), np.diag(np.repeat(prior, dimension)) ** 2.0
    for y, here in zip(measured, seen, strict=True):
        x, P = F @ x, F @ P @ F.T + Q
        if here:
            K = P @ G.T @ np.linalg.inv(noise + G @ P @ G.T)
            x, P = x + K @ (y - G @ x), (np.eye(3 * dimension) - K @ G) @ P
        yield x, P


@pytest.mark.parametrize("dimension", [2, 3])
def test_rkf_is_the_textbook_filter(dimension):
    rng = np.random.default_rng(dimension)
    root = rng.normal(size=(dimension, dimension)) / 10
    noise = root @ root.T + 0.01 * np.eye(dimension)
    measured, seen = rng.normal(size=(200, 4, dimension)).cumsum(axis=0), rng.random((200, 4)) < 0.5
    agent = brief(np.ones((4, dimension)), noise)
    rkf = RelativeKalmanFilter(sigma_w=0.7, prior_position=5.0, prior_velocity=3.0, prior_acceleration=2.0)
    state = rkf.init(agent, ())
    filters = [textbook(dimension, measured[:, n], seen[:, n], 0.7, noise, [5.0, 3.0, 2.0]) for n in range(4)]
    for y, here in zip(measured, seen, strict=True):
        state, _ = rkf.sense(agent, state, np.where(here[:, None], y, 0.0), here)
        state, estimate = rkf.fuse(agent, state, {}, REST)
        for n, (x, P) in enumerate(map(next, filters)):
            np.testing.assert_allclose(state.mean[n], x, atol=1e-10)
            np.testing.assert_allclose(state.covariance[n], P, atol=1e-10)
            np.testing.assert_array_equal(estimate.relative[n], state.mean[n, :dimension])
            np.testing.assert_array_equal(estimate.covariance[n], state.covariance[n, :dimension, :dimension])
            np.testing.assert_array_equal(estimate.relative_velocity[n], state.mean[n, dimension : 2 * dimension])


def test_transition_and_process_noise_are_those_of_eqs_20_and_21_axis_by_axis():
    F, Q = of_axes(2, *kalman.motion("constant-acceleration", 0.1, 3.0))
    x = [0, 2, 4]  # of the first axis: position, velocity, acceleration
    np.testing.assert_allclose(F[np.ix_(x, x)], [[1, 0.1, 0.005], [0, 1, 0.1], [0, 0, 1]])
    np.testing.assert_allclose(Q[np.ix_(x, x)], 9 * np.array([[25e-6, 5e-4, 5e-3], [5e-4, 0.01, 0.1], [5e-3, 0.1, 1]]))
    np.testing.assert_array_equal(F[np.ix_(x, [1, 3, 5])], np.zeros((3, 3)))
    np.testing.assert_array_equal(Q[np.ix_(x, [1, 3, 5])], np.zeros((3, 3)))


def test_rkf_coasts_at_constant_velocity_while_an_edge_is_lost():
    agent, rkf = brief([[1, 0]], 1e-6 * np.eye(2)), RelativeKalmanFilter(sigma_w=0.01)
    state, velocity = rkf.init(agent, ()), np.array([1.0, -2.0])
    for tick in range(300):
        state, _ = rkf.sense(agent, state, [[5.0, 5.0]] + 0.1 * tick * velocity, only(1, 0))
    spread = state.covariance[0, 0, 0]
    for tick in range(300, 320):
        state, _ = rkf.sense(agent, state, np.zeros((1, 2)), only(1))
        _, estimate = rkf.fuse(agent, state, {}, REST)
        np.testing.assert_allclose(estimate.relative, [[5.0, 5.0] + 0.1 * tick * velocity], atol=1e-3)
        assert estimate.known.all()
        assert estimate.covariance[0, 0, 0] > spread
        spread = estimate.covariance[0, 0, 0]
    np.testing.assert_allclose(estimate.relative_velocity, [velocity], atol=1e-3)


def test_rkf_does_not_know_an_edge_before_it_was_seen_once():
    agent, rkf = brief([[1, 0], [0, 1]]), RelativeKalmanFilter()
    state, _ = rkf.sense(agent, rkf.init(agent, ()), np.array([[1.0, 0.0], [0.0, 0.0]]), only(2, 0))
    np.testing.assert_array_equal(rkf.fuse(agent, state, {}, REST)[1].known, [True, False])


def test_rkf_is_set_by_its_first_measurement():
    agent, rkf = brief([[1, 0]], 1e-4 * np.eye(2)), RelativeKalmanFilter()
    state, _ = rkf.sense(agent, rkf.init(agent, ()), np.array([[3.0, -4.0]]), only(1, 0))
    np.testing.assert_allclose(rkf.fuse(agent, state, {}, REST)[1].relative, [[3.0, -4.0]], atol=1e-4)


# Geometry-aware filter


@pytest.mark.parametrize("shape", ["ral", "conral"])
def test_ga_rkf_is_rkf_when_nothing_is_lost(shape):
    agents, links = swarm(PRESETS["zhao7"])
    rkf, ga_rkf = RelativeKalmanFilter(sigma_w=0.7), GeometryAwareFilter(sigma_w=0.7, geometry=shape)
    tracks, fusion = rkf.init(agents, (7,)), ga_rkf.init(agents, (7,))
    rng = np.random.default_rng(1)
    for _ in range(50):
        y = np.where(links.present[..., None], agents.relative + 0.1 * rng.normal(size=agents.relative.shape), 0.0)
        tracks, _ = rkf.sense(agents, tracks, y, links.present)
        tracks, expected = rkf.fuse(agents, tracks, {}, REST)
        fusion, said = ga_rkf.sense(agents, fusion, y, links.present)
        heard = {name: field[links.neighbours] for name, field in said[THETA].items()}
        fusion, estimate = ga_rkf.fuse(agents, fusion, hears(links.present, **heard), REST)
        np.testing.assert_allclose(estimate.relative[links.present], expected.relative[links.present], atol=1e-9)
        np.testing.assert_allclose(estimate.covariance[links.present], expected.covariance[links.present], atol=1e-9)


@pytest.mark.parametrize("shape", ["ral", "conral"])
def test_ga_rkf_propagates_an_unseen_edge_while_psi_is_undefined(shape):
    agent, seen = brief(HEXA4), only(6, 0, 1, 2)
    rkf, ga_rkf = RelativeKalmanFilter(), GeometryAwareFilter(geometry=shape)
    tracks, fusion = rkf.init(agent, ()), ga_rkf.init(agent, ())
    for here in (np.ones(6, dtype=bool), seen, seen):
        y = np.where(here[:, None], HEXA4, 0.0)
        tracks, _ = rkf.sense(agent, tracks, y, here)
        fusion, _ = ga_rkf.sense(agent, fusion, y, here)
        fusion, estimate = ga_rkf.fuse(agent, fusion, silence(6), REST)
    assert np.isnan(estimate.psi)
    np.testing.assert_allclose(fusion.tracks.mean, tracks.mean, atol=1e-12)
    np.testing.assert_allclose(fusion.tracks.covariance, tracks.covariance, atol=1e-12)


def test_ga_rkf_does_not_know_an_unseen_edge_while_psi_is_undefined():
    agent, seen = brief(HEXA4), only(6, 0, 1, 2)
    ga_rkf = GeometryAwareFilter(geometry="ral")
    fusion, _ = ga_rkf.sense(agent, ga_rkf.init(agent, ()), np.where(seen[:, None], HEXA4, 0.0), seen)
    _, estimate = ga_rkf.fuse(agent, fusion, silence(6), REST)
    np.testing.assert_array_equal(estimate.known, seen)


def test_ga_rkf_corrects_an_unseen_edge_by_its_place_in_the_shape_trusted_by_psi():
    agent, seen = brief([[1, 0], [0, 1], [2, 1]], R), only(3, 0, 1)
    ga_rkf = GeometryAwareFilter(geometry="ral", sigma_w=0.7, prior_position=5.0, prior_velocity=3.0)
    y = np.where(seen[:, None], [[1.5, 0.2], [0.1, 2.0], [0, 0]], 0.0)
    fusion, said = ga_rkf.sense(agent, ga_rkf.init(agent, ()), y, seen)
    theirs = np.array([said[THETA]["local"] + [[0.3, 0], [0, 0.4]]] * 3)  # psi = 0.09 + 0.16
    _, estimate = ga_rkf.fuse(agent, fusion, hears(only(3, 1), local=theirs, feasible=only(3, 0, 1, 2)), REST)
    assert estimate.psi == pytest.approx(0.25)
    place, trust = 2 * y[0] + y[1], 5 * R + 0.25 * np.eye(2)  # p = (2, 1): leverage 4 + 1
    for edge, observed, noise in ((0, y[0], R), (1, y[1], R), (2, place, trust)):
        ((x, P),) = textbook(2, [observed], [True], 0.7, noise, [5.0, 3.0, 1.0])
        np.testing.assert_allclose(estimate.relative[edge], x[:2], atol=1e-10)
        np.testing.assert_allclose(estimate.covariance[edge], P[:2, :2], atol=1e-10)
    assert estimate.known.all()


# What all have in common

ESTIMATORS = [
    NoEstimator(),
    RelativeKalmanFilter(),
    RelativeAffineLocalization(),
    ConsensusLocalization(),
    GeometryAwareFilter(geometry="ral"),
    GeometryAwareFilter(geometry="conral"),
    RelativeAffineLocalization("scaling"),
    RelativeAffineLocalization("similarity"),
    ConsensusLocalization(constraint="rotation"),
    GeometryAwareFilter(constraint="similarity", penalty=False),
    RelativeKalmanFilter(model="random-walk"),
    InteractingMultipleModel(),
    MinimumMeanSquareError(),
    EdgeKalmanFilter(),
    JointEdgeFilter(),
]


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=str)
def test_fields_of_messages_that_did_not_arrive_change_nothing(estimator):
    agent, seen = brief(HEXA4), only(6, 0, 1, 2)
    state, said = estimator.sense(agent, estimator.init(agent, ()), np.where(seen[:, None], HEXA4, 0.0), seen)
    fields = {name: np.stack([field] * 6) for name, field in said.get(THETA, {}).items()}
    fresh = only(6, 1, 4)
    rubbish = {name: np.array(field) for name, field in fields.items()}
    for field in rubbish.values():
        field[~fresh] = np.where(field.dtype == bool, True, 1e3)
    flown = np.full((6, 2), 0.5)
    _, clean = estimator.fuse(agent, state, hears(fresh, flown, **fields), REST)
    _, littered = estimator.fuse(agent, state, hears(fresh, np.where(fresh[:, None], flown, 1e3), **rubbish), REST)
    np.testing.assert_array_equal(littered.relative, clean.relative)
    np.testing.assert_array_equal(littered.known, clean.known)
    np.testing.assert_array_equal(littered.psi, clean.psi)


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=str)
@pytest.mark.parametrize("dimension", [2, 3])
def test_what_is_said_has_the_shapes_announced(estimator, dimension):
    agent = brief(np.eye(dimension))
    state = estimator.init(agent, ())
    _, said = estimator.sense(agent, state, np.eye(dimension), np.ones(dimension, dtype=bool))
    announced = estimator.channels(agent)
    assert {c: set(fields) for c, fields in said.items()} == {c: set(fields) for c, fields in announced.items()}
    for channel, fields in announced.items():
        for name, field in fields.items():
            assert np.shape(said[channel][name]) == field.shape
            assert np.asarray(said[channel][name]).dtype == field.dtype


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=str)
def test_an_estimator_leaves_what_it_is_given_as_it_was(estimator):
    agent, seen = brief(HEXA4), only(6, 0, 1, 2)
    measured = np.where(seen[:, None], HEXA4, 0.0)
    given, state = measured.copy(), estimator.init(agent, ())
    for _ in range(3):
        state, _ = estimator.sense(agent, state, measured, seen)
        state, _ = estimator.fuse(agent, state, silence(6), REST)
    np.testing.assert_array_equal(measured, given)
    np.testing.assert_array_equal(seen, only(6, 0, 1, 2))


@pytest.mark.parametrize("dimension", [2, 3])
def test_inverses_and_determinants_of_small_matrices_are_those_of_lapack(dimension):
    matrices = np.random.default_rng(1).normal(size=(50, dimension, dimension))
    np.testing.assert_allclose(small.inverse(matrices), np.linalg.inv(matrices), rtol=1e-9)
    np.testing.assert_allclose(small.determinant(matrices), np.linalg.det(matrices), rtol=1e-9)
