"""Targets as they are found over many ticks and a thousand runs: agreed on, right on average, as wrong as said."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from briefs import brief
from targets import SMOOTH, agreed, informed, target_of, watch

from agents.brief import Own
from agents.estimators.target import TargetEstimator
from analysis.models.information import position, unpacked
from analysis.models.pursuit import Sighting, diffusion, transition
from netem.core.channels import TARGET

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
