"""Ranges, bearings and lines of sight as they are flown: estimators are as wrong as they say."""

from dataclasses import replace

import numpy as np
import pytest
from flying import PROCESSES, plan_of

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.side_by_side import side_by_side
from affinet.studies.batch import fly_all
from analysis.metrics.consistency import nees
from analysis.models.sensor import Sensor
from world.books.history import History

SHARP = "sensing={ sigma_range = 0.05, sigma_bearing = 0.02 }"
COARSE = ("time.dt=0.01", "record.enabled=false")
FILTERS = ["none", "mle", "rkf", "imm", "mmse", "edge-kf", "joint-kf", "silent-kf", "crkf"]


@pytest.mark.parametrize("estimator", FILTERS)
def test_estimators_fly_with_ranges_and_bearings(estimator):
    over = (*COARSE, "time.duration=1", SHARP, f'agents.estimator="{estimator}"')
    plan = plan_of("rigid", *over, "dynamics={}")
    arrays, links = rehearse(plan).arrays, plan.world.links
    for name in ("position", "input", "estimate", "covariance", "measured"):
        assert np.isfinite(arrays[name]).all(), name
    assert arrays["known"][:, links.present].all()
    # They believe what is measured: they are wrong by centimetres, and the filters at last by less than a measurement.
    position = arrays["position"][:-1]
    off = (arrays["estimate"] - (position[:, :, None] - position[:, links.neighbours]))[-1, links.present]
    measured = (arrays["measured"][:, links.slots] - (position[:, :, None] - position[:, links.neighbours]))[-1]
    wrong, noise = np.square(off).sum(), np.square(measured[links.present]).sum()
    assert wrong == noise if estimator in ("none", "mle") else 0 < wrong < noise


@PROCESSES
def test_over_processes_ranges_and_bearings_give_the_bits_of_one_process(tmp_path):
    lossy = ("network.availability=0.7", 'agents.estimator="rkf"')
    plan = plan_of("ravine", *COARSE, "time.duration=0.25", SHARP, *lossy)
    one, many = (fly(plan, runtime, tmp_path / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert many.verdict == "pass", many.reasons
    assert one.digest == many.digest


# Nobody is pushed, so that measurements alone make the filters wrong; they begin as good as ignorant.
STILL = (*COARSE, "time.duration=0.2", "dynamics={}", 'formation.start="targets"', "formation.spread=0.1")
EDGES = ('agents.estimator="edge-kf"', "agents.parameters.edge-kf={ prior_position = 10.0 }")


def believing(plan, sensor):
    """The plan with agents who believe that their sensors are these."""
    return replace(plan, brief=replace(plan.brief, sensor=sensor))


def test_filters_of_ranges_and_bearings_are_as_wrong_as_they_say():
    plan = plan_of("rigid", *STILL, *EDGES, SHARP)
    runs = fly_all(plan, range(1, 81), 1)
    error = runs.quantities["nees"].std(axis=0) / np.sqrt(80)
    assert (np.abs(runs.quantities["nees"].mean(axis=0) - 2.0) < 4 * error).all()
    assert error.max() < 0.05
    # The first innovation is that of the prior, which is wider than the formation.
    assert (np.abs(runs.quantities["nis"][:, 1:].mean(axis=0) - 2.0) < 0.15).all()
    deluded = fly_all(believing(plan, Sensor("coordinates", 0.05**2 * np.eye(2))), range(1, 81), 1)
    assert (deluded.quantities["nees"].mean(axis=0) > 2.2).all()


def test_no_covariance_for_all_is_right_for_near_and_far_neighbours():
    plan = plan_of("rigid", *STILL, *EDGES, SHARP)
    links = plan.world.links
    reach = np.linalg.norm(plan.brief.relative[links.present], axis=-1)
    near, far = reach < 2.5, reach > 3.5
    assert near.sum() > 10 < far.sum()
    mean = plan.world.sensor.spread(plan.brief.relative[links.present]).mean(axis=0)
    found = []
    for believed in (plan.world.sensor, Sensor("coordinates", mean)):
        batch = side_by_side(believing(plan, believed), range(1, 61))
        flown = History(batch.world, len(batch.channels), batch.reports)
        InProcessSwarm(batch).fly(flown.extend, 20)
        arrays, neighbours = flown.arrays(), batch.world.links.neighbours
        position = arrays["position"][-2]
        off = arrays["estimate"][-1] - (position[:, None] - position[neighbours])
        wrong = nees(off[batch.world.links.present], arrays["covariance"][-1][batch.world.links.present])
        of_runs = wrong.reshape(60, len(links))
        found.append((of_runs[:, near].mean(), of_runs[:, far].mean()))
    np.testing.assert_allclose(found[0], [2.0, 2.0], rtol=0.1)
    assert found[1][0] < 1.8
    assert found[1][1] > 2.4


@pytest.mark.parametrize(
    "sensing", ["sensing={sigma_range=0.1, sigma_bearing=0.2}", "sensing={sigma_along=0.15, sigma_across=0.1}"]
)
@pytest.mark.parametrize("estimator", ["edge-kf", "joint-kf", "crkf"])
def test_a_measurements_weight_does_not_come_from_its_own_noise(estimator, sensing):
    """Before: NEES of 37 to 120, and twice to six times the error; the innovations did not show it."""
    over = (f'agents.estimator="{estimator}"', "time.dt=0.02", "time.duration=4", sensing)
    found = fly_all(plan_of("rigid", *over), range(1, 9), 10).quantities
    settled = {name: found[name][:, 10:].mean() for name in ("nees", "nis", "estimation_error")}
    assert 1.7 < settled["nees"] < 2.3
    assert 1.8 < settled["nis"] < 2.2
    assert settled["estimation_error"] < 0.26
