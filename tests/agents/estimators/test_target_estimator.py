"""One agent and its detector: what it finds of a target, against textbooks and finite differences."""

from dataclasses import replace
from math import factorial

import numpy as np
import pytest
from briefs import brief
from numpy.polynomial import polynomial
from targets import OPTIMAL, ORDERS, SMOOTH, Textbook, informed, target_of, van_loan, watch

from agents.brief import Own
from agents.estimators.target import TargetEstimator
from analysis.models.information import packed, unpacked
from analysis.models.pursuit import Sighting, transition


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
@pytest.mark.parametrize(
    "estimator",
    [
        *(pytest.param(replace(SMOOTH, alpha=alpha), id=f"SOE {alpha:g}") for alpha in (0.1, 1.0, 10.0)),
        *(pytest.param(replace(SMOOTH, output=output), id=output) for output in ("spline", "low-pass")),
    ],
)
def test_a_detection_that_is_taken_in_changes_no_derivative_of_the_smooth_output(order, estimator):
    target, taken = target_of(order), 0
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


def test_what_a_target_estimator_knows_of_neighbours_is_nothing():
    (one, *_) = watch(SMOOTH, target_of(), ticks=1)
    assert not one.estimate.known.any()
    assert np.isnan(one.estimate.psi).all()
