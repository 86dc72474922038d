"""Filters of edges that move as inputs say, and filters without a model, against filterpy, textbooks and cases by hand."""

from dataclasses import replace

import numpy as np
import pytest
from briefs import HEXA4, REST, brief, hears, only
from filterpy.kalman import KalmanFilter
from offered import by_affinet

from affinet.planning.making import make
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from agents.algebra.unknowns import Belief, EdgeModel
from agents.brief import Own
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.joint_kf import JointEdgeFilter, corrected
from agents.estimators.mmse import MinimumMeanSquareError
from agents.estimators.none import NoEstimator
from agents.exchange import Heard
from netem.core.links import Links
from world.formation.nominal import PRESETS

DT = 0.1  # of the briefs
BOTH = pytest.mark.parametrize("kind", [EdgeKalmanFilter, JointEdgeFilter])
SPACES = pytest.mark.parametrize("dimension", [2, 3])


def positive(size, seed):
    """A covariance without zeros."""
    root = np.random.default_rng(seed).normal(size=(size, size))
    return 0.01 * (root @ root.T / size + 0.1 * np.eye(size))


def block(dimension, edge):
    """Where an edge stands in a joint covariance."""
    return slice(dimension * edge, dimension * (edge + 1))


def apart(covariance, dimension):
    """A joint covariance whose edges say nothing of each other."""
    edges = len(covariance) // dimension
    return covariance * np.kron(np.eye(edges), np.ones((dimension, dimension)))


def flight(dimension, edges=4, ticks=100, availability=0.6):
    """Measurements, which of them are made, and what the agent and its neighbours fly."""
    rng = np.random.default_rng(dimension)
    measured = rng.normal(size=(ticks, edges, dimension)).cumsum(axis=0) / 10
    seen = rng.random((ticks, edges)) < availability
    own, theirs = rng.normal(size=(ticks, dimension)), rng.normal(size=(ticks, edges, dimension))
    return zip(np.where(seen[..., None], measured, 0.0), seen, own, theirs, strict=True)


def tick(filters, agent, state, y, seen, own, theirs, fresh=None):
    """The filters after a tick in which these measurements and inputs came in."""
    state, _ = filters.sense(agent, state, y, seen)
    heard = hears(np.ones(len(seen), dtype=bool) if fresh is None else fresh, theirs)
    return filters.fuse(agent, state, heard, Own(own, own))


def agent_of(dimension, process=None, edges=4):
    return brief(np.ones((edges, dimension)), positive(dimension, 7), process)


# Edge by edge


@SPACES
def test_edge_kf_is_filterpys_filter_on_the_same_measurements_losses_and_inputs(dimension):
    agent, filters = agent_of(dimension, positive(4 * dimension, 3)), EdgeKalmanFilter(prior_position=1.5)
    state, theirs = filters.init(agent, ()), []
    for edge in range(4):
        one = KalmanFilter(dim_x=dimension, dim_z=dimension, dim_u=2 * dimension)
        one.B = DT * np.hstack([np.eye(dimension), -np.eye(dimension)])
        one.Q = agent.process[block(dimension, edge), block(dimension, edge)]
        one.H, one.R, one.P = np.eye(dimension), agent.sensor.covariance, 2 * 1.5**2 * np.eye(dimension)
        theirs.append(one)
    for y, seen, own, said in flight(dimension):
        state, estimate = tick(filters, agent, state, y, seen, own, said)
        for edge, one in enumerate(theirs):
            one.predict(u=np.concatenate([own, said[edge]])[:, None])
            if seen[edge]:
                one.update(y[edge])
            np.testing.assert_allclose(estimate.relative[edge], one.x[:, 0], atol=1e-10)
            np.testing.assert_allclose(estimate.covariance[edge], one.P, atol=1e-10)
    assert estimate.known.all()
    assert np.isnan(estimate.psi)


