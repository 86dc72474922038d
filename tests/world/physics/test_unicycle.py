"""Unicycles: an exact arc in every tick, a formation that flies on wheels, the same bits in both runtimes."""

from dataclasses import replace

import numpy as np
import pytest
from flying import PROCESSES, plan_of
from scipy.integrate import solve_ivp

from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.side_by_side import side_by_side
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from world.physics.bodies import Motion, Unicycle

pytestmark = PROCESSES

WHEELS = ("dynamics.model=unicycle", "dynamics.ahead=0.3")
SHORT = ("time.duration=1", "time.dt=0.02")
RNG = np.random.default_rng(4)


def at(heading, position=None):
    heading = np.asarray(heading, dtype=np.float64)
    here = np.zeros((len(heading), 2)) if position is None else position
    return Motion(here, np.zeros((len(heading), 1, 2)), heading[:, None])


def rolled(now, flown, push=0.0, dt=0.1, ahead=0.3):
    return Unicycle(ahead).moved(now, flown, np.broadcast_to(push, flown.shape), dt)


def test_a_tick_is_the_arc_that_speed_and_turn_rate_make_when_held():
    headings, flown = RNG.uniform(-np.pi, np.pi, 20), RNG.normal(size=(20, 2))
    got = rolled(at(headings), flown)
    for row, (heading, u) in enumerate(zip(headings, flown, strict=True)):
        speed = u @ [np.cos(heading), np.sin(heading)]
        turn = u @ [-np.sin(heading), np.cos(heading)] / 0.3

        def moves(_, state, speed=speed, turn=turn):
            return [speed * np.cos(state[2]), speed * np.sin(state[2]), turn]

        end = solve_ivp(moves, (0.0, 0.1), [0.0, 0.0, heading], rtol=1e-11, atol=1e-12).y[:, -1]
        np.testing.assert_allclose([*got.position[row], got.pose[row, 0]], end, atol=1e-9)


def test_the_point_ahead_moves_as_it_is_told():
    headings, flown = RNG.uniform(-np.pi, np.pi, 20), RNG.normal(size=(20, 2))

    def point(motion):
        return motion.position + 0.3 * np.concatenate([np.cos(motion.pose), np.sin(motion.pose)], axis=1)

    now = at(headings)
    velocity = (point(rolled(now, flown, dt=1e-6)) - point(now)) / 1e-6
    np.testing.assert_allclose(velocity, flown, atol=1e-4)


def test_it_never_slides_sideways_and_tells_the_velocity_it_had():
    now, flown = at(RNG.uniform(-np.pi, np.pi, 20)), RNG.normal(size=(20, 2))
    got = rolled(now, flown, push=0.0)
    mean = (now.pose + got.pose)[:, 0] / 2.0
    across = got.position[:, 0] * -np.sin(mean) + got.position[:, 1] * np.cos(mean)
    np.testing.assert_allclose(across, 0.0, atol=1e-15)
    np.testing.assert_allclose(got.derivatives[:, 0] * 0.1, got.position, atol=1e-15)


def test_a_gust_carries_it_sideways_and_its_wheels_do_not_notice():
    now, push = at([0.0]), np.array([[0.0, 2.0]])
    blown = rolled(now, np.array([[1.0, 0.0]]), push=push)
    np.testing.assert_allclose(blown.position, [[0.1, 0.2]])
    np.testing.assert_allclose(blown.derivatives[:, 0], [[1.0, 0.0]])


