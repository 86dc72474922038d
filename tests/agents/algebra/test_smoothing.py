"""A spline and a low-pass filter in place of the smooth output (paper 002, remark 3), against SciPy's."""

from math import factorial

import numpy as np
import pytest
from scipy import signal
from scipy.interpolate import BPoly
from targets import OPTIMAL, ORDERS, target_of, watch

from agents.algebra import prediction, smoothing
from agents.estimators.target import TargetEstimator
from analysis.models.information import packed, unpacked

DT = 0.05
SPLINE = TargetEstimator("spline", fusion="none")
LOW_PASS = TargetEstimator("low-pass", fusion="none", lag=0.13)


def said(flown, order):
    """Jets of the information of one agent tick by tick, shape (T, m + 1, C)."""
    assert flown[0].estimate.reports["information"].shape[1] == order + 1
    return np.stack([one.estimate.reports["information"][0] for one in flown])


def sample(target, one):
    """The jet of the optimal information where it was last found."""
    last = one.state.last
    return np.asarray(packed(*prediction.predicted(target, last, last.made, DT)))[:, 0]


@ORDERS
def test_the_spline_is_the_polynomial_that_scipy_puts_through_both_samples_and_their_derivatives(order):
    target = target_of(order)
    flown = list(watch(SPLINE, target, ticks=90, seed=order))
    found, done = said(flown, order), [0] + [tick for tick, one in enumerate(flown) if one.sighting.done[0]]
    assert len(done) > 4
    for number in range(2, len(done) - 1):
        begun, over = done[number], done[number + 1]
        older, newer = sample(target, flown[done[number - 1]]), sample(target, flown[begun])
        book = BPoly.from_derivatives([begun * DT, over * DT], np.stack([older, newer]))
        for tick in range(begun, over):
            for derivative in range(order + 1):
                expected = (book.derivative(derivative) if derivative else book)(tick * DT)
                scale = np.abs(found[done[number] : over, derivative]).max(axis=0)
                np.testing.assert_allclose(found[tick, derivative], expected, rtol=1e-7, atol=1e-8 * scale.max())


@ORDERS
def test_the_low_pass_filter_is_scipys_with_as_many_equal_lags_as_there_are_derivatives_and_one(order):
    target = target_of(order)
    flown = list(watch(LOW_PASS, target, ticks=90, seed=order))
    optimal = said(list(watch(OPTIMAL, target, ticks=90, seed=order)), order)[:, 0]
    lags = order + 1
    poles = [-1.0 / LOW_PASS.lag] * lags
    continuous = signal.StateSpace(*signal.zpk2ss([], poles, (1.0 / LOW_PASS.lag) ** lags))
    A, B, C, *_ = signal.cont2discrete((continuous.A, continuous.B, continuous.C, continuous.D), DT)
    # At rest with what was known in tick 0.
    held = np.linalg.solve(np.eye(lags) - A, B) @ optimal[:1]
    for tick, one in enumerate(said(flown, order)):
        if tick:
            held = A @ held + B @ optimal[tick - 1 : tick]
        rate = C
        for derivative in range(lags):
            expected = (rate @ held)[0]
            np.testing.assert_allclose(one[derivative], expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max() + 1e-9)
            rate = rate @ continuous.A


def test_a_filter_whose_input_rests_says_what_enters_and_no_change():
    entering = np.array([3.0, -2.0])
    stages = np.zeros((4, 2))
    for _ in range(400):
        stages = smoothing.lagging(stages, entering, 0.3)
    found = smoothing.last_of(stages, 1.0 / 0.3)
    np.testing.assert_allclose(found[0], entering, rtol=1e-12)
    np.testing.assert_allclose(found[1:], 0.0, atol=1e-9)


def test_a_tick_far_longer_than_the_lag_lets_all_through():
    stages = smoothing.lagging(np.zeros((3, 1)), np.array([7.0]), 1e6)
    np.testing.assert_array_equal(stages, 7.0)


@pytest.mark.parametrize("orders", [1, 2, 3, 5])
def test_a_polynomial_of_the_splines_degree_is_its_own_spline(orders):
    rng, seconds = np.random.default_rng(orders), 0.7
    own = np.polynomial.Polynomial(rng.normal(size=2 * orders))
    taken = [(own.deriv(number) if number else own) for number in range(orders)]

    def jet(at):
        return np.array([one(at) for one in taken])[:, None, None]

    for passed in (0.0, 0.3, 1.0):
        found = smoothing.splined(
            jet(0.0), jet(seconds), smoothing.counts(np.float64(passed), np.float64(seconds), len(jet(0.0)) - 1)
        )
        np.testing.assert_allclose(found, jet(passed * seconds), rtol=1e-9, atol=1e-9 * factorial(2 * orders))


@pytest.mark.parametrize("estimator", [SPLINE, LOW_PASS], ids=["spline", "low-pass"])
def test_both_come_late_by_what_they_wait_for(estimator):
    # A target that flies straight and is seen exactly: what lags is behind it by its speed times the lag.
    target = target_of(2, (10,), (1e-6,), intensity=1e-6)
    flown = list(watch(estimator, target, ticks=400, seed=4, prior=(1.0, 3.0)))
    best = list(watch(OPTIMAL, target, ticks=400, seed=4, prior=(1.0, 3.0)))
    speed = np.linalg.norm(flown[-1].truth[0, 1])
    waits = {"spline": 10 * DT, "low-pass": 3 * LOW_PASS.lag}[estimator.output]
    assert speed > 1.0
    assert off(best[200:]) < 0.1 * speed * waits < 0.5 * off(flown[200:])


def off(flown):
    """Mean distance of what is found from the target, in metres."""
    return np.mean([np.linalg.norm(one.estimate.reports["found"][0] - one.truth[0, 0]) for one in flown])


@pytest.mark.parametrize("estimator", [SPLINE, LOW_PASS], ids=["spline", "low-pass"])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_what_is_put_out_is_the_information_of_something(order, estimator):
    flown = list(watch(estimator, target_of(order), ticks=300, runs=20, seed=order))
    Q, _ = unpacked(np.stack([one.estimate.reports["information"][:, 0] for one in flown]), 2, order)
    assert np.linalg.eigvalsh(Q).min() > 0.0