def test_at_first_an_edge_is_nowhere_twice_as_uncertain_as_an_agent():
    agent = agent_of(2)
    state = EdgeKalmanFilter(prior_position=1.5).init(agent, (3,))
    mean, covariance = state.edges.belief.edges
    np.testing.assert_array_equal(mean, np.zeros((3, 4, 2)))
    np.testing.assert_allclose(covariance, np.broadcast_to(4.5 * np.eye(2), (3, 4, 2, 2)))


def test_at_first_joint_edges_share_the_uncertainty_of_the_agent_itself():
    state = JointEdgeFilter(prior_position=1.5).init(agent_of(2, edges=2), ())
    mean, covariance = state.edges.edges
    np.testing.assert_array_equal(mean, np.zeros(4))
    own = 2.25 * np.eye(2)
    np.testing.assert_allclose(covariance, np.block([[2 * own, own], [own, 2 * own]]))


@SPACES
@BOTH
def test_an_edge_that_is_not_measured_moves_as_its_ends_fly_and_becomes_less_certain(kind, dimension):
    agent, filters = agent_of(dimension, positive(4 * dimension, 3)), kind()
    state, *_ = tick(filters, agent, filters.init(agent, ()), *next(flight(dimension, availability=1.0)))
    before, spread = state.edges.belief.edges if kind is EdgeKalmanFilter else state.edges.edges
    before, nothing = before.reshape(4, dimension), np.zeros(4, dtype=bool)
    own, theirs = np.arange(1.0, dimension + 1), np.random.default_rng(1).normal(size=(4, dimension))
    state, estimate = tick(filters, agent, state, np.zeros((4, dimension)), nothing, own, theirs)
    np.testing.assert_allclose(estimate.relative, before + DT * (own - theirs), atol=1e-15)
    for edge in range(4):
        here = block(dimension, edge)
        old = spread[edge] if kind is EdgeKalmanFilter else spread[here, here]
        np.testing.assert_allclose(estimate.covariance[edge], old + agent.process[here, here], atol=1e-15)


# All edges of an agent together


@SPACES
def test_joint_kf_is_edge_kf_when_its_edges_say_nothing_of_each_other(dimension):
    agent = agent_of(dimension)
    single, joint = EdgeKalmanFilter(), JointEdgeFilter()
    one, all_edges = single.init(agent, ()), joint.init(agent, ())
    belief = all_edges.edges
    all_edges = all_edges._replace(edges=belief._replace(covariance=apart(belief.covariance, dimension)))
    for now in flight(dimension):
        one, expected = tick(single, agent, one, *now)
        all_edges, estimate = tick(joint, agent, all_edges, *now)
        np.testing.assert_allclose(estimate.relative, expected.relative, atol=1e-9)
        np.testing.assert_allclose(estimate.covariance, expected.covariance, atol=1e-9)
    np.testing.assert_array_equal(estimate.known, expected.known)


def last_of(kind, agent, ticks):
    filters, told = kind(), []
    state = filters.init(agent, ())
    for now in flight(2, ticks=ticks, availability=1.0):
        state, estimate = tick(filters, agent, state, *now)
        told.append(estimate)
    return told[0], told[-1]


def test_joint_kf_forgets_its_prior_and_comes_to_the_steady_state_of_edge_kf():
    agent = agent_of(2, apart(positive(8, 3), 2))
    (first, last), (joint_first, joint_last) = (
        last_of(kind, agent, 100) for kind in (EdgeKalmanFilter, JointEdgeFilter)
    )
    assert np.abs(joint_first.relative - first.relative).max() > 1e-4
    np.testing.assert_allclose(joint_last.relative, last.relative, atol=1e-9)
    np.testing.assert_allclose(joint_last.covariance, last.covariance, atol=1e-12)


def test_without_disturbances_the_advantage_of_joint_kf_dies_away_as_one_over_ticks_squared():
    agent = agent_of(2)
    gaps, moves = [], []
    for ticks in (200, 800):
        (_, last), (_, joint) = (last_of(kind, agent, ticks) for kind in (EdgeKalmanFilter, JointEdgeFilter))
        np.testing.assert_allclose(
            ticks * joint.covariance, np.stack([agent.sensor.covariance] * 4), rtol=0.01, atol=1e-5
        )
        gaps.append(np.trace(last.covariance - joint.covariance, axis1=-2, axis2=-1).sum())
        moves.append(np.abs(last.relative - joint.relative).max())
    assert gaps[0] / gaps[1] == pytest.approx(16, rel=0.02)
    assert moves[1] < moves[0] < 1e-3


