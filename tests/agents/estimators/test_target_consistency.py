"""Over a thousand runs: estimates of a target are right on average, and as wrong as they say."""

from functools import cache

import numpy as np
import pytest
from targets import informed, target_of, watch

from agents.estimators.target import TargetEstimator
from analysis.models.pursuit import diffusion, transition

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