@pytest.mark.parametrize("estimator", ["ga-rkf", "edge-kf", "crkf"])
def test_a_formation_flies_on_wheels_in_both_runtimes_with_the_same_bits(out, estimator):
    plan = plan_of("corridor", *WHEELS, *SHORT, f"agents.estimator={estimator}")
    one, many = (fly(plan, runtime, out / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert one.verdict == many.verdict == "pass", (one.reasons, many.reasons)
    assert one.digest == many.digest
    assert one.digest != rehearse(plan_of("corridor", *SHORT, f"agents.estimator={estimator}")).outcome.digest


def test_runs_on_wheels_side_by_side_are_those_flown_alone():
    plan = plan_of("corridor", *WHEELS, *SHORT)
    seeds = [plan.scenario.seed + 1, plan.scenario.seed]
    both, alone = (rehearse(one).arrays["position"] for one in (side_by_side(plan, seeds), plan))
    np.testing.assert_array_equal(both[:, 7:], alone)


def test_the_formation_holds_its_shape_on_wheels():
    arrays = rehearse(plan_of("corridor", *WHEELS, "time.duration=30", "network.availability=1.0")).arrays
    assert arrays["error"][0] > 0.5
    assert arrays["error"][-500:].max() < 0.1


def test_filters_that_predict_by_velocities_are_told_those_of_the_wheels():
    quiet = ("sensing.sigma=1e-6", "network.availability=1.0", "time.duration=2", "agents.estimator=edge-kf")
    heard = rehearse(plan_of("corridor", *WHEELS, *quiet))
    plan, arrays = plan_of("corridor", *WHEELS, *quiet), heard.arrays
    blind = 2  # ticks from the start: from then on, what was measured and predicted is where it is
    links = plan.world.links
    true = (arrays["position"][:-1, :, None] - arrays["position"][:-1][:, links.neighbours])[blind:, links.present]
    predicted = (arrays["estimate"][blind - 1 : -1] + 0.01 * _told(arrays, links)[blind - 1 : -1])[:, links.present]
    np.testing.assert_allclose(predicted, true, atol=1e-4)


def _told(arrays, links):
    velocity = np.diff(arrays["position"], axis=0) / 0.01
    return velocity[:, :, None] - velocity[:, links.neighbours]


def test_a_warm_restart_and_faults_of_bodies_fly_on_wheels(out):
    timeline = [
        {"verb": "gust", "at": 0.1, "until": 0.3, "agents": [4], "velocity": [0.0, 1.0]},
        {"verb": "pause", "at": 0.2, "until": 0.4, "agents": [5]},
        {"verb": "depart", "at": 0.3, "until": 0.5, "agents": [6], "body": "drift"},
        {"verb": "kill", "at": 0.3, "agents": [7]},
        {"verb": "restart", "at": 0.6, "agents": [7], "state": "warm"},
    ]
    plan = planning.make(loading.extended(loading.load("corridor", (*WHEELS, *SHORT)), timeline))
    one, many = (fly(plan, runtime, out / runtime, lambda *_: None) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest
    assert one.verdict == "pass", one.reasons
    position = rehearse(plan).arrays["position"]
    assert np.ptp(position[16:30, 6], axis=0).max() == 0.0  # dead: it holds
    assert np.ptp(position[16:20, 5], axis=0).max() > 0.0  # adrift


REFUSALS = [
    (("dynamics.model=unicycle",), "dynamics: a unicycle needs ahead (m)"),
    (("dynamics.ahead=0.3",), "dynamics: ahead is of a unicycle, not of a single-integrator"),
    ((*WHEELS, "agents.law=double-varying-velocity"), "bodies are unicycles; set it to 'double-integrator'"),
    (("dynamics.model=unicycle", "dynamics.ahead=0.0"), "dynamics.ahead: should be greater than 0"),
]


@pytest.mark.parametrize(("overrides", "says"), REFUSALS)
def test_what_does_not_fit_wheels_is_refused(overrides, says):
    with pytest.raises(ScenarioError) as caught:
        planning.make(loading.load("corridor", overrides))
    assert says in str(caught.value)


def test_wheels_are_for_the_plane():
    flat = ("agents.law=static", "agents.parameters={}", *WHEELS)
    with pytest.raises((ScenarioError, PlanError), match="moves in 2 dimensions, and the formation has 3"):
        planning.make(loading.load("ravine", flat))


def test_the_world_takes_the_body_it_is_given():
    world = plan_of("corridor", *WHEELS).world
    assert world.odometry(world.begin()).shape == (7, 1, 2)
    single = replace(world, body=plan_of("corridor").world.body)
    assert single.odometry(single.begin()) is None