def test_joint_kf_is_surer_than_edge_kf_when_disturbances_are_shared():
    # The agent is pushed, and with it all of its edges.
    agent = agent_of(2, np.kron(np.ones((4, 4)) + np.eye(4), 0.01 * np.eye(2)))
    (_, last), (_, joint) = (last_of(kind, agent, 100) for kind in (EdgeKalmanFilter, JointEdgeFilter))
    gain = np.linalg.eigvalsh(last.covariance - joint.covariance)
    assert gain.min() > 1e-5


@SPACES
def test_joint_kf_is_the_textbook_filter_with_the_rows_of_unseen_edges_taken_out(dimension):
    size = 4 * dimension
    agent, joint = agent_of(dimension, positive(size, 3)), JointEdgeFilter(prior_position=1.5)
    state = joint.init(agent, ())
    x, P = np.zeros(size), state.edges.covariance
    for y, seen, own, theirs in flight(dimension):
        state, estimate = tick(joint, agent, state, y, seen, own, theirs)
        x, P = x + DT * (own - theirs).ravel(), P + agent.process
        if seen.any():
            H = np.eye(size)[np.repeat(seen, dimension)]
            R = np.kron(np.eye(seen.sum()), agent.sensor.covariance)
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ (y[seen].ravel() - H @ x), (np.eye(size) - K @ H) @ P
        np.testing.assert_allclose(estimate.relative.ravel(), x, atol=1e-10)
        np.testing.assert_allclose(state.edges.covariance, P, atol=1e-10)
    for edge in range(4):
        np.testing.assert_array_equal(
            estimate.covariance[edge], state.edges.covariance[block(dimension, edge)][:, block(dimension, edge)]
        )


def test_what_one_edge_shows_moves_an_edge_that_is_not_measured():
    agent, joint = agent_of(2, edges=2), JointEdgeFilter(prior_position=1.0)
    _, estimate = tick(joint, agent, joint.init(agent, ()), np.array([[3.0, 0], [0, 0]]), only(2, 0), *np.zeros((2, 2)))
    # They share the agent's own position, with half of the variance of an edge.
    np.testing.assert_allclose(estimate.relative[1], estimate.relative[0] / 2, atol=1e-12)
    assert estimate.relative[0, 0] > 2.9


def test_the_gains_of_joint_kf_are_the_best_block_diagonal_gain_of_all_agents_together():
    links, rng = Links.both_ways(10, PRESETS["hexa10"].edges), np.random.default_rng(5)
    degrees = links.present.sum(axis=1)
    size, R = 2 * degrees.sum(), positive(2, 7)
    prior, noise = 100 * positive(size, 1), np.kron(np.eye(degrees.sum()), R)
    blocks = np.split(np.arange(size), 2 * degrees.cumsum()[:-1])

    def joseph(gain):
        left = np.eye(size) - gain
        return ((gain @ noise) * gain).sum() + ((left @ prior) * left).sum()

    best, own_posteriors = np.zeros((size, size)), 0.0
    for rows in blocks:
        edges = len(rows) // 2
        local, seen = prior[np.ix_(rows, rows)], np.ones(edges, dtype=bool)
        each = np.kron(np.eye(edges), R)
        # From the estimate of zero, what unit measurements move are the columns of the gain.
        for column, y in zip(rows, np.eye(2 * edges), strict=True):
            after = corrected(Belief(np.zeros((1, 2 * edges)), local), y, each, seen)
            best[rows, column] = after.mean[0]
        own_posteriors += np.trace(after.covariance)
    least = joseph(best)
    assert own_posteriors == pytest.approx(least, rel=1e-9)
    free = np.zeros((size, size), dtype=bool)
    for rows in blocks:
        free[np.ix_(rows, rows)] = True
    sizes = 10 ** rng.uniform(-4, 0, size=1000)
    worse = []
    for scale in sizes:
        other = best.copy()
        other[free] += scale * rng.normal(size=free.sum())
        worse.append(joseph(other))
    assert min(worse) > least
    # Not block-diagonal, it could be better: the blocks are a restriction.
    assert joseph(prior @ np.linalg.inv(prior + noise)) < least


