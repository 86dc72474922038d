"""A target that is found with a latency: filters against textbooks and finite differences, consensus, the law, the runs."""

from dataclasses import replace
from functools import cache
from itertools import combinations, pairwise
from math import factorial
from typing import NamedTuple

import numpy as np
import pytest
from briefs import brief
from flying import PROCESSES, digest_of, plan_of
from numpy.polynomial import polynomial
from rerun.chunk import RrdReader
from scipy.linalg import expm
from scripted import timeline

from affinet.planning.plan import PlanError
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.run import fly, rehearse
from affinet.runtimes.side_by_side import side_by_side
from affinet.scenario.sections import INTEGRATORS, ScenarioError
from affinet.studies.batch import fly_all
from agents.algebra.redcho import Consensus
from agents.brief import Own
from agents.estimate import Estimate
from agents.estimators.target import TargetEstimator
from agents.exchange import Heard
from agents.laws.pursuit import Pursuit
from analysis.metrics import localization
from analysis.models import jets
from analysis.models.information import numbers, packed, position, unpacked
from analysis.models.pursuit import Sighting, Target, diffusion, transition
from netem.core.channels import INPUT, TARGET
from netem.medium.verdict import Fate
from world.books.history import History
from world.books.localized import FirstMeasurements
from world.physics.target import MovingTarget
from world.recording.target import _over_agents

ORDERS = pytest.mark.parametrize("order", [1, 2, 3, 4])


def target_of(order=2, latencies=(20, 10), variances=(0.01, 0.1), intensity=1.0):
    return Target(order, intensity, np.array(latencies), np.array(variances))


# Jets


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


# The target's own motion


def driven(order, intensity):
    """A and B W B' of a chain of integrators."""
    noise = np.zeros((order, order))
    noise[-1, -1] = intensity
    return np.eye(order, k=1), noise


@cache
def van_loan(order, intensity, seconds):
    """A_d and W_d from one matrix exponential."""
    A, noise = driven(order, intensity)
    whole = expm(seconds * np.block([[-A, noise], [np.zeros((order, order)), A.T]]))
    forward = whole[order:, order:].T
    return forward, forward @ whole[:order, order:]


