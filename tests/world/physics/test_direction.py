"""A sensor of directions alone: unit vectors off by so many radians; the distance follows from how both ends fly."""

import numpy as np
import pytest
from flying import PROCESSES, plan_of

from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.side_by_side import side_by_side
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from analysis.models.sensor import Sensor

pytestmark = PROCESSES

BEARING = ("sensing={sigma_direction=0.01}", "agents.estimator=edge-kf")
SHORT = ("time.duration=1", "time.dt=0.02")
RNG = np.random.default_rng(11)


def directional(sigma, dimension):
    return Sensor("direction", sigma**2 * np.eye(dimension - 1))


@pytest.mark.parametrize("dimension", [2, 3])
def test_what_it_says_is_a_unit_vector_off_by_the_angle_drawn(dimension):
    true = RNG.normal(size=(500, dimension)) * 7.0
    noise = 0.2 * RNG.normal(size=(500, dimension - 1))
    said = directional(0.2, dimension).measured(true, noise)
    np.testing.assert_allclose(np.linalg.norm(said, axis=-1), 1.0, atol=1e-14)
    cosine = (said * true).sum(axis=-1) / np.linalg.norm(true, axis=-1)
    np.testing.assert_allclose(np.arccos(np.clip(cosine, -1.0, 1.0)), np.linalg.norm(noise, axis=-1), atol=1e-7)


@pytest.mark.parametrize("dimension", [2, 3])
def test_it_says_nothing_of_the_distance(dimension):
    sensor, true, noise = (
        directional(0.1, dimension),
        RNG.normal(size=(9, dimension)),
        RNG.normal(size=(9, dimension - 1)),
    )
    np.testing.assert_allclose(sensor.measured(100.0 * true, noise), sensor.measured(true, noise), atol=1e-14)
    np.testing.assert_allclose(sensor.exact(true), true / np.linalg.norm(true, axis=-1, keepdims=True), atol=1e-14)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_filter_is_told_where_across_the_line_of_sight_and_next_to_nothing_of_how_far(dimension):
    sensor, expected = directional(0.02, dimension), np.zeros(dimension)
    expected[0] = 4.0
    place, R = sensor.observed(sensor.measured(expected, np.full(dimension - 1, 0.01)), expected, np.eye(dimension))
    np.testing.assert_allclose(np.linalg.norm(place[1:]), 4.0 * np.sin(0.01 * np.sqrt(dimension - 1)), rtol=1e-9)
    np.testing.assert_allclose(place[0], 4.0)
    np.testing.assert_allclose(np.diag(R), [(1e3 * 4.0) ** 2, *[(0.02 * 4.0) ** 2] * (dimension - 1)])


def off(plan, first):
    """How far estimated edges are from true ones, from a tick on, shape (T, edges)."""
    arrays, links = rehearse(plan).arrays, plan.world.links
    position = arrays["position"][:-1]
    true = position[:, :, None] - position[:, links.neighbours]
    return np.linalg.norm(arrays["estimate"] - true, axis=-1)[first:, links.present]


def test_filters_find_the_distance_where_neighbours_fly_across_the_line_of_sight():
    plan = plan_of("corridor", *BEARING, "network.availability=1.0", "time.duration=20")
    begun, flown = off(plan, 0)[0], off(plan, 1900).mean(axis=0)
    followers = ~np.isin(plan.world.links.src, (1, 2, 3)) | ~np.isin(plan.world.links.dst, (1, 2, 3))
    assert begun[followers].mean() > 0.4
    assert flown[followers].mean() < 0.1
    assert flown.max() < 0.5


@pytest.mark.parametrize("body", [(), ("dynamics.model=unicycle", "dynamics.ahead=0.3")])
def test_a_formation_flies_by_directions_in_both_runtimes_with_the_same_bits(out, body):
    plan = plan_of("corridor", *BEARING, *SHORT, *body)
    one, many = (fly(plan, runtime, out / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert one.verdict == many.verdict == "pass", (one.reasons, many.reasons)
    assert one.digest == many.digest


def test_it_flies_in_three_dimensions_and_side_by_side():
    plan = plan_of("ravine", "sensing={sigma_direction=0.01}", "agents.estimator=edge-kf", "time.duration=0.2", *SINGLE)
    seeds = [plan.scenario.seed + 1, plan.scenario.seed]
    both, alone = (rehearse(one).arrays["measured"] for one in (side_by_side(plan, seeds), plan))
    np.testing.assert_array_equal(both[:, len(plan.world.links) :], alone)
    np.testing.assert_allclose(np.linalg.norm(alone, axis=-1), 1.0)


SINGLE = ("dynamics.model=single-integrator", "agents.law=static", "agents.parameters={}")


def test_a_sensor_that_freezes_before_it_has_seen_anything_says_a_direction():
    frozen = {"verb": "freeze", "at": 0.0, "links": ["all"]}
    plan = planning.make(loading.extended(loading.load("corridor", (*BEARING, *SHORT)), [frozen]))
    np.testing.assert_allclose(np.linalg.norm(rehearse(plan).arrays["measured"], axis=-1), 1.0)


POSITIONS = ("none", "mle", "rkf", "ral", "conral", "ga-rkf", "imm", "mmse", "joint-kf", "silent-kf", "crkf")


@pytest.mark.parametrize("estimator", POSITIONS)
def test_estimators_that_want_positions_are_refused(estimator):
    with pytest.raises(ScenarioError, match=r"agents: .* this sensor says the direction alone; choose 'edge-kf'"):
        planning.make(loading.load("corridor", (*BEARING, f"agents.estimator={estimator}")))


def test_localization_by_directions_is_refused():
    with pytest.raises(PlanError, match="the sensor says directions alone"):
        planning.make(loading.load("localization", ("sensing={sigma_direction=0.01}",)))


@pytest.mark.parametrize("fault", [{"verb": "bias", "by": [1.0, 0.0]}, {"verb": "outlier", "p": 0.5, "sigma": 1.0}])
def test_faults_in_metres_are_refused(fault):
    given = loading.extended(loading.load("corridor", BEARING), [fault | {"at": 0.5, "links": ["1-2"]}])
    with pytest.raises(
        ScenarioError, match=r"timeline\.1: (bias|outlier) is in metres, and sensors here say directions"
    ):
        planning.make(given)