# What neighbours flew


U = np.array([[2.0, -1.0], [3.0, 5.0]])
NOBODY = np.zeros(2, dtype=bool)


class Inputs:
    """What two neighbours of an agent that sees nothing are believed to fly, of whom some are heard in every tick."""

    def __init__(self, coefficients, sigma):
        self.model, self.nothing = EdgeModel(DT, tuple(coefficients), sigma, 0.0), np.zeros((2, 2))
        self.belief = self.model.begin(self.nothing, self.nothing, (2,))

    def after(self, inputs=0 * U, heard=NOBODY):
        belief = self.model.ahead(self.belief, self.nothing)
        known = np.broadcast_to(np.array(heard)[:, None], (2, 2))
        self.belief = self.model.hear(belief, np.where(known, inputs, 99.0), known)
        return self

    @property
    def last(self):
        mean, covariance = self.belief
        doubt = covariance[:, 2:4, 2:4] if covariance.shape[-1] > 2 else np.zeros((2, 2, 2))
        return mean[:, 1], doubt


ALL = np.ones(2, dtype=bool)


@pytest.mark.parametrize("coefficients", [(), (1.0,), (0.8, -0.1)])
def test_inputs_that_are_heard_are_known(coefficients):
    last, doubt = Inputs(coefficients, 0.5).after().after(U, ALL).last
    np.testing.assert_array_equal(last, U)
    np.testing.assert_array_equal(doubt, np.zeros((2, 2, 2)))


def test_who_is_heard_does_not_matter_to_another():
    last, doubt = Inputs((0.5,), 0.1).after(U, ALL).after(U + 1, [True, False]).last
    np.testing.assert_array_equal(last, [U[0] + 1, U[1] / 2])
    np.testing.assert_allclose(doubt, [np.zeros((2, 2)), 0.01 * np.eye(2)], atol=1e-16)


def test_losses_in_a_row_draw_the_input_to_rest_and_add_up_their_doubt():
    a, sigma = 0.9, 0.2
    flown = Inputs((a,), sigma).after(U, ALL)
    for losses, variance in ((1, 0.04), (2, 0.04 * (1 + 0.81)), (3, 0.04 * (1 + 0.81 + 0.6561))):
        last, doubt = flown.after().last
        np.testing.assert_allclose(last, a**losses * U)
        np.testing.assert_allclose(doubt, np.broadcast_to(variance * np.eye(2), (2, 2, 2)), atol=1e-16)
    np.testing.assert_array_equal(flown.after(U, ALL).last[1], np.zeros((2, 2, 2)))


@pytest.mark.parametrize("sigma", [0.0, 0.3])
def test_the_last_input_is_held_by_a_coefficient_of_one(sigma):
    flown = Inputs((1.0,), sigma).after(U, ALL)
    for _ in range(5):
        flown.after()
    np.testing.assert_array_equal(flown.last[0], U)


def test_without_coefficients_who_is_not_heard_is_surely_at_rest():
    last, doubt = Inputs((), 0.5).after(U, ALL).after().last
    np.testing.assert_array_equal(last, np.zeros((2, 2)))
    np.testing.assert_array_equal(doubt, np.zeros((2, 2, 2)))


def test_a_model_of_order_two_remembers_two_ticks():
    flown = Inputs((0.5, 0.25), 0.2).after(U, ALL).after(4 * U, ALL).after()
    np.testing.assert_allclose(flown.last[0], (0.5 * 4 + 0.25) * U)
    np.testing.assert_allclose(flown.last[1], np.broadcast_to(0.04 * np.eye(2), (2, 2, 2)))
    flown.after()
    np.testing.assert_allclose(flown.last[0], (0.5 * 2.25 + 0.25 * 4) * U)
    np.testing.assert_allclose(flown.last[1], np.broadcast_to(0.04 * 1.25 * np.eye(2), (2, 2, 2)))


