"""Inputs nobody says: those inferred from how edges move, and models fitted to recorded ones."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.wrong import ScenarioError
from agents.brief import Own
from agents.estimators.silent import SilentEdgeFilter
from agents.exchange import Heard
from analysis.models.autoregressive import fit
from netem.core.channels import INPUT

COARSE = ("time.dt=0.01", "record.enabled=false")


QUIET = {INPUT: Heard({"velocity": np.zeros((8, 2))}, np.zeros(8, dtype=bool))}


def chased(window=1, coefficient=1.0, sigma_u=1e6, ticks=40, flown=(0.3, -0.2), own=(0.5, 0.1)):
    """The belief about a neighbour that flies steadily, seen by precise sensors, in the last of some ticks."""
    plan = plan_of("rigid", "dynamics={}", "sensing={sigma=1e-5}", 'agents.estimator="silent-kf"')
    brief = plan.brief.of(0)
    slots = len(brief.present)
    estimator = SilentEdgeFilter(coefficient=coefficient, sigma_u=sigma_u, window=window)
    state = estimator.init(brief, ())
    true = np.zeros((slots, 2))
    for _ in range(ticks):
        state, _ = estimator.sense(brief, state, true, brief.present)
        state, estimate = estimator.fuse(brief, state, QUIET, Own(np.array(own), np.array(own)))
        true = true + brief.dt * (np.array(own) - np.array(flown))
    return brief, estimator, state, estimate


@pytest.mark.parametrize("window", [1, 5])
def test_what_a_neighbour_flies_shows_in_how_its_edge_moves(window):
    brief, estimator, state, _ = chased(window)
    theirs, doubt = estimator._neighbours(brief, state.past)
    np.testing.assert_allclose(theirs[brief.present], np.broadcast_to([0.3, -0.2], (brief.present.sum(), 2)), atol=0.02)
    assert (np.linalg.eigvalsh(doubt[brief.present]) > 0.0).all()


def test_a_longer_window_is_surer_of_it():
    doubts = []
    for window in (1, 5):
        brief, estimator, state, _ = chased(window)
        doubts.append(np.trace(estimator._neighbours(brief, state.past)[1][0]))
    assert doubts[1] < doubts[0] / 5


def test_noisy_guesses_shrink_toward_rest_and_leave_the_doubt_that_was_there():
    brief, estimator, state, _ = chased(coefficient=0.8, sigma_u=1e-4)
    theirs, doubt = estimator._neighbours(brief, state.past)
    assert np.abs(theirs).max() < 1e-3
    np.testing.assert_allclose(doubt[0], 1e-8 * np.eye(2), rtol=1e-2)


def test_a_window_counts_ticks_from_one():
    with pytest.raises(ScenarioError, match=r"agents.parameters.silent-kf: window counts ticks, from 1; got 0"):
        plan_of("rigid", 'agents.estimator="silent-kf"', "agents.parameters.silent-kf.window=0")


@pytest.mark.parametrize("estimator", ["silent-kf", "edge-kf", "joint-kf", "crkf"])
def test_accelerations_are_refused(estimator):
    with pytest.raises(ScenarioError, match="it is for single integrators"):
        plan_of("ravine", f'agents.estimator="{estimator}"')


# ---- models of inputs


@pytest.mark.parametrize("coefficients", [(0.81,), (0.6, 0.3)])
def test_yule_walker_finds_the_model_that_made_the_signals(coefficients):
    rng, order = np.random.default_rng(1), len(coefficients)
    signals = np.zeros((20_000, 5, 2))
    for tick in range(order, len(signals)):
        past = sum(a * signals[tick - lag] for lag, a in enumerate(coefficients, start=1))
        signals[tick] = past + 0.2 * rng.standard_normal((5, 2))
    model = fit(signals, order)
    assert model.coefficients == pytest.approx(coefficients, abs=0.01)
    assert model.sigma_n == pytest.approx(0.2, rel=0.01)
    assert model.sigma_u == pytest.approx(signals[1000:].std(), rel=0.05)


def test_a_recorded_run_can_be_fitted():
    inputs = rehearse(plan_of("rigid", *COARSE, "time.duration=3")).arrays["input"]
    model = fit(inputs, 1)
    assert 0.5 < model.coefficients[0] < 1.0
    assert model.sigma_n < model.sigma_u


@pytest.mark.parametrize(
    ("signals", "match"), [(np.ones((2, 3)), "needs more than 2 ticks"), (np.zeros((9, 3)), "nothing to fit")]
)
def test_what_cannot_be_fitted_is_said(signals, match):
    with pytest.raises(ValueError, match=match):
        fit(signals, 2)