@ORDERS
def test_the_target_moves_and_spreads_as_its_differential_equation_says(order):
    for seconds in (0.0, 0.05, 0.7, 3.0):
        A, W = van_loan(order, 1.7, seconds)
        np.testing.assert_allclose(transition(order, np.array(seconds)), A, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(diffusion(order, np.array(seconds), 1.7), W, rtol=1e-9, atol=1e-12)


def test_motion_over_many_times_is_that_over_each():
    seconds = np.array([[0.1, 0.2], [0.0, 2.0]])
    for place in np.ndindex(2, 2):
        np.testing.assert_array_equal(transition(3, seconds)[place], transition(3, seconds[place]))
        np.testing.assert_array_equal(diffusion(3, seconds, 2.0)[place], diffusion(3, seconds[place], 2.0))


@ORDERS
def test_information_is_packed_without_a_loss(order):
    rng = np.random.default_rng(order)
    root = rng.normal(size=(4, order, order))
    Q, y = root @ np.swapaxes(root, -1, -2) + np.eye(order), rng.normal(size=(4, order, 3))
    said = packed(Q, y)
    assert said.shape == (4, numbers(order, 3))
    for mine, again in zip((Q, y), unpacked(said, 3, order), strict=True):
        np.testing.assert_array_equal(mine, again)
    np.testing.assert_allclose(position(said, 3, order), (np.linalg.inv(Q) @ y)[:, 0], rtol=1e-9)


# One agent and its detector


class Tick(NamedTuple):
    """What came of a tick of an agent, or of many."""

    truth: np.ndarray
    sighting: Sighting
    before: object
    state: object
    estimate: Estimate


def watch(estimator, target, *, dt=0.05, ticks=100, runs=1, seed=0, dimension=2, prior=(1.0, 1.0)):
    """Agents, each after a target of its own, whose start is drawn as the prior says."""
    rng = np.random.default_rng(seed)
    chase_of = MovingTarget(target, dt, np.zeros((target.order, dimension)))
    seeds, first = np.arange(1, runs + 1, dtype=np.uint64) + np.uint64(1000 * seed), np.ones(runs, dtype=np.int64)
    deviations = np.array([prior[0]] + [prior[1]] * (target.order - 1))[:, None]
    start = deviations * rng.normal(size=(runs, target.order, dimension))
    chase = chase_of.begin(runs, runs)._replace(target=start)
    alone = replace(brief(np.zeros((runs, 1, dimension))), dt=dt, target=target)
    state = estimator.init(alone, (runs,))
    heard = {
        channel: Heard({name: np.zeros((runs, 1, *field.shape)) for name, field in fields.items()}, alone.present)
        for channel, fields in estimator.channels(alone).items()
    }
    nothing = np.zeros((runs, dimension))
    for tick in range(ticks):
        sighting = chase_of.sighting(tick, seeds, first, chase)
        before, _ = estimator.sense(alone, state, alone.relative, alone.present)
        state, estimate = estimator.fuse(alone, before, heard, Own(nothing, nothing, tick, sighting=sighting))
        yield Tick(chase.target, sighting, before, state, estimate)
        chase = chase_of.step(tick, seeds, first, chase)


def informed(flown, order=2, dimension=2):
    """Mean and covariance that the information of ticks stands for."""
    Q, y = unpacked(np.stack([tick.estimate.reports["information"][:, 0] for tick in flown]), dimension, order)
    return np.linalg.solve(Q, y), np.linalg.inv(Q)


class Textbook:
    """The optimal estimates of one agent (5) and what follows from them (6), (7), number by number, axis by axis."""

    def __init__(self, sightings, target, dt, agent=0):
        self.target, self.dt, order = target, dt, target.order
        done = [0] + [tick for tick, sighting in enumerate(sightings) if sighting.done[agent]]
        axes = sightings[0].position.shape[-1]
        self.times, self.methods = done, [int(sightings[tick].method[agent]) for tick in done]
        self.means, self.covariances = [np.zeros((order, axes))], [np.eye(order)]  # the prior
        for (begun, over), method in zip(pairwise(done), self.methods, strict=False):
            assert over - begun == target.latencies[method]
            z, R = sightings[over].position[agent], target.variances[method]
            A, W = van_loan(order, target.intensity, (over - begun) * dt)
            x, P = self.means[-1], self.covariances[-1]
            # A measurement is taken in, and the posterior predicted to the time when it is known.
            gain = P[:, 0] / (P[0, 0] + R)
            mean = np.zeros_like(x)
            for axis in range(axes):
                mean[:, axis] = A @ (x[:, axis] + gain * (z[axis] - x[0, axis]))
            self.means.append(mean)
            self.covariances.append(A @ (P - np.outer(gain, P[0])) @ A.T + W)

    def latest(self, seconds):
        """Which estimate is the newest at a time, the later one at a detection."""
        return max(k for k, tick in enumerate(self.times) if tick * self.dt <= seconds + 1e-9)

    def predicted(self, k, seconds):
        A, W = van_loan(self.target.order, self.target.intensity, seconds - self.times[k] * self.dt)
        return A @ self.means[k], A @ self.covariances[k] @ A.T + W

    def smooth(self, seconds, alpha, k=None):
        """Information matrix and vector (7) at any time."""
        k = self.latest(seconds) if k is None else k
        information = []
        for number in (max(k - 1, 0), k):
            mean, P = self.predicted(number, seconds)
            information.append((np.linalg.inv(P), np.linalg.inv(P) @ mean))
        latency = self.target.latencies[self.methods[k]] * self.dt
        tau, power = (seconds - self.times[k] * self.dt) / latency, self.target.order + 1
        eta = tau**power / (tau**power + (alpha * (1 - tau)) ** power) if k else 1.0
        return tuple((1 - eta) * old + eta * new for old, new in zip(*information, strict=True))


OPTIMAL = TargetEstimator(output="optimal", fusion="none")
SMOOTH = TargetEstimator(fusion="none")


@ORDERS
def test_the_optimal_output_is_that_of_a_kalman_filter_written_apart(order):
    target, dt = target_of(order), 0.05
    flown = list(watch(OPTIMAL, target, ticks=110, seed=order + 1))
    book = Textbook([one.sighting for one in flown], target, dt)
    assert len(book.times) > 5
    assert set(book.methods) == {0, 1}
    means, covariances = informed(flown, order)
    for tick, one in enumerate(flown):
        k = book.latest(tick * dt)
        np.testing.assert_allclose(one.state.last.mean[0], book.means[k], rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(one.state.last.covariance[0], book.covariances[k], rtol=1e-10, atol=1e-12)
        mean, P = book.predicted(k, tick * dt)
        np.testing.assert_allclose(means[tick, 0], mean, rtol=1e-7, atol=1e-7)
        np.testing.assert_allclose(covariances[tick, 0], P, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(one.estimate.reports["found"][0], mean[0], rtol=1e-9, atol=1e-9)
        assert one.estimate.reports["variance"][0] == pytest.approx(P[0, 0], rel=1e-9)


def test_the_derivatives_of_the_optimal_output_are_those_of_the_prediction():
    # Of the third derivative nothing is known: no noise has a derivative.
    for one in watch(OPTIMAL, target_of(), ticks=60):
        reference = one.estimate.reports["reference"][0]
        mean = transition(2, (one.state.now - one.state.last.made)[0] * 0.05) @ one.state.last.mean[0]
        np.testing.assert_allclose(reference, [*mean, np.zeros(2)], atol=1e-9)


@pytest.mark.parametrize("alpha", [0.3, 1.0, 4.0])
@ORDERS
def test_the_smooth_output_passes_from_the_older_prediction_to_the_newer(order, alpha):
    target, dt = target_of(order), 0.05
    flown = list(watch(replace(SMOOTH, alpha=alpha), target, ticks=60, seed=order))
    book = Textbook([one.sighting for one in flown], target, dt)
    for tick, one in enumerate(flown):
        Q, y = book.smooth(tick * dt, alpha)
        said = unpacked(one.estimate.reports["information"][0, 0], 2, order)
        np.testing.assert_allclose(said[0], Q, rtol=1e-9, atol=1e-9 * np.abs(Q).max())
        np.testing.assert_allclose(said[1], y, rtol=1e-9, atol=1e-9 * np.abs(y).max())
        P = np.linalg.inv(Q)
        np.testing.assert_allclose(one.estimate.reports["found"][0], (P @ y)[0], rtol=1e-8, atol=1e-8)
        assert one.estimate.reports["variance"][0] == pytest.approx(P[0, 0], rel=1e-8)


def stencil(function, at, step):
    """Value, first and second derivative by central differences of the eighth order."""
    points = np.array([function(at + number * step) for number in range(-4, 5)])
    first = np.array([3, -32, 168, -672, 0, 672, -168, 32, -3]) / 840
    second = np.array([-9, 128, -1008, 8064, -14350, 8064, -1008, 128, -9]) / 5040
    return points[4], np.tensordot(first, points, 1) / step, np.tensordot(second, points, 1) / step**2


def test_derivatives_of_the_smooth_output_are_those_of_the_function_of_time():
    target, dt, alpha = target_of(), 0.05, 0.7
    flown = list(watch(replace(SMOOTH, alpha=alpha), target, ticks=60))
    book = Textbook([one.sighting for one in flown], target, dt)
    looked_at = [tick for tick in range(1, 60) if tick not in book.times]
    assert len(looked_at) > 50
    for tick in looked_at:
        k = book.latest(tick * dt)

        def place(seconds, k=k):
            return np.linalg.solve(*book.smooth(seconds, alpha, k))[0]

        found = flown[tick].estimate.reports["reference"][0]
        for mine, theirs, tolerance in zip(found, stencil(place, tick * dt, 4e-3), (1e-9, 1e-5, 1e-3), strict=True):
            np.testing.assert_allclose(mine, theirs, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("alpha", [0.1, 1.0, 10.0])
def test_a_detection_that_is_taken_in_changes_no_derivative_of_the_smooth_output(order, alpha):
    target, taken = target_of(order), 0
    estimator = replace(SMOOTH, alpha=alpha)
    alone = replace(brief(np.zeros((1, 1, 2))), dt=0.05, target=target)
    nothing = np.zeros((1, 2))
    for one in watch(estimator, target, ticks=100, seed=3):
        if not one.sighting.done[0]:
            continue
        taken += 1
        ignored = one.sighting._replace(done=np.array([False]), method=one.before.method)
        _, before = estimator.fuse(
            alone, one.before, {}, Own(nothing, nothing, int(one.before.now[0]), sighting=ignored)
        )
        for name in ("reference", "variance"):
            np.testing.assert_allclose(one.estimate.reports[name], before.reports[name], rtol=1e-9, atol=1e-12)
        just_before = estimator._information(alone, one.before)
        just_after = estimator._information(alone, one.state)
        for moment, reported in ((just_before, before), (just_after, one.estimate)):
            np.testing.assert_array_equal(np.moveaxis(packed(*moment), 0, -2), reported.reports["information"])
        for mine, theirs in zip(just_before, just_after, strict=True):
            assert len(mine) == order + 1
            for derivative in range(order + 1):
                np.testing.assert_allclose(
                    theirs[derivative], mine[derivative], rtol=1e-6, atol=1e-9 * np.abs(mine[derivative]).max()
                )
        # A tick later, the detection counts.
        assert np.abs(one.state.last.mean - one.before.last.mean).max() > 1e-3
    assert taken > 4


def test_after_a_pause_an_estimate_is_as_unsure_as_it_is_old():
    target, dt = target_of(2, (20, 10), (0.02, 0.1)), 0.05
    flown = list(watch(OPTIMAL, target, ticks=120))
    done = [tick for tick, one in enumerate(flown) if one.sighting.done[0]]
    before, after = done[1], done[3]  # it misses what is done in between
    alone = replace(brief(np.zeros((1, 1, 2))), dt=dt, target=target)
    sighting, nothing = flown[after].sighting, np.zeros((1, 2))
    state, _ = OPTIMAL.fuse(alone, flown[before].state, {}, Own(nothing, nothing, after, sighting=sighting))
    began = after - target.latencies[sighting.by[0]]
    assert began > before
    A, W = van_loan(2, target.intensity, (began - before) * dt)
    P = A @ flown[before].state.last.covariance[0] @ A.T + W
    gain = P[:, :1] / (P[0, 0] + target.variances[sighting.by[0]])
    A, W = van_loan(2, target.intensity, (after - began) * dt)
    np.testing.assert_allclose(state.last.covariance[0], A @ (P - gain @ P[:1]) @ A.T + W, rtol=1e-9)


@pytest.mark.parametrize("output", ["smooth", "optimal"])
@ORDERS
def test_what_a_fresh_agent_knows_late_in_a_run_is_what_was_known_in_tick_0_and_has_spread_since(order, output):
    target, dt, nothing = target_of(order), 0.05, np.zeros((1, 2))
    estimator = TargetEstimator(output, fusion="none", prior_position=0.5, prior_derivatives=2.0)
    alone = replace(brief(np.zeros((1, 1, 2))), dt=dt, target=target)
    idle = Sighting(nothing, np.zeros(1, dtype=bool), *np.zeros((2, 1), dtype=np.int64))
    prior = np.diag([0.25] + [4.0] * (order - 1))
    for tick in (0, 1, 200):
        state, _ = estimator.sense(alone, estimator.init(alone, (1,)), alone.relative, alone.present)
        _, estimate = estimator.fuse(alone, state, {}, Own(nothing, nothing, tick, sighting=idle))
        A, W = van_loan(order, target.intensity, tick * dt)
        Q, y = unpacked(estimate.reports["information"][0, 0], 2, order)
        np.testing.assert_allclose(np.linalg.inv(Q), A @ prior @ A.T + W, rtol=1e-6)
        np.testing.assert_array_equal(y, np.zeros((order, 2)))
    assert estimate.reports["variance"][0] > 10.0


def test_who_is_restarted_late_in_a_run_and_remembers_nothing_is_as_unsure_as_the_target_is_free():
    again = timeline({"verb": "kill", "at": 0.5, "agents": [5]}, {"verb": "restart", "at": 1.0, "agents": [5]})
    arrays = rehearse(
        plan_of(NAME, "time.dt=0.01", "time.duration=1.2", "target.latencies=[0.2,0.1]", again, ALONE)
    ).arrays
    A, W = van_loan(2, 1.0, 1.0)
    Q, _ = unpacked(arrays["information"][100, 4, 0], 2, 2)
    np.testing.assert_allclose(np.linalg.inv(Q), A @ A.T + W, rtol=1e-9)
    assert arrays["variance"][100, 4] > 10 * arrays["variance"][100, 3]


BACK = (1, 5, 12, 30)


def test_a_clock_that_goes_back_leaves_information_that_is_sound():
    target, nothing = target_of(), np.zeros((1, 2))
    alone = replace(brief(np.zeros((1, 1, 2))), dt=0.05, target=target)
    taken = [one for one in watch(SMOOTH, target, ticks=100) if one.sighting.done[0]][1:]
    assert len(taken) > 3
    for one in taken:
        now = int(one.state.now[0])
        idle = one.sighting._replace(done=np.array([False]))
        for back in BACK:
            own = Own(nothing, nothing, now - back, sighting=idle)
            state, estimate = SMOOTH.fuse(alone, one.state, {}, own)
            Q, _ = unpacked(estimate.reports["information"][0, 0], 2, 2)
            assert np.linalg.eigvalsh(Q).min() > 0.0
            # The newer prediction does not count yet, and the older one is as of then, or of when it was made.
            before = one.state.before
            A, W = van_loan(2, target.intensity, max(now - back - before.made[0], 0) * 0.05)
            np.testing.assert_allclose(np.linalg.inv(Q), A @ before.covariance[0] @ A.T + W, rtol=1e-8)
            assert (state.now[0], state.last.made[0]) == (now - back, now)


def test_in_a_flight_a_clock_that_is_set_right_leaves_information_that_is_sound():
    # It falls back just after the first detections, which are far surer than what was known before.
    fast = timeline({"verb": "clock", "at": 0.0, "until": 0.22, "agents": [4, 7], "rate": 5.0})
    short = ("time.dt=0.01", "time.duration=1.0", "target.latencies=[0.2,0.1]", ALONE)
    arrays, right = (rehearse(plan_of(NAME, *short, *air)).arrays for air in ((fast,), ()))
    Q, _ = unpacked(arrays["information"][:, :, 0], 2, 2)
    assert np.linalg.eigvalsh(Q).min() > 0.0
    assert (arrays["variance"] > 0.0).all()
    wrong = (arrays["information"] != right["information"]).any(axis=(0, 2, 3))
    assert np.flatnonzero(wrong).tolist() == [3, 6]


def test_the_optimal_output_jumps_at_a_detection():
    jumps = []
    alone = replace(brief(np.zeros((1, 1, 2))), dt=0.05, target=target_of())
    for one in watch(OPTIMAL, target_of(), ticks=100):
        if one.sighting.done[0]:
            mean = transition(2, (one.before.now - one.before.last.made)[0] * 0.05) @ one.before.last.mean[0]
            jumps.append(np.abs(one.estimate.reports["found"][0] - mean[0]).max())
    assert alone.target is not None
    assert min(jumps) > 1e-3


def series_quotient(numerator, denominator):
    """Taylor coefficients of a quotient, by long division."""
    found = []
    for order, rest in enumerate(numerator):
        drawn = sum(found[lower] * denominator[order - lower] for lower in range(order))
        found.append((rest - drawn) / denominator[0])
    return np.array(found)


def share_of(order, alpha, latency, dt):
    """The jet of eta at each age of a detection, as the estimator has it."""
    target, ages = target_of(order, (latency,), (0.1,)), np.arange(latency + 1)
    estimator = replace(SMOOTH, alpha=alpha)
    state = estimator.init(replace(brief(np.zeros((1, 1, 2))), dt=dt, target=target), (latency + 1,))
    settled = np.ones(latency + 1, dtype=bool)
    return estimator._share(
        target, state._replace(now=ages, last=state.last._replace(made=0 * ages), settled=settled), dt
    )


@pytest.mark.parametrize("alpha", [0.1, 1.0, 10.0])
@ORDERS
def test_eta_is_a_transition_function_and_that_of_appendix_b(order, alpha):
    latency, dt = 16, 0.05
    share = share_of(order, alpha, latency, dt)
    np.testing.assert_allclose(share[0, [0, -1]], [0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(share[1:, [0, -1]], 0.0, atol=1e-9)
    assert (np.diff(share[0]) > 0.0).all()
    for age in range(latency + 1):
        tau, rate = age / latency, 1.0 / (latency * dt)
        # In powers of the time since then: Phi(tau + rate s), Phi(a (1 - tau - rate s)).
        rising = polynomial.polypow([tau, rate], order + 1)[: order + 1]
        falling = polynomial.polypow([alpha * (1 - tau), -alpha * rate], order + 1)[: order + 1]
        series = series_quotient(rising, rising + falling)
        expected = [factorial(power) * each for power, each in enumerate(series)]
        np.testing.assert_allclose(share[:, age], expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_the_smaller_alpha_the_sooner_the_newer_prediction_counts():
    soon, mild, late = (share_of(2, alpha, 16, 0.05)[0] for alpha in (0.1, 1.0, 10.0))
    assert (soon[1:-1] > mild[1:-1]).all()
    assert (mild[1:-1] > late[1:-1]).all()
    assert mild[8] == pytest.approx(0.5)


RUNS = 1000


@cache
def crowd(latencies, output, alpha):
    """Errors (T, R, m, D), covariances (T, R, m, m) of the estimate and of the optimal one, and ages (T, R), of many runs."""
    target = target_of(2, latencies, (0.02, 0.1)[: len(latencies)])
    flown = list(watch(TargetEstimator(output, alpha, "none"), target, ticks=64, runs=RUNS))[-24:]
    means, covariances = informed(flown)
    newest = []
    for one in flown:
        last = one.state.last
        seconds = (one.state.now - last.made) * 0.05
        A = transition(2, seconds)
        newest.append(A @ last.covariance @ np.swapaxes(A, -1, -2) + diffusion(2, seconds, 1.0))
    ages = np.stack([one.state.now - one.state.last.made for one in flown])
    return means - np.stack([one.truth for one in flown]), covariances, np.stack(newest), ages


def relative_to(moments, covariance):
    """Eigenvalues of error moments relative to a covariance."""
    return np.linalg.eigvals(np.linalg.solve(covariance, moments)).real


CROWDS = [((12,), 0.1), ((12,), 10.0), ((20, 10), 1.0)]


@pytest.mark.parametrize(
    ("latencies", "output", "alpha"),
    [*((latencies, "smooth", alpha) for latencies, alpha in CROWDS), ((20, 10), "optimal", 1.0)],
)
def test_on_average_estimates_are_right(latencies, output, alpha):
    errors, *_ = crowd(latencies, output, alpha)
    standard_error = errors.std(axis=1) / np.sqrt(RUNS)
    # Ticks of a run are not independent; four standard errors leave room for the largest of all.
    assert (np.abs(errors.mean(axis=1)) < 4.5 * standard_error).all()
    assert standard_error[..., 0, :].max() < 0.07


def test_the_optimal_output_is_as_wrong_as_it_says():
    for latencies in ((12,), (20, 10)):
        errors, covariances, *_ = crowd(latencies, "optimal", 1.0)
        moments = np.einsum("trid,trjd->tij", errors, errors) / (2 * RUNS)
        # 2000 draws: deviations of a variance are 3.2 %.
        for moment, said in zip(moments, covariances.mean(axis=1), strict=True):
            np.testing.assert_allclose(relative_to(moment, said), 1.0, atol=0.14)


@pytest.mark.parametrize(("latencies", "alpha"), CROWDS)
def test_the_smooth_output_is_no_better_than_the_optimal_and_no_worse_than_it_says(latencies, alpha):
    errors, said, best, ages = crowd(latencies, "smooth", alpha)
    moments = np.einsum("trid,trjd->tij", errors, errors) / (2 * RUNS)
    looser = []
    for moment, least, most in zip(moments, best.mean(axis=1), said.mean(axis=1), strict=True):
        assert relative_to(moment, least).min() > 1 - 0.14
        assert relative_to(moment, most).max() < 1 + 0.14
        looser.append(relative_to(most, least).max())
    # The two bounds are apart, but for the sampling instants of a single latency.
    assert max(looser) > 1.5
    if len(latencies) == 1:
        done = np.flatnonzero((ages == 0).all(axis=1))
        assert len(done) == 2
        for tick in done:
            # Just when a detection is done, all is as the prediction before has it.
            np.testing.assert_allclose(relative_to(moments[tick], said[tick].mean(axis=0)), 1.0, atol=0.14)


# Consensus


def test_what_internals_take_from_the_output_is_row_by_row_that_of_the_errata():
    # C_0 Gamma^mu with Gamma = A_0 - diag(2, 3, 5), by hand.
    G = np.array([[1.0, 0.0, 0.0], [-2.0, 1.0, 0.0], [4.0, -5.0, 1.0]])
    consensus = Consensus(2, 7.0, (6.0, 11.0, 6.0), (2.0, 3.0, 5.0))
    local, internal = np.arange(12.0).reshape(3, 1, 4), np.random.default_rng(0).normal(size=(1, 3, 4))
    np.testing.assert_allclose(consensus.outputs(local, internal)[:, 0], local[:, 0] - G @ internal[0], atol=1e-12)
    for order in (1, 2, 3, 4):
        gamma = np.arange(1.0, order + 2)
        Gamma = np.eye(order + 1, k=1) - np.diag(gamma)
        rows = np.stack([np.linalg.matrix_power(Gamma, mu)[0] for mu in range(order + 1)])
        mixing = -Consensus(order, 1.0, (1.0,) * (order + 1), tuple(gamma)).outputs(
            np.zeros((order + 1, order + 1)), np.eye(order + 1)
        )
        np.testing.assert_allclose(mixing, rows, atol=1e-12)


def test_a_step_of_the_consensus_by_hand():
    consensus = Consensus(2, 10.0, (6.0, 11.0, 7.0), (2.0, 3.0, 5.0))
    internal = np.array([[1.0], [10.0], [100.0]])
    # The neighbours are 8 above, and 1 below: roots -4 + 1, -2 + 1, -1 + 1.
    moved = consensus.step(internal, np.array([0.0]), np.array([[8.0], [-1.0], [0.0]]), 0.01)
    rates = [6 * 10 * -3 + 10 - 2 * 1, 11 * 100 * -1 + 100 - 3 * 10, 7 * 1000 * 0 - 5 * 100]
    np.testing.assert_allclose(moved[:, 0], [1 - 1.72, 10 - 10.30, 100 - 5.0], rtol=1e-12)
    np.testing.assert_allclose(moved[:, 0], internal[:, 0] + 0.01 * np.array(rates), rtol=1e-12)
    lonely = consensus.step(internal, np.array([3.0]), np.array([[3.0]]), 0.01)
    np.testing.assert_allclose(lonely[:, 0], [1 + 0.01 * 8, 10 + 0.01 * 70, 95.0], rtol=1e-12)


def ring(dt, seconds, theta=5.0):
    """How far ten agents are from the mean of their sinusoids and of its derivatives, and the sum of their internals."""
    agents, rng = np.arange(10), np.random.default_rng(0)
    size, rate, phase = rng.uniform(0.5, 1.5, 10), rng.uniform(0.3, 1.0, 10), rng.uniform(0, 6, 10)
    neighbours = np.stack([agents - 1, (agents + 1) % 10], axis=1)
    consensus, internal = Consensus(2, theta, (6.0, 11.0, 6.0), (1.0, 1.0, 1.0)), np.zeros((10, 3, 1))
    off, total = [], 0.0
    for tick in range(round(seconds / dt)):
        angle = rate * tick * dt + phase
        local = np.stack([size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)])[
            ..., None
        ]
        said = consensus.outputs(local, internal)
        off.append(np.abs(said - local.mean(axis=1, keepdims=True)).max(axis=(1, 2)))
        internal = consensus.step(internal, said[0], said[0][neighbours], dt)
        total = max(total, float(np.abs(internal.sum(axis=0)).max()))
    return np.array(off), total, float(np.abs(internal).max())


def test_agents_in_a_ring_agree_on_the_mean_of_their_signals_and_its_derivative():
    off, total, largest = ring(1e-4, 0.8)
    assert (off[0] > [0.5, 0.5, 0.2]).all()
    assert (off[-500:].max(axis=0)[:2] < [1e-5, 1e-2]).all()
    assert total < 1e-10 < largest


def test_shorter_steps_make_the_agreement_closer():
    coarse, fine = (ring(dt, 0.6)[0][-int(0.1 / dt) :].max(axis=0) for dt in (1e-3, 1e-4))
    assert (coarse > np.array([100, 20, 3]) * fine).all()


@cache
def agreed(seconds=0.526, dt=1e-3, latencies=(400, 200), order=2, **parameters):
    """Three agents in a triangle whose detections are theirs: what each says, tick by tick."""
    target = target_of(order, latencies)
    estimator = TargetEstimator(theta=10.0, **parameters)
    chase_of, who = MovingTarget(target, dt, np.zeros((order, 2))), np.array([1, 2, 3])
    chase, neighbours = chase_of.begin(1, 3), np.array([[1, 2], [0, 2], [0, 1]])
    agents = replace(brief(np.ones((3, 2, 2))), dt=dt, target=target)
    state, flown, nothing = estimator.init(agents, (3,)), [], np.zeros((3, 2))
    for tick in range(round(seconds / dt)):
        sighting = chase_of.sighting(tick, 5, who, chase)
        state, said = estimator.sense(agents, state, agents.relative, agents.present)
        heard = {TARGET: Heard({"information": said[TARGET]["information"][neighbours]}, agents.present)}
        state, estimate = estimator.fuse(agents, state, heard, Own(nothing, nothing, tick, sighting=sighting))
        flown.append((state, estimate, sighting, said))
        chase = chase_of.step(tick, 5, who, chase)
    return flown


def test_agents_agree_on_the_position_that_all_their_information_stands_for():
    state, estimate, *_ = agreed()[-1]
    ideal = position(estimate.reports["information"][:, 0].mean(axis=0), 2, 2)
    apart = np.abs(estimate.reports["found"] - ideal).max()
    assert np.abs(estimate.reports["reference"][:, 0] - ideal).max() < apart / 50
    assert np.abs(state.internal.sum(axis=0)).max() < 1e-6 * np.abs(state.internal).max()
    Q = unpacked(estimate.reports["information"][:, 0].mean(axis=0), 2, 2)[0]
    np.testing.assert_allclose(estimate.reports["variance"], np.linalg.inv(Q)[0, 0], rtol=0.06)


def test_what_is_said_is_the_agents_own_information_less_its_internals():
    for (before, estimate, *_), (*_, said) in list(pairwise(agreed()))[::50]:
        assert said[TARGET]["information"].shape == (3, 7)
        assert np.isfinite(estimate.reports["information"]).all()
        assert before.internal.shape == estimate.reports["fused"].shape == (3, 3, 7)
    _, estimate, _, said = agreed()[-1]
    # The internals of the tick before are in what was said; nothing was detected in this tick.
    np.testing.assert_allclose(
        said[TARGET]["information"], estimate.reports["information"][:, 0] - agreed()[-2][0].internal[:, 0], rtol=1e-9
    )
    # It is what is agreed on so far, with derivatives that are not said.
    np.testing.assert_allclose(said[TARGET]["information"], estimate.reports["fused"][:, 0], rtol=1e-9)


def test_derivatives_are_the_agents_own_where_wanted():
    own = agreed(0.35, derivatives="own")
    shared, alone = agreed()[349][1].reports, own[-1][1].reports
    np.testing.assert_array_equal(shared["reference"][:, 0], alone["reference"][:, 0])
    assert np.abs(shared["reference"][:, 1] - alone["reference"][:, 1]).max() > 1e-3
    target = target_of(2, (400, 200))
    agents = replace(brief(np.ones((3, 2, 2))), dt=1e-3, target=target)
    nothing = np.zeros((3, 2))
    idle = Sighting(nothing, np.zeros(3, dtype=bool), own[-1][0].method, own[-1][0].method)
    _, by_itself = SMOOTH.fuse(agents, own[-1][0], {}, Own(nothing, nothing, int(own[-1][0].now[0]), sighting=idle))
    np.testing.assert_allclose(alone["reference"][:, 1:], by_itself.reports["reference"][:, 1:], rtol=1e-9)
    np.testing.assert_allclose(alone["found"], by_itself.reports["found"], rtol=1e-9)


@pytest.mark.parametrize("fusion", ["redcho", "mean"])
def test_who_hears_nobody_goes_by_its_own_information(fusion):
    alone = replace(brief(np.zeros((1, 1, 2))), dt=0.05, target=target_of())
    assert not alone.present.any()
    together = TargetEstimator(fusion=fusion)
    flown, by_itself = (list(watch(estimator, target_of(), ticks=60)) for estimator in (together, SMOOTH))
    for one, other in zip(flown, by_itself, strict=True):
        for name in ("reference", "found", "variance", "information", "fused"):
            np.testing.assert_allclose(one.estimate.reports[name], other.estimate.reports[name], rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(other.estimate.reports["fused"], other.estimate.reports["information"])


def test_what_a_target_estimator_knows_of_neighbours_is_nothing():
    (one, *_) = watch(SMOOTH, target_of(), ticks=1)
    assert not one.estimate.known.any()
    assert np.isnan(one.estimate.psi).all()


def test_what_is_told_is_the_information_with_the_derivatives_that_are_wanted():
    told = replace(brief(np.ones((2, 2))), target=target_of(3))
    assert TargetEstimator().channels(told)[TARGET]["information"].shape == (6 + 3 * 2,)
    assert TargetEstimator(fusion="mean").channels(told)[TARGET]["information"].shape == (4, 6 + 3 * 2)
    assert SMOOTH.channels(told) == {}


# The mean of what is heard


def around(function, at, orders, radius=0.02, points=16):
    """Value and derivatives of a function of time that is real where time is, by Cauchy's formula on half a circle."""
    turns = np.exp(2j * np.pi * np.arange(points // 2 + 1) / points)
    series = np.fft.hfft([function(at + radius * turn) for turn in turns], points, axis=0) / points
    return [factorial(order) * series[order] / radius**order for order in range(orders)]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_with_the_mean_come_the_derivatives_of_the_position_that_it_stands_for(order):
    dt, latencies = 0.05, (14, 8)
    flown = agreed(2.0, dt, latencies, order, fusion="mean")
    books = [Textbook([one[2] for one in flown], target_of(order, latencies), dt, agent) for agent in range(3)]
    assert min(len(book.times) for book in books) > 2
    for tick in range(1, 40, 5):
        latest = [book.latest(tick * dt) for book in books]

        def place(seconds, latest=latest):
            Q, y = zip(*(book.smooth(seconds, 1.0, k) for book, k in zip(books, latest, strict=True)), strict=True)
            return np.linalg.solve(sum(Q), sum(y))[0]

        expected = around(place, tick * dt, order + 1)
        for found in flown[tick][1].reports["reference"]:
            for mine, theirs in zip(found, expected, strict=True):
                np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-6 * np.abs(theirs).max())


def hearing(estimator, state, shares, fresh, tick=0):
    """A tick of three agents without a detection, in which neighbours say these multiples of what it says itself."""
    agents, nothing = replace(brief(np.ones((3, 2, 2))), target=target_of()), np.zeros((3, 2))
    state, said = estimator.sense(agents, state or estimator.init(agents, (3,)), agents.relative, agents.present)
    mine = said[TARGET]["information"]
    theirs = np.multiply.outer(np.array(shares), np.ones(mine.shape[1:])) * mine[:, None]
    idle = Sighting(nothing, np.zeros(3, dtype=bool), state.method, state.method)
    heard = {TARGET: Heard({"information": theirs}, np.array(fresh))}
    state, estimate = estimator.fuse(agents, state, heard, Own(nothing, nothing, tick, sighting=idle))
    return state, estimate.reports, mine


PARTLY = [[True, False], [False, False], [True, True]]


def test_what_was_lost_counts_for_nothing_in_the_mean_whatever_stands_in_its_place():
    nan = np.nan
    _, said, mine = hearing(TargetEstimator(fusion="mean"), None, [[2.0, nan], [nan, -7.0], [3.0, 4.0]], PARTLY)
    # (1 + 2) / 2 and (1 + 3 + 4) / 3 of what all know alike in the first tick.
    assert np.abs(mine).max() > 0.1
    np.testing.assert_allclose(said["fused"], np.array([1.5, 1.0, 8 / 3])[:, None, None] * mine, rtol=1e-12)


def test_what_was_lost_counts_in_redcho_as_what_was_said_last_and_before_that_for_nothing():
    redcho, nan, all_heard = TargetEstimator(theta=2.0), np.nan, np.ones((3, 2), dtype=bool)
    once, *_ = hearing(redcho, None, [[2.0, nan], [nan, nan], [3.0, 4.0]], PARTLY)
    silent, *_ = hearing(redcho, None, [[2.0, 1.0], [1.0, 1.0], [3.0, 4.0]], all_heard)
    np.testing.assert_array_equal(once.internal, silent.internal)
    assert (np.abs(once.internal).max(axis=(1, 2)) > 1e-3).tolist() == [True, False, True]
    held, _, mine = hearing(redcho, once, np.full((3, 2), nan), ~all_heard, tick=1)
    last = np.where(np.array(PARTLY)[..., None], once.theirs, mine[:, None])
    agents = replace(brief(np.ones((3, 2, 2))), target=target_of())
    expected = redcho._consensus(agents).step(once.internal, mine, last, agents.dt)
    np.testing.assert_allclose(held.internal, expected, rtol=1e-12, atol=1e-12)
    assert np.abs(held.internal - once.internal).max() > 1e-3


@pytest.mark.parametrize("hold", [0, 1, 3])
def test_what_was_said_last_counts_in_redcho_for_as_many_ticks_as_it_is_held_and_then_as_ones_own(hold):
    redcho, nobody = TargetEstimator(theta=2.0, hold=hold), np.zeros((3, 2), dtype=bool)
    agents = replace(brief(np.ones((3, 2, 2))), target=target_of())
    shares = [[2.0, 5.0], [3.0, 0.5], [3.0, 4.0]]
    state, _, mine = hearing(redcho, None, shares, PARTLY)
    said, heard = np.multiply.outer(np.array(shares), np.ones(7)) * mine[:, None], np.array(PARTLY)[..., None]
    for silent in range(1, 6):
        before = state
        state, _, mine = hearing(redcho, state, np.full((3, 2), np.nan), nobody, tick=silent)
        counted = np.where(heard & (silent <= hold), said, mine[:, None])
        expected = redcho._consensus(agents).step(before.internal, mine, counted, agents.dt)
        np.testing.assert_allclose(state.internal, expected, rtol=1e-12, atol=1e-12)
        # Of those whom it has never heard, an agent holds nothing.
        pulled = np.abs(counted - mine[:, None]).max(axis=(1, 2)) > 1e-3
        assert pulled.tolist() == [silent <= hold, False, silent <= hold]
    # Who is heard again counts again, and is held again.
    again, *_ = hearing(redcho, state, shares, PARTLY, tick=6)
    after, _, mine = hearing(redcho, again, np.full((3, 2), np.nan), nobody, tick=7)
    alone = redcho._consensus(agents).step(again.internal, mine, mine[:, None], agents.dt)
    assert (np.abs(after.internal - alone).max(axis=(1, 2)) > 1e-3).tolist() == [hold > 0, False, hold > 0]


def test_when_nothing_is_held_only_who_is_heard_in_the_tick_counts():
    fresh_only, held = (TargetEstimator(theta=2.0, hold=hold) for hold in (0, 10))
    for estimator in (fresh_only, held):
        once, *_ = hearing(estimator, None, [[2.0, 3.0]] * 3, np.ones((3, 2), dtype=bool))
        by_itself, *_ = hearing(estimator, None, [[1.0, 1.0]] * 3, np.ones((3, 2), dtype=bool))
        # Those who are heard in the tick pull, however long they would be held.
        assert np.abs(once.internal - by_itself.internal).max() > 1e-3
        later, *_ = hearing(estimator, once, np.full((3, 2), np.nan), np.zeros((3, 2), dtype=bool), tick=1)
        alone, *_ = hearing(estimator, once, [[1.0, 1.0]] * 3, np.ones((3, 2), dtype=bool), tick=1)
        assert np.array_equal(later.internal, alone.internal) == (estimator is fresh_only)


def test_an_agent_goes_by_its_own_information_where_what_is_agreed_on_is_next_to_none():
    # In the mean a hundredth of its own is left, and a little more or less.
    shares = np.array([-0.984, -0.976, -1.5])
    _, said, _ = hearing(TargetEstimator(fusion="mean"), None, np.stack([shares, shares], axis=1), [[True, False]] * 3)
    _, alone, _ = hearing(TargetEstimator(fusion="mean"), None, np.zeros((3, 2)), np.zeros((3, 2), dtype=bool))
    np.testing.assert_allclose(said["variance"], alone["variance"] / [1.0, 0.012, 1.0], rtol=1e-9)


def test_all_that_hear_everybody_find_the_same_with_the_mean():
    for _, estimate, *_ in agreed(2.0, 0.05, (20, 10), fusion="mean")[1:]:
        for name in ("reference", "variance", "fused"):
            first, *others = estimate.reports[name]
            for other in others:
                np.testing.assert_allclose(other, first, rtol=1e-12, atol=1e-12 * np.abs(first).max())
        Q = unpacked(estimate.reports["information"][:, 0].mean(axis=0), 2, 2)[0]
        np.testing.assert_allclose(estimate.reports["variance"], np.linalg.inv(Q)[0, 0], rtol=1e-9)


# The law


def knows(*reference):
    nothing = np.zeros((1, 2))
    return Estimate(
        nothing,
        np.zeros(1, dtype=bool),
        np.zeros((1, 2, 2)),
        np.array(np.nan),
        reports={"reference": np.array(reference)},
    )


PLACED = replace(brief(np.ones((1, 2))), nominal=np.array([3.0, -1.0]))


def test_the_law_by_hand():
    own = Own(np.array([0.5, 0.0]), np.zeros(2), 0, np.array([10.0, 2.0]))
    reference = knows([4.0, 1.0], [1.0, 1.0], [0.1, -0.2])
    law = Pursuit(kappa=(2.0, 3.0))
    _, u = law.command(PLACED, law.init(PLACED, ()), 0, own, reference, None)
    # Off by (10, 2) - (4, 1) - (3, -1) = (3, 2), behind by (-0.5, -1).
    np.testing.assert_allclose(u, [0.1 - 2 * 3 + 3 * 0.5, -0.2 - 2 * 2 + 3 * 1], rtol=1e-12)
    first = Pursuit(kappa=[2.0])
    _, u = first.command(PLACED, first.init(PLACED, ()), 0, own, reference, None)
    np.testing.assert_allclose(u, [1 - 2 * 3, 1 - 2 * 2], rtol=1e-12)
    np.testing.assert_allclose(
        Pursuit().command(PLACED, law.init(PLACED, ()), 0, own, reference, None)[1], [0.1 - 3 + 1, -0.2 - 2 + 2]
    )


@pytest.mark.parametrize("batch", [(), (3, 5)], ids=["one", "many"])
@ORDERS
def test_the_law_of_any_order_is_that_of_the_paper(order, batch):
    rng = np.random.default_rng(order)
    p, x = rng.normal(size=(5, *batch, 2)), rng.normal(size=(4, *batch, 2))
    k = np.poly(-rng.uniform(0.5, 3.0, order))[:0:-1]
    place = k[0] * (x[0] - p[0] - PLACED.nominal)
    written_out = {  # (11)
        1: lambda: p[1] - place,
        2: lambda: p[2] - place - k[1] * (x[1] - p[1]),
        3: lambda: p[3] - place - k[1] * (x[1] - p[1]) - k[2] * (x[2] - p[2]),
        4: lambda: p[4] - place - k[1] * (x[1] - p[1]) - k[2] * (x[2] - p[2]) - k[3] * (x[3] - p[3]),
    }
    law, flying = Pursuit(kappa=k.tolist()), np.full((*batch, 2), 77.0)
    assert law.order == order
    own = Own(flying, flying, 0, x[0])
    if order > 1:
        own = own._replace(velocity=x[1], higher=np.moveaxis(x[2:order], 0, -2))
    # Those who know of more derivatives than the law wants do not disturb it.
    for known in range(order + 1, 6):
        reference = knows(*np.zeros((known, 2)))._replace(reports={"reference": np.moveaxis(p[:known], 0, -2)})
        _, u = law.command(PLACED, law.init(PLACED, batch), 0, own, reference, None)
        np.testing.assert_allclose(u, written_out[order](), rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match=f"derivatives up to {order}: the estimator has to report them"):
        law.command(PLACED, law.init(PLACED, batch), 0, own, knows(*np.zeros((order, 2))), None)


@pytest.mark.parametrize("kappa", [(), (1.0, 5.0, 10.0, 10.0, 5.0)], ids=["none", "five"])
def test_a_law_has_a_gain_for_each_of_one_to_four_times(kappa):
    with pytest.raises(ValueError, match=r"kappa needs a gain for each of 1 to 4 times .* like \[1.0, 2.0\]") as told:
        Pursuit(kappa=kappa)
    assert str(told.value).endswith(f"got {list(kappa)}")


@pytest.mark.parametrize(
    "kappa",
    [(0.0,), (-1.0,), (1.0, 0.0), (1.0, -2.0), (2.0, 1.0, 2.0), (2.1, 1.0, 2.0), (1.0, 1.0, 1.0, 1.0)],
    ids=str,
)
def test_gains_with_which_agents_would_leave_the_reference_are_refused(kappa):
    with pytest.raises(ValueError, match="not Hurwitz"):
        Pursuit(kappa=kappa)
    assert Pursuit(kappa=(1.9, 1.0, 2.0)).order == 3  # by Routh and Hurwitz, kappa_0 < kappa_1 kappa_2


def test_the_law_wants_a_position():
    nowhere = Own(np.zeros(2), np.zeros(2))
    for law in (Pursuit(), Pursuit(kappa=(1.0,))):
        with pytest.raises(ValueError, match="own position"):
            law.command(PLACED, law.init(PLACED, ()), 0, nowhere, knows([0, 0], [0, 0], [0, 0]), None)


NAME = "target"
COARSE = ("time.dt=0.01", "target.latencies=[0.2,0.1]", "agents.parameters.target.theta=4")
ALONE = 'agents.parameters.target={fusion="none"}'
MEAN = 'agents.parameters.target={fusion="mean"}'


def bodies(order, *kappa):
    """Bodies of an order, and the gains of the law that steers them."""
    return f'dynamics.model="{INTEGRATORS[order - 1]}"', f"agents.parameters.pursuit.kappa={list(map(float, kappa))}"


SINGLE = bodies(1, 1)
TRIPLE = (*bodies(3, 27, 27, 9), "target.order=3")  # thrice a pole at -3/s
FEW = "formation={nodes=[[5,0],[-3,4],[-3,-4]],edges=['1-2','2-3'],leaders=[],spread=3.0}"


def refusal(*overrides, name=NAME):
    with pytest.raises((ScenarioError, PlanError)) as told:
        plan_of(name, *overrides)
    said = str(told.value)
    assert "\n" not in said
    return said


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (('agents.estimator="none"',), "the estimator has to report them"),
        (("target.order=1", ALONE), "derivatives up to 2"),
        (('agents.estimator="none"', *SINGLE), "derivatives up to 1"),
        (("target.order=1",), "a target of order 1 needs 2 gains k and gamma"),
        (('agents.parameters.target={output="optimal"}',), "fusion = 'redcho' wants output = 'smooth'"),
        (('agents.parameters.target={output="optimal",fusion="mean"}',), "fusion = 'mean' wants output = 'smooth'"),
        (('agents.parameters.target={fusion="median"}',), '"redcho", "mean" or "none", got "median"'),
        (
            (*bodies(3, 1, 3, 3), ALONE),
            "up to 3: the estimator has to report them, and the target to be of order 3 at least",
        ),
        (bodies(2, 1), "bodies are double-integrators; set it to 'single-integrator'"),
        (bodies(2, 1, 3, 3), "pursuit steers jerks, and bodies are double-integrators; set it to 'triple-integrator'"),
        (bodies(3, 1, 4, 6, 4), "pursuit steers snaps, and bodies are triple-integrators; set it to 'quadruple-i"),
        (bodies(4, 1, 2), "pursuit steers accelerations, and bodies are quadruple-integrators; set it to 'double-i"),
        (bodies(2), "agents.parameters.pursuit: kappa needs a gain for each of 1 to 4 times that bodies integrate"),
        (bodies(2, 1, -1), "agents.parameters.pursuit: with kappa [1.0, -1.0] agents leave the reference"),
        ((*TRIPLE, ALONE, "formation.leaders=[1,2,3]"), "formation.leaders: who leads is steered by velocities or acc"),
        (("agents.parameters.target.alpha=0.0",), "alpha must be above 0"),
        (("target.latencies=[0.5,0.0031]",), "target.latencies"),
        (("target.latencies=[0.5]",), "a variance for each latency"),
        (("target.position=[1,2,3]",), "target.position"),
    ],
)
def test_what_cannot_pursue_is_refused_in_one_line(overrides, says):
    assert says in refusal(*overrides)


def test_latencies_that_are_no_whole_number_of_ticks_are_named():
    said = refusal("target.latencies=[0.105,0.1]", "time.dt=0.01")
    assert "target.latencies: [0.105, 0.1] s are not whole numbers of ticks of 0.01 s" in said


def test_an_estimator_of_a_target_needs_one():
    assert "give the scenario a [target]" in refusal('agents.estimator="target"', name="localization")
    assert "give the scenario a [target]" in refusal('agents.estimator="target"', ALONE, name="localization")


def test_gains_of_the_laws_are_read_from_the_scenario():
    assert plan_of(NAME, "agents.parameters.pursuit={kappa=[4.0,5.0]}").law.build() == Pursuit([4.0, 5.0])
    for order in (1, 2, 3, 4):
        kappa = [[1.0], [1.0, 5.0], [1.0, 5.0, 2.0], [1.0, 5.0, 8.0, 7.0]][order - 1]
        made = plan_of(NAME, *bodies(order, *kappa), f"target.order={order}", ALONE)
        assert (made.law.build(), made.scenario.dynamics.order, made.agents.law.order) == (Pursuit(kappa), order, order)


def test_who_pursues_by_velocities_or_accelerations_may_have_leaders():
    for overrides in (SINGLE, ()):
        assert plan_of(NAME, *overrides, "formation.leaders=[1,2,3]").world.formation.is_leader.sum() == 3


# The agent


@ORDERS
def test_agents_say_how_they_move_up_to_their_input_and_steer_by_it(order):
    kappa, rng = [[2.0], [2.0, 3.0], [2.0, 3.0, 5.0], [2.0, 5.0, 9.0, 7.0]][order - 1], np.random.default_rng(order)
    made = plan_of(NAME, *bodies(order, *kappa), f"target.order={order}", ALONE)
    agent, nobody = made.agents, np.zeros_like(made.brief.present)
    place, *moves = rng.normal(size=(order, 10, 2))
    motion = np.stack(moves, axis=1) if moves else None
    sighting = Sighting(rng.normal(size=(10, 2)), np.ones(10, dtype=bool), *np.zeros((2, 10), dtype=np.int64))
    state = agent.init((10,))
    for tick in range(2):
        flying = state.input
        state, said = agent.sense(state, made.brief.relative, made.brief.present, motion)
        assert list(said[INPUT]) == ["velocity", "acceleration", "jerk", "snap"][:order]
        assert {name: field.shape for name, field in agent.channels()[INPUT].items()} == dict.fromkeys(
            said[INPUT], (2,)
        )
        for told, mine in zip(said[INPUT].values(), [*moves, flying], strict=True):
            np.testing.assert_array_equal(told, mine)
        heard = {INPUT: Heard({name: np.zeros((*nobody.shape, 2)) for name in said[INPUT]}, nobody)}
        state, action = agent.act(state, tick, heard, place, motion, sighting)
        p = np.moveaxis(action.estimate.reports["reference"], 1, 0)
        off = [place - p[0] - made.brief.nominal, *(mine - p[mu] for mu, mine in enumerate(moves, 1))]
        expected = p[order] - sum(gain * each for gain, each in zip(kappa, off, strict=True))
        np.testing.assert_allclose(action.input, expected, rtol=1e-12, atol=1e-12)
    assert (flying != 0.0).all()


# The world


def step_of(target, dt=0.1, start=None, swarms=20_000, tick=3):
    start = np.zeros((target.order, 2)) if start is None else start
    chase_of = MovingTarget(target, dt, start)
    seeds, first = np.arange(swarms, dtype=np.uint64), np.ones(swarms, dtype=np.int64)
    return chase_of.step(tick, seeds, first, chase_of.begin(swarms, swarms)).target


@pytest.mark.parametrize("order", [1, 2, 3])
def test_over_a_tick_a_target_drifts_and_spreads_as_its_equation_says(order):
    start = np.random.default_rng(order).normal(size=(order, 2))
    target = target_of(order, intensity=2.0)
    moved = step_of(target, start=start)
    A, W = van_loan(order, 2.0, 0.1)
    deviation = np.sqrt(np.diag(W))[:, None]
    off = (moved - A @ start) / deviation
    assert np.abs(off.mean(axis=0)).max() < 4.5 / np.sqrt(len(off))
    scale = np.outer(deviation, deviation)
    for axis in range(2):
        np.testing.assert_allclose(np.cov(off[..., axis].T).reshape(order, order), W / scale, atol=0.04)
    # Axes are independent, and so are ticks.
    across = np.einsum("sid,sje->idje", off, off)[:, 0, :, 1] / len(off)
    assert np.abs(across).max() < 4.5 / np.sqrt(len(off))
    later = (step_of(target, start=start, tick=4) - A @ start) / deviation
    assert np.abs((off * later).mean(axis=0)).max() < 4.5 / np.sqrt(len(off))


def test_without_noise_a_target_keeps_its_velocity():
    start = np.array([[1.0, 2.0], [0.5, -1.0]])
    moved = step_of(target_of(intensity=0.0), start=start, swarms=3)
    np.testing.assert_allclose(moved, np.broadcast_to([start[0] + 0.1 * start[1], start[1]], (3, 2, 2)))
    run = rehearse(
        plan_of(
            NAME, *COARSE, "time.duration=0.3", "target.intensity=0", "target.position=[1,2]", "target.velocity=[3,0]"
        )
    )
    centre = run.arrays["target"] - run.plan.world.formation.nominal
    expected = np.array([1.0, 2.0]) + np.arange(30)[:, None] * 0.01 * np.array([3.0, 0.0])
    np.testing.assert_allclose(centre, np.broadcast_to(expected[:, None], centre.shape), atol=1e-12)


class Detection(NamedTuple):
    """Which agent's detector, when it began and was done, by which method, and how far off it was."""

    agent: int
    begun: int
    over: int
    method: int
    off: np.ndarray


@cache
def detections(agents=60, ticks=400):
    target = target_of(2, (7, 3), (0.04, 0.25))
    chase_of, who = MovingTarget(target, 0.05, np.zeros((2, 2))), np.arange(1, agents + 1)
    chase, made = chase_of.begin(1, agents), []
    began, method, where = np.zeros(agents, dtype=int), None, []
    for tick in range(ticks):
        said = chase_of.sighting(tick, 11, who, chase)
        where.append(chase.target[0, 0])
        for agent in np.flatnonzero(said.done).tolist():
            off = said.position[agent] - where[began[agent]]
            made.append(Detection(agent, int(began[agent]), tick, int(method[agent]), off))
            began[agent] = tick
        if method is not None:
            # A detector keeps its method until it is done.
            assert (said.done | (said.method == method)).all()
        else:
            assert not said.done.any()
        method = said.method
        chase = chase_of.step(tick, 11, who, chase)
    return made, target


def test_detections_are_done_a_latency_after_they_began():
    made, target = detections()
    assert len(made) > 3000
    for one in made:
        assert one.over - one.begun == target.latencies[one.method]
    # Not all together.
    assert len({tuple(each.over for each in made if each.agent == agent) for agent in range(10)}) == 10


def test_what_is_found_is_where_the_target_was_as_surely_as_the_method_says():
    made, target = detections()
    for method in range(2):
        off = np.array([one.off for one in made if one.method == method]) / np.sqrt(target.variances[method])
        assert np.abs(off.mean(axis=0)).max() < 4.5 / np.sqrt(len(off))
        np.testing.assert_allclose(np.cov(off.T), np.eye(2), atol=4.5 * np.sqrt(2 / len(off)))


def test_methods_are_about_equally_frequent_whatever_came_before():
    made, _ = detections()
    chosen = np.array([one.method for one in made])
    assert abs(chosen.mean() - 0.5) < 4 * 0.5 / np.sqrt(len(chosen))
    for agent in range(60):
        assert sum(one.agent == agent for one in made) > 10
    following = [
        (one.method, other.method)
        for agent in range(60)
        for one, other in pairwise(each for each in made if each.agent == agent)
    ]
    after = np.array([second for first, second in following if first == 0])
    assert abs(after.mean() - 0.5) < 4 * 0.5 / np.sqrt(len(after))


SEEDS = (1, 7, 2**63 + 5)


LOSSY = ("network.availability=0.7", "network.delay_ticks=2")
FOURTH = (*bodies(4, 81, 108, 54, 12), "target.order=4", MEAN, "network.availability=0.7", "time.duration=0.3")


@pytest.mark.parametrize(
    "air", [(), LOSSY, (MEAN, *LOSSY), FOURTH], ids=["clear", "lossy", "mean", "quadruple-integrators"]
)
def test_every_swarm_side_by_side_meets_the_draws_that_it_meets_alone(air):
    short = (*COARSE, "time.duration=0.6", *air)
    plan = plan_of(NAME, *short)
    batch = side_by_side(plan, SEEDS)
    together = History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(together.extend, 20)
    flown = together.arrays()
    for place, seed in enumerate(SEEDS):
        alone = rehearse(plan_of(NAME, *short, f"seed={seed}")).arrays
        agents = slice(10 * place, 10 * (place + 1))
        for array in ("position", "target", "reference", "found", "variance", "information", "fused", "input"):
            np.testing.assert_array_equal(flown[array][:, agents], alone[array], array)
        assert np.isfinite(alone["reference"]).all()


KILLED = timeline({"verb": "kill", "at": 0.2, "agents": [5]}, {"verb": "kill", "at": 0.3, "agents": [1, 2]})


@pytest.mark.parametrize("air", [(), (KILLED,)], ids=["all", "some die"])
def test_the_runs_of_a_study_are_looked_at_as_each_alone(air):
    short = (*COARSE, "time.duration=0.5", *air)
    runs = fly_all(plan_of(NAME, *short), [3, 4], every=5)
    for row, seed in enumerate((3, 4)):
        run = rehearse(plan_of(NAME, *short, f"seed={seed}"))
        arrays, nominal = {name: array[:50:5] for name, array in run.arrays.items()}, run.plan.world.formation.nominal
        target = arrays["target"] - nominal
        awake = np.isfinite(arrays["found"]).all(axis=-1)
        assert awake.sum(axis=1).tolist() == ([10] * 4 + [9] * 2 + [7] * 4 if air else [10] * 10)
        Q, y = unpacked(np.nanmean(arrays["information"][:, :, 0], axis=1), 2, 2)
        ideal = np.linalg.solve(Q, y)[:, :1]
        expected = {
            "found": arrays["found"] - target,
            "agreed": arrays["reference"][:, :, 0] - target,
            "ideal": np.broadcast_to(ideal, target.shape) - target,
            "apart": arrays["reference"][:, :, 0] - ideal,
            "behind": arrays["position"] - nominal - arrays["reference"][:, :, 0],
            "effort": arrays["input"],
        }
        for name, off in expected.items():
            rms = np.sqrt(np.nanmean(np.where(awake, (off**2).sum(axis=-1), np.nan), axis=-1))
            np.testing.assert_allclose(runs.quantities[name][row], rms, rtol=1e-9, atol=1e-12, err_msg=name)
        if row == 0:
            assert runs.first.keys() == {"reference", "found", "variance", "information", "fused", "position", "target"}
            for name in runs.first.keys() - {"target"}:
                np.testing.assert_array_equal(runs.first[name], arrays[name], name)
            np.testing.assert_allclose(runs.first["target"], target[:, 0], atol=1e-12)
    assert np.isnan(runs.quantities["localization"]).all()


LONG = (
    "time.dt=0.02",
    "time.duration=6",
    "target.latencies=[0.2,0.1]",
    "target.intensity=1e-6",
    "formation.spread=0.5",
)


CERTAIN = 'agents.parameters.target={fusion="none",prior_derivatives=0.02}'


def test_in_flight_agents_surround_the_target():
    run = rehearse(plan_of(NAME, *LONG, CERTAIN))
    # The error is that of places about the target, and falls to that of its detection.
    assert run.error[0] > 0.2
    assert run.error[-1] < 0.05
    off = run.position - run.arrays["target"]
    np.testing.assert_allclose((off**2).sum(axis=-1).mean(axis=-1), run.error, rtol=1e-9)


def test_a_first_order_target_is_followed_by_single_integrators():
    run = rehearse(plan_of(NAME, *LONG, *SINGLE, ALONE, "target.order=1"))
    assert run.arrays["reference"].shape[2:] == (2, 2)
    assert run.error[-1] < 0.02 < run.error[0]


def test_in_three_dimensions_a_target_is_followed_too():
    solid = "formation={nodes=[[1,0,0],[-1,0,0.5],[0,1,2]],edges=['1-2','2-3'],leaders=[],spread=0.5}"
    run = rehearse(plan_of(NAME, *LONG[:-1], solid, CERTAIN))
    assert run.arrays["reference"].shape[1:] == (3, 3, 3)
    assert run.arrays["information"].shape[1:] == (3, 3, 9)
    assert run.error[-1] < 0.05 < 0.2 < run.error[0]


CALM = (
    *TRIPLE,
    FEW,
    "time.dt=0.01",
    "time.duration=3",
    "target={order=3,intensity=0,position=[0.1,-0.2],velocity=[0.02,-0.01],latencies=[0.5,0.4],variances=[1e-4,1e-4]}",
    'agents.parameters.target={fusion="none",prior_position=0.2,prior_derivatives=0.02,k=[24.0,50.0,35.0,10.0],'
    "gamma=[1.0,1.0,1.0,1.0]}",
)


def test_integrators_of_the_third_order_come_to_their_places_about_an_undisturbed_target():
    run = rehearse(plan_of(NAME, *CALM))
    assert run.arrays["reference"].shape[1:] == (3, 4, 2)
    assert run.error[0] > 5.0
    assert run.error[-1] < 0.005
    # Off the reference, they move as three poles at -3/s say.
    seconds, nominal = np.arange(300) * 0.01, run.plan.world.formation.nominal
    behind = run.position[:300] - nominal - run.arrays["reference"][:300, :, 0]
    left = (1 + 3 * seconds + 4.5 * seconds**2) * np.exp(-3 * seconds)
    np.testing.assert_allclose(behind, left[:, None, None] * behind[0], atol=0.1)


# Fusion in flight

WHOLE = f"formation.edges={[f'{i}-{j}' for i, j in combinations(range(1, 11), 2)]}"
GRAPHS = {"ring": (), "whole": (WHOLE,)}


@cache
def fused_in_flight(graph, *air):
    """A flight, and the shares that each agent gives to what each has to say in every tick, shape (T, N, N)."""
    run = rehearse(plan_of(NAME, *COARSE, *GRAPHS[graph], MEAN, "time.duration=0.5", *air))
    links, told = run.plan.world.links, run.plan.channels.index(TARGET)
    heard = np.broadcast_to(np.eye(10), (50, 10, 10)).copy()
    heard[:, links.dst - 1, links.src - 1] = run.arrays["fates"][:, told] == Fate.DELIVERED
    return run.arrays, heard / heard.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("air", [(), ("network.availability=0.7",)], ids=["clear", "lossy"])
@pytest.mark.parametrize("graph", GRAPHS)
def test_the_mean_is_that_of_an_agents_own_information_and_of_what_it_hears_in_the_tick(graph, air):
    arrays, shares = fused_in_flight(graph, *air)
    degrees = np.unique((shares > 0).sum(axis=-1))
    if air:
        assert set(degrees) >= {1, 2, 3} if graph == "ring" else len(degrees) > 4
    else:
        assert degrees.tolist() == ([3] if graph == "ring" else [10])
    information, fused = arrays["information"], arrays["fused"]
    assert information.shape == (50, 10, 3, 7)
    size = np.abs(information).max(axis=(0, 1))
    np.testing.assert_allclose(fused / size, np.einsum("tij,tjmc->timc", shares, information / size), atol=1e-12)
    np.testing.assert_allclose(arrays["reference"][:, :, 0], position(fused[:, :, 0], 2, 2), rtol=1e-9, atol=1e-12)
    assert np.abs(information - fused).max() > 0.1 * size.max()


def test_who_hears_everybody_finds_all_that_is_known_and_others_do_not():
    apart = {}
    for graph in GRAPHS:
        arrays, _ = fused_in_flight(graph)
        ideal = position(arrays["information"][:, :, 0].mean(axis=1, keepdims=True), 2, 2)
        apart[graph] = np.abs(arrays["reference"][:, :, 0] - ideal).max()
    assert apart["whole"] < 1e-12
    assert apart["ring"] > 0.1
    runs = fly_all(plan_of(NAME, *COARSE, WHOLE, MEAN, "time.duration=0.3"), [3, 4], every=5)
    assert runs.quantities["apart"].max() < 1e-12 < runs.quantities["ideal"].max()


def test_with_the_mean_derivatives_are_the_agents_own_where_wanted():
    short = (*COARSE, "time.duration=0.3")
    agreed, own, alone = (
        rehearse(plan_of(NAME, *short, f"agents.parameters.target={{{how}}}")).arrays["reference"]
        for how in ('fusion="mean"', 'fusion="mean",derivatives="own"', 'fusion="none"')
    )
    np.testing.assert_array_equal(own[:, :, 0], agreed[:, :, 0])
    np.testing.assert_array_equal(own[:, :, 1:], alone[:, :, 1:])
    assert np.abs(agreed - own)[:, :, 1:].max() > 0.1
    assert np.abs(own - alone)[:, :, 0].max() > 0.1


# Reports


def reporting(name):
    return 'agents.estimator="reporting:Reporting"', f'agents.parameters.reporting:Reporting.name="{name}"'


@pytest.mark.parametrize("name", ["position", "error", "fates", "target", "psi", "known"])
def test_a_report_with_a_name_that_every_run_has_is_refused(name):
    said = refusal(*reporting(name), name="localization")
    assert f"reports {name}, which every run has already" in said


def test_a_report_that_could_not_be_kept_or_judged_is_refused():
    assert "the estimator reports 'place', which is where an agent believes it is, (..., 2), not (3,)" in refusal(
        *reporting("place"), name="localization"
    )
    assert "a report has a name of 70000 letters: give it at most 100" in refusal(
        *reporting("n" * 70_000), name="corridor"
    )


def test_reports_land_in_the_arrays_by_name_and_are_no_numbers_for_who_is_dead():
    dead = timeline({"verb": "kill", "at": 0.05, "agents": [5]}, {"verb": "restart", "at": 0.1, "agents": [5]})
    run = rehearse(plan_of("localization", "time.duration=0.2", dead, *reporting("says")))
    said = run.arrays["says"]
    assert said.shape == (20, 10, 3)
    assert run.plan.reports == {"says": (3,)}
    gone = np.isnan(said).all(axis=-1)
    np.testing.assert_array_equal(np.flatnonzero(gone[:, 4]), range(5, 10))
    assert not np.delete(gone, 4, axis=1).any()
    np.testing.assert_array_equal(said[0], np.arange(30.0).reshape(10, 3))


def test_who_pursues_tells_where_and_how_surely():
    dead = timeline({"verb": "kill", "at": 0.05, "agents": [5]})
    arrays = rehearse(plan_of(NAME, *COARSE, "time.duration=0.1", dead)).arrays
    shapes = {"reference": (3, 2), "found": (2,), "variance": (), "information": (3, 7), "fused": (3, 7)}
    for name, shape in shapes.items():
        assert arrays[name].shape == (10, 10, *shape)
        assert np.isnan(arrays[name][5:, 4]).all()
        assert np.isfinite(arrays[name][:5]).all()
        assert np.isfinite(np.delete(arrays[name], 4, axis=1)).all()


# Recordings


@cache
def recorded(out):
    return RrdReader(str(out / "run.rrd")).stream().to_chunks()


def column(chunks, path, name):
    found = [chunk.to_record_batch() for chunk in chunks if str(chunk.entity_path) == path and not chunk.is_static]
    return [value for batch in found if name in batch.schema.names for value in batch.column(name).to_pylist()]


@pytest.fixture(scope="module")
def pursuit_on_file(tmp_path_factory):
    out = tmp_path_factory.mktemp("pursuit") / "run"
    dead = timeline({"verb": "kill", "at": 0.25, "agents": [5]})
    fly(plan_of(NAME, *COARSE, "time.duration=0.4", dead), "inprocess", out, lambda *_: None)
    return out


def test_a_recording_of_a_pursuit_shows_the_target_and_what_agents_know_of_it(pursuit_on_file):
    chunks, arrays = recorded(pursuit_on_file), dict(np.load(pursuit_on_file / "arrays.npz"))
    kept = {name: array[:40:5] for name, array in arrays.items()}
    nominal = plan_of(NAME, *COARSE).world.formation.nominal
    points = {
        path: np.array(column(chunks, f"/swarm/{path}/at", "Points3D:positions"))
        for path in ("target", "found", "agreed")
    }
    target = (kept["target"] - nominal)[:, :1]
    np.testing.assert_allclose(points["target"][..., :2], target, atol=1e-5)
    np.testing.assert_allclose(points["found"][..., :2], kept["found"], atol=1e-5)
    np.testing.assert_allclose(points["agreed"][..., :2], kept["reference"][:, :, 0], atol=1e-5)
    told = np.array(column(chunks, "/metrics/target", "Scalars:scalars"))
    # Agent 5 dies, and those left count.
    assert np.isnan(kept["found"]).any(axis=(1, 2)).tolist() == [False] * 5 + [True] * 3
    expected = [
        np.sqrt(np.nanmean(((each - target) ** 2).sum(axis=-1), axis=-1))
        for each in (kept["found"], kept["reference"][:, :, 0])
    ]
    np.testing.assert_allclose(told, np.stack(expected, axis=-1), rtol=1e-6, atol=1e-9)
    assert np.isfinite(told).all()
    strips = column(chunks, "/swarm/agreed/spread", "LineStrips3D:strips")
    assert [len(moment) for moment in strips] == [10] * 8
    away = np.linalg.norm(np.array(strips[4])[..., :2] - kept["reference"][4, :, None, 0], axis=-1)
    np.testing.assert_allclose(away, 2 * np.sqrt(kept["variance"][4])[:, None].repeat(25, 1), rtol=1e-4)


def test_a_recording_of_another_flight_shows_no_pursuit_and_no_places(tmp_path):
    mute = plan_of("localization", "time.duration=0.1", 'agents.estimator="none"')
    fly(mute, "inprocess", tmp_path / "run", lambda *_: None)
    paths = {str(chunk.entity_path) for chunk in recorded(tmp_path / "run")}
    assert not paths & {"/swarm/agreed/at", "/metrics/target", "/swarm/place", "/metrics/localization"}


def test_a_recording_of_localization_shows_places_the_best_places_and_ellipses(tmp_path):
    blind = timeline({"verb": "cut", "at": 0, "until": 1.0, "links": ["all"]})
    out = tmp_path / "run"
    fly(plan_of("localization", "time.duration=1.5", blind), "inprocess", out, lambda *_: None)
    chunks, arrays = recorded(out), dict(np.load(out / "arrays.npz"))
    place, best = (
        np.array(column(chunks, f"/swarm/{path}", "Points3D:positions"), dtype=float) for path in ("place", "optimal")
    )
    assert place.shape == best.shape == (30, 10, 3)
    off = np.array(column(chunks, "/metrics/localization", "Scalars:scalars"), dtype=float)[:, 0]
    # Before anything was measured, there is no best answer.
    assert np.isnan(off[:5]).all()
    assert np.isfinite(off[20:]).all()
    here = np.sqrt(((place - best) ** 2).sum(axis=-1).mean(axis=-1))
    np.testing.assert_allclose(off[20:], here[20:], rtol=1e-4, atol=1e-6)
    assert off[20] > off[-1] > 0.0
    # They are drawn where agents are, and not at the origin of the common frame.
    moved = place[..., :2] - arrays["place"][:150:5]
    np.testing.assert_allclose(moved[20:], np.broadcast_to(moved[20:, :1], moved[20:].shape), atol=1e-5)
    away = np.linalg.norm(place[-1, :, :2] - arrays["position"][-1], axis=-1)
    assert away.max() < 3.0 < np.linalg.norm(arrays["place"][-1] - arrays["position"][-1], axis=-1).min()
    strips = column(chunks, "/swarm/measured", "LineStrips3D:strips")
    assert [len(moment) for moment in strips] == [28]
    assert {len(line) for line in strips[0]} == {25}


def test_a_recording_of_localization_goes_on_when_one_dies(tmp_path):
    dead = timeline({"verb": "kill", "at": 0.2, "agents": [4]})
    plan, out = plan_of("localization", "time.duration=0.4", dead), tmp_path / "run"
    fly(plan, "inprocess", out, lambda *_: None)
    chunks, arrays = recorded(out), dict(np.load(out / "arrays.npz"))
    told = np.array(column(chunks, "/metrics/localization", "Scalars:scalars"), dtype=float)[:, 0]
    kept = arrays["place"][:40:5]
    assert np.isnan(kept).any(axis=(1, 2)).tolist() == [False] * 4 + [True] * 4
    known = FirstMeasurements.of(plan.world, plan.timeline, arrays["measured"], arrays["fates"][:, 0])
    np.testing.assert_allclose(told, localization.distance(kept, known.edges()), rtol=1e-6)
    assert np.isfinite(told).all()
    place, best = (
        np.array(column(chunks, f"/swarm/{path}", "Points3D:positions"), dtype=float) for path in ("place", "optimal")
    )
    assert np.isfinite(best).all()
    assert np.isfinite(np.delete(place, 3, axis=1)).all()
    off = np.delete(place - best, 3, axis=1)[4:]
    np.testing.assert_allclose(np.sqrt((off**2).sum(axis=-1).mean(axis=-1)), told[4:], rtol=1e-4, atol=1e-5)


def test_a_distance_over_agents_is_that_of_those_who_say_anything():
    off = np.array([[[3.0, 4.0], [0.0, 0.0]], [[3.0, 4.0], [np.nan] * 2], [[np.nan] * 2] * 2])
    np.testing.assert_allclose(_over_agents(off), [np.sqrt(12.5), 5.0, np.nan])


# Over processes


@PROCESSES
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        (NAME, (*COARSE, "time.duration=0.5", "network.availability=0.9")),
        (NAME, (*COARSE, MEAN, FEW, "time.duration=0.3", "network.availability=0.7")),
        (NAME, (*CALM, "time.duration=0.3", "network.availability=0.7")),
        ("localization", ("time.duration=0.5", "network.availability=0.5")),
    ],
    ids=["target", "mean", "triple-integrators", "localization"],
)
def test_processes_give_the_bits_of_one_process(name, overrides, out):
    outcome = fly(plan_of(name, *overrides), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(name, *overrides)
    # Losses that do nothing agree as well.
    assert outcome.digest != digest_of(name, *overrides[:-1])