@pytest.mark.parametrize("a", [(0.9,), (1.9, -0.9), (0.5, 0.25), (1.2, -0.5, 0.25)])
def test_after_losses_in_a_row_inputs_are_as_wrong_as_they_say(a):
    """The doubt is that of the process driven so many times, whose inputs are correlated."""
    sigma, flown = 0.5, Inputs(a, 0.5).after(U, ALL)
    answers = [1.0]  # the input k ticks after a unit impulse
    for losses in range(1, 21):
        variance = sigma**2 * sum(answer**2 for answer in answers)
        np.testing.assert_allclose(flown.after().last[1], np.broadcast_to(variance * np.eye(2), (2, 2, 2)), rtol=1e-9)
        assert losses == len(answers)
        answers.append(sum(weight * answer for weight, answer in zip(a, answers[::-1], strict=False)))


def test_what_is_heard_says_something_of_what_was_lost_before():
    """The input lost was N(0, .04), the next .5 of it + N(0, .04): given that, .4 of it is expected, with .032 left."""
    last, doubt = Inputs((0.5, 0.25), 0.2).after().after(U, ALL).after().last
    np.testing.assert_allclose(last, (0.5 + 0.25 * 0.4) * U)
    np.testing.assert_allclose(doubt, np.broadcast_to((0.04 + 0.25**2 * 0.032) * np.eye(2), (2, 2, 2)))


@BOTH
def test_accelerations_are_refused(kind):
    agent, filters = brief(HEXA4), kind()
    rates = {"velocity": np.zeros((6, 2)), "acceleration": np.zeros((6, 2))}
    with pytest.raises(ValueError, match="for single integrators"):
        filters.fuse(agent, filters.init(agent, ()), {"input": Heard(rates, np.ones(6, dtype=bool))}, REST)


@BOTH
def test_an_input_that_is_lost_widens_the_edge_by_its_doubt_over_a_tick(kind):
    agent, filters = agent_of(2, positive(8, 3)), kind(coefficients=(0.9,), sigma_n=3.0)
    nothing, y = np.zeros(4, dtype=bool), np.zeros((4, 2))
    state = filters.init(agent, ())
    state, _ = tick(filters, agent, state, y, nothing, np.zeros(2), np.ones((4, 2)))
    all_heard, certain = tick(filters, agent, state, y, nothing, np.zeros(2), np.full((4, 2), 0.9))
    some_lost, doubtful = tick(filters, agent, state, y, nothing, np.zeros(2), np.full((4, 2), 0.9), only(4, 0, 2))
    np.testing.assert_allclose(doubtful.relative, certain.relative, atol=1e-15)
    widened = (doubtful.covariance - certain.covariance)[[0, 1, 2, 3]]
    lost = DT**2 * 9.0 * np.eye(2)  # (6.3); the printed algorithms leave dt^2 out
    np.testing.assert_allclose(widened, [0 * lost, lost, 0 * lost, lost], atol=1e-14)
    if kind is JointEdgeFilter:
        # Neighbours are driven each by itself: nothing is added between edges.
        widened = some_lost.edges.edges[1] - all_heard.edges.edges[1]
        np.testing.assert_allclose(apart(widened, 2), widened, atol=1e-14)


# Filters without a model of motion


@SPACES
def test_mmse_draws_the_measurement_toward_the_last_estimate(dimension):
    agent, mmse = agent_of(dimension), MinimumMeanSquareError(sigma_prior=0.2)
    state, x = mmse.init(agent, ()), np.zeros((4, dimension))
    weights = 0.04 * np.linalg.inv(0.04 * np.eye(dimension) + agent.sensor.covariance)
    for y, seen, own, theirs in flight(dimension, ticks=20):
        state, estimate = tick(mmse, agent, state, y, seen, own, theirs)
        x = np.where(seen[:, None], x + (y - x) @ weights.T, x)
        np.testing.assert_allclose(estimate.relative, x, atol=1e-12)
    assert estimate.known.all()


