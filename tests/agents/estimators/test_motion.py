"""Models of motion against filterpy, and against trajectories drawn from the models themselves."""

from itertools import product

import numpy as np
import pytest
from axes import of_axes
from briefs import REST, brief, silence
from filterpy.common import kinematic_kf
from filterpy.kalman import IMMEstimator, KalmanFilter

from agents.algebra import kalman
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.imm import InteractingMultipleModel
from agents.estimators.rkf import RelativeKalmanFilter
from analysis.metrics.consistency import band, nees

MODELS = list(kalman.ORDER)
NAMES = ["constant-acceleration", "constant-velocity", "random-walk"]  # as the IMM has them
DT = 0.1


def covariance(dimension):
    root = np.random.default_rng(dimension).normal(size=(dimension, dimension)) / 10
    return root @ root.T + 0.01 * np.eye(dimension)


def sequence(dimension, edges=4, ticks=80):
    """Measurements of wandering edges (ticks, edges, D), and which of them are made."""
    rng = np.random.default_rng(dimension)
    return rng.normal(size=(ticks, edges, dimension)).cumsum(axis=0), rng.random((ticks, edges)) < 0.5


def reference(F, Q, R, prior):
    """filterpy's filter of a position."""
    size, dimension = len(F), len(R)
    one = KalmanFilter(dim_x=size, dim_z=dimension)
    one.F, one.Q, one.R, one.P = F, Q, R, np.diag(np.square(prior))
    one.H = np.eye(dimension, size)
    return one


def written_out(model, dimension, sigma):
    """F and Q of a model, axis by axis."""
    F, g = {
        "random-walk": ([[1]], [DT]),
        "constant-velocity": ([[1, DT], [0, 1]], [DT**2 / 2, DT]),
        "constant-acceleration": ([[1, DT, DT**2 / 2], [0, 1, DT], [0, 0, 1]], [DT**2 / 2, DT, 1]),
    }[model]
    return np.kron(F, np.eye(dimension)), sigma**2 * np.kron(np.outer(g, g), np.eye(dimension))


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("model", MODELS)
def test_rkf_is_filterpys_filter_on_the_same_measurements_and_losses(model, dimension):
    measured, seen = sequence(dimension)
    R, order = covariance(dimension), kalman.ORDER[model]
    agent = brief(np.ones((4, dimension)), R)
    prior = np.repeat([5.0, 3.0, 2.0][:order], dimension)
    rkf = RelativeKalmanFilter(0.7, 5.0, 3.0, 2.0, model)
    state = rkf.init(agent, ())
    theirs = [reference(*written_out(model, dimension, 0.7), R, prior) for _ in range(4)]
    for y, here in zip(measured, seen, strict=True):
        state, _ = rkf.sense(agent, state, np.where(here[:, None], y, 0.0), here)
        _, estimate = rkf.fuse(agent, state, {}, REST)
        for edge, one in enumerate(theirs):
            one.predict()
            if here[edge]:
                one.update(y[edge])
            np.testing.assert_allclose(state.mean[edge], one.x[:, 0], atol=1e-10)
            np.testing.assert_allclose(state.covariance[edge], one.P, atol=1e-10)
    np.testing.assert_array_equal(estimate.relative, state.mean[:, :dimension])
    if model == "random-walk":
        assert estimate.relative_velocity is None
    else:
        np.testing.assert_array_equal(estimate.relative_velocity, state.mean[:, dimension : 2 * dimension])


@pytest.mark.parametrize(("model", "order"), [("constant-velocity", 1), ("constant-acceleration", 2)])
def test_transitions_are_those_of_filterpy(model, order):
    F, _ = of_axes(2, *kalman.motion(model, DT, 1.0))
    theirs = kinematic_kf(dim=2, order=order, dt=DT).F
    axis_first = np.arange(2 * (order + 1)).reshape(order + 1, 2).T.ravel()
    np.testing.assert_allclose(F[np.ix_(axis_first, axis_first)], theirs, atol=1e-15)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("filters", [RelativeKalmanFilter, GeometryAwareFilter])
