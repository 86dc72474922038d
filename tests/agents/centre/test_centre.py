"""The centralized filter: that of paper 001 in its own terms, the best there is, and a process of its own."""

import numpy as np
import pytest
from briefs import of_all
from flying import PROCESSES, plan_of
from scipy.linalg import block_diag

from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario.wrong import ScenarioError
from affinet.studies.batch import fly_all
from agents.estimators.centralized import SwarmFilter
from analysis.models.sensor import Sensor
from netem.core.links import Links
from world.formation.nominal import PRESETS

HEXA = PRESETS["hexa10"]
LINKS = Links.both_ways(HEXA.agents, HEXA.edges)
COARSE = ("time.dt=0.01", "record.enabled=false")


RANGING = Sensor("range-bearing", np.diag([0.1, 0.3]) ** 2)


def centre(rng, dimension=2, noise=1.0, reader=None):
    between, sensor = rng.normal(size=(HEXA.agents, HEXA.agents)), rng.normal(size=(dimension, dimension))
    swarm = of_all(
        HEXA,
        sensor=reader or Sensor("coordinates", 0.01 * (sensor @ sensor.T + np.eye(dimension))),
        correlation=noise * between @ between.T,
        displacement=1e-3 * (sensor @ sensor.T + np.eye(dimension)),
    )
    return SwarmFilter(swarm, prior_position=1.5)


class Printed:
    """(9a)-(9g) as printed: the state is that of all edges, and its covariance is singular."""

    def __init__(self, filtered, dimension=2):
        edges = [(i, j) for i in range(HEXA.agents) for j in LINKS.neighbours[i, LINKS.present[i]]]
        B = np.zeros((HEXA.agents, len(edges)))
        for column, (i, j) in enumerate(edges):
            B[i, column], B[j, column] = 1.0, -1.0
        self.lifted = np.kron(B, np.eye(dimension)).T
        self.filtered = filtered
        self.x = np.zeros(len(self.lifted))
        self.covariance = filtered.prior_position**2 * self.lifted @ self.lifted.T

    def step(self, y, seen, u):
        x = self.x + self.filtered.swarm.dt * self.lifted @ u.ravel()
        covariance = self.covariance + self.lifted @ self.filtered.swarm.process @ self.lifted.T
        H = np.eye(len(x))[np.repeat(seen, len(self.filtered.swarm.sensor.covariance))]
        doubts = np.einsum("aiaj->aij", covariance.reshape(60, 2, 60, 2))[seen]
        R = block_diag(*self.filtered.swarm.sensor.observed(y[seen], x.reshape(60, 2)[seen], doubts)[1])
        K = covariance @ H.T @ np.linalg.inv(H @ covariance @ H.T + R)
        self.x = x + K @ (y[seen].ravel() - H @ x)
        self.covariance = covariance - K @ H @ covariance


@pytest.mark.parametrize("reader", [None, RANGING], ids=["coordinates", "range-bearing"])
@pytest.mark.parametrize("availability", [1.0, 0.4])
def test_it_tells_what_the_filter_of_all_edges_would(availability, reader):
    rng = np.random.default_rng(1)
    filtered = centre(rng, reader=reader)
    printed, state = Printed(filtered), filtered.begin(())
    # The printed state is singular; where R depends on what is expected, that adds up.
    near = 1e-9 if reader is None else 1e-3
    for _ in range(25):
        seen = LINKS.present & (rng.random(LINKS.present.shape) < availability)
        measured, inputs = rng.normal(size=(*seen.shape, 2)), rng.normal(size=(HEXA.agents, 2))
        state, told = filtered.step(state, np.where(seen[..., None], measured, 0.0), seen, inputs)
        printed.step(measured[LINKS.present], seen[LINKS.present], inputs)
        np.testing.assert_allclose(told.relative[LINKS.present].ravel(), printed.x, atol=near)
        blocks = np.einsum("aibi->abi", printed.covariance.reshape(60, 2, 60, 2))[np.arange(60), np.arange(60)]
        variances = np.einsum("eii->ei", told.covariance[LINKS.present])
        np.testing.assert_allclose(variances, blocks, atol=near)


def test_swarms_side_by_side_are_told_what_each_is_told_alone():
    rng = np.random.default_rng(2)
    filtered = centre(rng)
    seen = LINKS.present & (rng.random((4, 3, *LINKS.present.shape)) < 0.6)
    measured, inputs = rng.normal(size=(4, 3, *LINKS.present.shape, 2)), rng.normal(size=(4, 3, HEXA.agents, 2))
    state = filtered.begin((3,))
    alone = [filtered.begin(()) for _ in range(3)]
    for tick in range(4):
        state, told = filtered.step(state, measured[tick], seen[tick], inputs[tick])
        for run in range(3):
            alone[run], one = filtered.step(alone[run], measured[tick, run], seen[tick, run], inputs[tick, run])
            assert one.relative.tobytes() == told.relative[run].tobytes()
            assert one.covariance.tobytes() == told.covariance[run].tobytes()


def test_its_covariance_is_the_lowest_at_every_tick_of_a_noisy_run():
    traces = {}
    for estimator in ("crkf", "joint-kf", "edge-kf", "mle"):
        plan = plan_of("rigid", *COARSE, "time.duration=1", f'agents.estimator="{estimator}"')
        traces[estimator] = fly_all(plan, [1, 2], 1).quantities["covariance_trace"]
    for worse in ("joint-kf", "edge-kf", "mle"):
        assert (traces["crkf"] < traces[worse]).all()
    assert (traces["joint-kf"][:, 50:] < traces["edge-kf"][:, 50:]).all()


def test_its_errors_are_as_large_as_its_covariance_says():
    plan = plan_of("rigid", *COARSE, "time.duration=3", 'agents.estimator="crkf"')
    runs = fly_all(plan, range(1, 21), 1)
    squared = (runs.quantities["estimation_error"][:, 100:] ** 2).mean()
    assert squared == pytest.approx(runs.quantities["covariance_trace"][:, 100:].mean(), rel=0.1)


def test_it_hears_past_the_medium_what_is_lost_between_agents():
    deaf = ("network.coupled=false", 'network.links=[{links="all",channels="comms",availability=0.01}]')
    short = (*COARSE, "time.duration=0.3", 'agents.estimator="crkf"')
    heard, lost = (rehearse(plan_of("rigid", *short, *over)).arrays["estimate"] for over in ((), deaf))
    np.testing.assert_array_equal(heard, lost)


@pytest.mark.parametrize("verb", ["kill", "pause"])
def test_nobody_can_be_killed_or_paused_while_it_waits_for_everybody(verb):
    with pytest.raises(ScenarioError, match="timeline: the centralized filter waits for every agent"):
        plan_of("rigid", 'agents.estimator="crkf"', f'timeline=[{{verb="{verb}",at=0.1,agents=[3]}}]')


@PROCESSES
@pytest.mark.parametrize("air", [(), ("network.availability=0.6", "network.delay_ticks=1")], ids=["clear", "lossy"])
def test_over_processes_it_gives_the_bits_of_one_process(air, tmp_path):
    plan = plan_of("rigid", *COARSE, "time.duration=0.25", 'agents.estimator="crkf"', *air)
    one, many = (fly(plan, runtime, tmp_path / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert many.verdict == "pass", many.reasons
    assert one.digest == many.digest
    assert [process["role"] for process in many.processes].count("centre") == 1