def test_mmse_by_hand():
    # A prior of 3 m2 about 0, a measurement of 8 m with 1 m2: three quarters of the way.
    agent, mmse = brief([[1, 0]], np.eye(2)), MinimumMeanSquareError(sigma_prior=np.sqrt(3.0))
    _, estimate = tick(mmse, agent, mmse.init(agent, ()), np.array([[8.0, -4.0]]), only(1, 0), *np.zeros((2, 2)))
    np.testing.assert_allclose(estimate.relative, [[6.0, -3.0]])
    np.testing.assert_allclose(estimate.covariance, [0.75 * np.eye(2)])


def test_mmse_is_surer_than_the_measurement_by_the_sign_of_eq_4_21():
    agent, mmse = agent_of(2), MinimumMeanSquareError(sigma_prior=0.2)
    seen = only(4, 0, 1, 2)
    _, estimate = tick(mmse, agent, mmse.init(agent, ()), np.ones((4, 2)), seen, np.zeros(2), np.zeros((4, 2)))
    expected = np.linalg.inv(np.eye(2) / 0.04 + np.linalg.inv(agent.sensor.covariance))
    np.testing.assert_allclose(estimate.covariance[seen], np.stack([expected] * 3), atol=1e-12)
    assert np.linalg.eigvalsh(agent.sensor.covariance - estimate.covariance[seen]).min() > 0
    np.testing.assert_allclose(estimate.covariance[~seen], [0.04 * np.eye(2)])


def test_the_mle_is_the_mean_of_the_measurements_of_the_tick():
    mle = by_affinet("estimators")["mle"]
    assert mle.load() is NoEstimator
    short = ("time.dt=0.05", "time.duration=1", 'agents.estimator="mle"')
    ten, forty = (make(loading.load("rigid", [*short, f"sensing.samples={number}"])) for number in (10, 40))
    flown = rehearse(ten).arrays
    np.testing.assert_allclose(ten.world.sensor.covariance, np.array([[0.01, 0.003], [0.003, 0.01]]) / 10)
    np.testing.assert_allclose(forty.world.sensor.covariance, ten.world.sensor.covariance / 4)
    links, position = ten.world.links, flown["position"][:-1]
    off = (flown["estimate"] - (position[:, :, None] - position[:, links.neighbours]))[:, links.present]
    assert flown["known"][:, links.present].all()
    np.testing.assert_allclose(np.cov(off.reshape(-1, 2).T), ten.world.sensor.covariance, atol=1.5e-4)


# Slots without a neighbour


@SPACES
@BOTH
def test_padding_changes_nothing(kind, dimension):
    relative = np.concatenate([np.ones((4, dimension)), np.zeros((2, dimension))])
    process = np.zeros((6 * dimension, 6 * dimension))
    agent = agent_of(dimension, positive(4 * dimension, 3))
    process[: 4 * dimension, : 4 * dimension] = agent.process
    padded = replace(brief(relative, agent.sensor.covariance, process), present=only(6, 0, 1, 2, 3))
    filters = kind(coefficients=(0.9,), sigma_n=1.0)
    few, many = filters.init(agent, ()), filters.init(padded, ())
    for y, seen, own, theirs in flight(dimension, ticks=20):
        few, expected = tick(filters, agent, few, y, seen, own, theirs, ~seen)
        wider = [
            np.concatenate([array, np.zeros((2, *array.shape[1:]), array.dtype)]) for array in (y, seen, theirs, ~seen)
        ]
        many, estimate = tick(filters, padded, many, wider[0], wider[1], own, wider[2], wider[3])
        np.testing.assert_allclose(estimate.relative[:4], expected.relative, atol=1e-12)
        np.testing.assert_allclose(estimate.covariance[:4], expected.covariance, atol=1e-12)
    np.testing.assert_array_equal(estimate.known, only(6, 0, 1, 2, 3))