def test_a_filter_tells_the_truth_of_what_moves_by_its_model(model, filters):
    edges, rng, R, order = 400, np.random.default_rng(1), covariance(2), kalman.ORDER[model]
    F, Q = of_axes(2, *kalman.motion(model, DT, 0.7))
    agent = brief(np.ones((edges, 2)), R)
    edge_filter = filters(sigma_w=0.7, prior_position=5.0, prior_velocity=3.0, prior_acceleration=2.0, model=model)
    state, quiet = edge_filter.init(agent, ()), silence(edges)
    x = rng.normal(size=(edges, 2 * order)) * np.repeat([5.0, 3.0, 2.0][:order], 2)
    low, high = band(0.999, 2, edges)
    for tick in range(60):
        x = x @ F.T + rng.multivariate_normal(np.zeros(2 * order), Q, size=edges)
        seen = rng.random(edges) < 0.6
        y = x[:, :2] + rng.multivariate_normal([0, 0], R, size=edges)
        state, _ = edge_filter.sense(agent, state, np.where(seen[:, None], y, 0.0), seen)
        state, estimate = edge_filter.fuse(agent, state, quiet, REST)
        if tick % 10 == 9:
            assert low < nees(x[:, :2] - estimate.relative, estimate.spread).mean() < high


@pytest.mark.parametrize("model", MODELS)
def test_a_model_in_a_state_of_three_derivatives_moves_as_it_does_alone(model):
    measured, seen = sequence(2)
    size, R = 2 * kalman.ORDER[model], covariance(2)
    prior = np.broadcast_to(np.diag([25.0, 25, 9, 9, 4, 4]), (4, 6, 6))
    alone, three = (np.zeros((4, size)), prior[:, :size, :size]), (np.zeros((4, 6)), prior)
    for y, here in zip(measured, seen, strict=True):
        alone = kalman.predict(*alone, *kalman.motion(model, DT, 0.7))
        three = kalman.predict(*three, *kalman.embedded(model, DT, 0.7))
        alone, three = (kalman.correct(*tracks, y, R, here)[:2] for tracks in (alone, three))
        np.testing.assert_allclose(three[0][:, :size], alone[0], atol=1e-10)
        np.testing.assert_allclose(three[1][:, :size, :size], alone[1], atol=1e-10)


# Interacting multiple models


def their_imm(dimension, R, prior, sigmas, stay):
    filters = [
        reference(*of_axes(dimension, *kalman.embedded(name, DT, sigma)), R, prior)
        for name, sigma in zip(NAMES, sigmas, strict=True)
    ]
    chain = np.where(np.eye(3, dtype=bool), stay, (1 - stay) / 2)
    return IMMEstimator(filters, np.full(3, 1 / 3), chain)


def lose(imm):
    """What filterpy leaves out when there is no measurement: the Markov chain goes on."""
    imm.mu = imm.cbar.copy()
    imm._compute_mixing_probabilities()
    imm._compute_state_estimate()


@pytest.mark.parametrize("availability", [1.0, 0.5])
@pytest.mark.parametrize("dimension", [2, 3])
def test_imm_is_filterpys_on_the_same_measurements_and_losses(dimension, availability):
    measured, _ = sequence(dimension)
    measured = measured / 10
    seen = np.random.default_rng(1).random(measured.shape[:2]) < availability
    R, sigmas = covariance(dimension), (0.7, 0.9, 2.0)
    agent = brief(np.ones((4, dimension)), R)
    imm = InteractingMultipleModel(0.9, *sigmas, 5.0, 3.0, 2.0)
    state = imm.init(agent, ())
    theirs = [their_imm(dimension, R, np.repeat([5.0, 3.0, 2.0], dimension), sigmas, 0.9) for _ in range(4)]
    for y, here in zip(measured, seen, strict=True):
        state, _ = imm.sense(agent, state, np.where(here[:, None], y, 0.0), here)
        _, estimate = imm.fuse(agent, state, {}, REST)
        for edge, one in enumerate(theirs):
            one.predict()
            if here[edge]:
                one.update(y[edge])
            else:
                lose(one)
            np.testing.assert_allclose(state.probability[edge], one.mu, atol=1e-10)
            np.testing.assert_allclose(estimate.relative[edge], one.x[:dimension, 0], atol=1e-10)
            np.testing.assert_allclose(
                estimate.relative_velocity[edge], one.x[dimension : 2 * dimension, 0], atol=1e-10
            )
            np.testing.assert_allclose(estimate.covariance[edge], one.P[:dimension, :dimension], atol=1e-10)
    assert state.probability.std() > 0.01
    assert np.isnan(estimate.psi)


def flown(positions, imm, R, seen=None):
    """The probabilities of the models (ticks, edges, 3) over positions (ticks, edges, 2)."""
    edges = positions.shape[1]
    agent, told = brief(np.ones((edges, 2)), R), []
    state, rng = imm.init(agent, ()), np.random.default_rng(2)
    for tick, place in enumerate(positions):
        here = np.ones(edges, dtype=bool) if seen is None else seen[tick]
        y = place + rng.multivariate_normal([0, 0], R, size=edges)
        state, _ = imm.sense(agent, state, np.where(here[:, None], y, 0.0), here)
        told.append(state.probability)
    return np.array(told)


def test_imm_finds_the_model_an_edge_moves_by_and_that_it_changes():
    rng, edges = np.random.default_rng(1), 50
    steady = np.cumsum(np.full((100, edges, 2), 0.2), axis=0)
    erratic = steady[-1] + np.cumsum(0.2 * rng.normal(size=(100, edges, 2)), axis=0)
    imm = InteractingMultipleModel(0.98, 0.5, 0.1, 2.0)
    told = flown(np.concatenate([steady, erratic]), imm, 1e-4 * np.eye(2)).mean(axis=1)
    assert told[50:100, 1].min() > 0.8
    assert told[120:, 2].min() > 0.8
    np.testing.assert_allclose(told.sum(axis=-1), 1.0)


def test_unseen_the_models_of_an_edge_are_forgotten_at_the_rate_of_the_chain():
    seen = np.arange(60)[:, None] < 30
    imm = InteractingMultipleModel(0.9)
    told = flown(np.cumsum(np.full((60, 1, 2), 0.2), axis=0), imm, 1e-4 * np.eye(2), seen)[:, 0]
    before = told[29]
    for tick in range(30, 60):
        before = before @ np.where(np.eye(3, dtype=bool), 0.9, 0.05)
        np.testing.assert_allclose(told[tick], before, atol=1e-12)


@pytest.mark.parametrize("far", [1e3, 1e150])
def test_a_measurement_far_from_every_model_leaves_probabilities(far):
    told = flown(np.array([[[0.0, 0]], [[0, 0]], [[far, 0]]]), InteractingMultipleModel(), 1e-4 * np.eye(2))
    np.testing.assert_allclose(told.sum(axis=-1), 1.0)


def test_imm_does_not_know_an_edge_before_it_was_seen_once_and_is_set_by_its_first_measurement():
    agent, imm = brief([[1, 0], [0, 1]], 1e-4 * np.eye(2)), InteractingMultipleModel()
    seen = np.array([True, False])
    state, _ = imm.sense(agent, imm.init(agent, ()), np.array([[3.0, -4.0], [0, 0]]), seen)
    _, estimate = imm.fuse(agent, state, {}, REST)
    np.testing.assert_array_equal(estimate.known, seen)
    np.testing.assert_allclose(estimate.relative[0], [3.0, -4.0], atol=1e-4)


@pytest.mark.parametrize("stay", [0.0, 1.0, 1.5])
def test_imm_refuses_a_probability_that_makes_no_chain(stay):
    with pytest.raises(ValueError, match="strictly between 0 and 1"):
        InteractingMultipleModel(stay)


def test_models_and_sigmas_are_told_apart():
    pairs = list(product(MODELS, (0.5, 1.0)))
    assert len({kalman.motion(model, DT, sigma)[1].tobytes() for model, sigma in pairs}) == len(pairs)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_tick_in_one_go_is_to_predict_and_then_to_correct_to_the_bit(model, dimension):
    F, Q = kalman.motion(model, DT, 0.7)
    apart = whole = kalman.unknown((4,), dimension, (10.0, 2.0, 1.0)[: kalman.ORDER[model]])
    for y, made in zip(*sequence(dimension), strict=True):
        *apart, surprise = kalman.correct(*kalman.predict(*apart, F, Q), y, covariance(dimension), made)
        *whole, nis = kalman.tracked(*whole, F, Q, y, covariance(dimension), made)
        pairs = zip((*apart, surprise), (*whole, nis), strict=True)
        assert all(one.tobytes() == other.tobytes() for one, other in pairs)
