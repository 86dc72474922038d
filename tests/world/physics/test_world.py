"""The world: what is sensed, and where the agents are in the next tick."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import expm

from affinet.scenario.bodies import INTEGRATORS
from analysis.models.sensor import Sensor
from netem.core.links import Links
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from world.formation.manoeuvre import corridor, hover
from world.formation.nominal import PRESETS, Formation
from world.physics import sensors
from world.physics.bodies import BodyModel, Integrators, Motion, carried
from world.physics.disturbance import Disturbance
from world.physics.world import Scene, World

ZHAO7 = PRESETS["zhao7"]
SEVEN = Links.both_ways(7, ZHAO7.edges)
REST = np.zeros((7, 2))
NOWHERE = np.zeros((7, 0))  # what integrators have of a pose
UNSEEN = np.zeros((len(SEVEN), 2))
BEFORE = np.full((len(SEVEN), 2), 77.0)
GONE = (4, 7)
ABSENT = np.isin(np.arange(1, 8), GONE)


def integrators(order):
    return BodyModel(INTEGRATORS[order - 1], {})


def under(*faults, links=SEVEN):
    """The conditions of the first tick."""
    return Timeline(links, faults).at(0)


QUIET = under()


def scene(position, velocity=REST, measured=UNSEEN, higher=()):
    """Bodies here and so fast; `higher` are derivatives of the velocity, of integrators that have any."""
    return Scene(position, np.stack([velocity, *higher], axis=1), measured, np.zeros_like(position), None, NOWHERE)


def few_at_rest():
    return Scene(REST[:3], REST[:3, None], np.zeros((4, 2)), REST[:3], None, NOWHERE[:3])


def pushes(deviation):
    """Displacements of this deviation, of every agent and in every tick by itself."""
    return Disturbance(deviation**2 * np.eye(2), kernel=None, persistence=0.0)


def moved(world, tick, position, flown, *faults):
    """Where agents are a tick later."""
    return world.step(tick, scene(position), UNSEEN, flown, under(*faults)).position


@pytest.fixture
def world():
    return World(
        run_seed=1,
        swarm_seeds=None,
        dt=0.01,
        ticks=6000,
        body=integrators(1),
        formation=ZHAO7,
        links=SEVEN,
        manoeuvre=hover(np.arange(6001) * 0.01, 2),
        sensor=Sensor("coordinates", 0.01 * np.eye(2)),
        disturbance=pushes(0.0),
        pursuit=None,
        start="targets",
        spread=1.0,
        swarms=1,
        flight=None,
    )


def noise_of(world, ticks):
    z = ZHAO7.nominal
    true = z[world.links.dst - 1] - z[world.links.src - 1]
    return np.concatenate([world.measure(tick, scene(z), QUIET) - true for tick in ticks])


@pytest.mark.parametrize("R", [[[0.01, 0.0], [0.0, 0.01]], [[0.01, 0.003], [0.003, 0.01]], [[4.0, -1.0], [-1.0, 0.5]]])
def test_sensor_noise_has_the_covariance_asked_for(world, R):
    drawn = noise_of(replace(world, sensor=Sensor("coordinates", np.array(R))), range(4200))
    assert len(drawn) > 1e5
    scale = np.sqrt(np.outer(np.diag(R), np.diag(R)))
    np.testing.assert_allclose(np.cov(drawn.T) / scale, R / scale, atol=0.015)
    np.testing.assert_allclose(drawn.mean(axis=0) / np.sqrt(np.diag(R)), 0.0, atol=0.015)


def test_sensor_noise_of_a_tick_says_nothing_of_the_next_and_of_other_links(world):
    drawn = noise_of(world, range(4000)).reshape(4000, 24, 2) / 0.1
    assert abs((drawn[1:] * drawn[:-1]).mean()) < 0.01
    assert abs((drawn[:, 1:] * drawn[:, :-1]).mean()) < 0.01


def test_measured_is_the_position_relative_to_the_neighbour(world):
    exact = replace(world, sensor=Sensor("coordinates", 1e-24 * np.eye(2)))
    z = np.random.default_rng(1).normal(size=(7, 2))
    row = exact.links.index[4, 2]  # what 2 sees of 4
    np.testing.assert_allclose(exact.measure(0, scene(z), QUIET)[row], z[1] - z[3], atol=1e-10)


def test_noise_is_added_to_what_is_sensed_wherever_the_agents_are(world):
    z = np.random.default_rng(1).normal(size=(7, 2))
    apart = world.measure(3, scene(z), QUIET) - world.measure(3, scene(REST), QUIET)
    np.testing.assert_allclose(apart, z[world.links.dst - 1] - z[world.links.src - 1], atol=1e-12)


def test_noise_of_a_link_is_the_same_whatever_other_agents_exist(world):
    few = Formation(ZHAO7.nominal[:3], ((1, 2), (1, 3)), (1, 2, 3))
    small = replace(world, formation=few, links=Links.both_ways(3, few.edges))
    three, nothing = few_at_rest(), under(links=small.links)
    for tick in (0, 1, 64, 5000):
        large_noise, small_noise = world.measure(tick, scene(REST), QUIET), small.measure(tick, three, nothing)
        for link, row in small.links.index.items():
            assert small_noise[row].tobytes() == large_noise[world.links.index[link]].tobytes()


def test_noise_is_the_same_in_whatever_order_the_ticks_are_asked_for(world):
    here = scene(ZHAO7.nominal)
    forwards = {tick: world.measure(tick, here, QUIET).tobytes() for tick in (0, 5, 70, 200)}
    backwards = {tick: replace(world).measure(tick, here, QUIET).tobytes() for tick in (200, 70, 5, 0)}
    assert forwards == backwards
    assert len(set(forwards.values())) == 4


def test_another_seed_is_another_noise(world):
    assert not np.isclose(noise_of(world, [0]), noise_of(replace(world, run_seed=2), [0])).any()


def test_step_integrates_the_velocity(world):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    np.testing.assert_allclose(moved(world, 0, z, u), z + 0.01 * u, atol=1e-15)


def test_step_remembers_what_was_flown_and_measured(world):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    measured = np.random.default_rng(2).normal(size=(len(SEVEN), 2))
    after = world.step(0, scene(z), measured, u, QUIET)
    np.testing.assert_array_equal(after.velocity, u)
    np.testing.assert_array_equal(after.measured, measured)


HOLDING = [
    Fault(Verb.KILL, 0, None, agents=GONE),
    Fault(Verb.DEPART, 0, None, agents=GONE),
    Fault(Verb.DEPART, 0, None, agents=GONE, body=DepartedBody.VANISH),
]
HELD = pytest.mark.parametrize("fault", HOLDING, ids=lambda fault: f"{fault.verb}, {fault.body}")


@HELD
def test_absent_agents_hold_still(world, fault):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    flown = world.flown(0, scene(z, velocity=-u), u, under(fault))
    after = moved(world, 0, z, flown, fault)
    np.testing.assert_array_equal(flown[ABSENT], 0.0)
    np.testing.assert_array_equal(after[ABSENT], z[ABSENT])
    np.testing.assert_allclose(after[~ABSENT], (z + 0.01 * u)[~ABSENT], atol=1e-15)


@HELD
def test_absent_agents_hold_still_under_disturbance_and_gusts_too(world, fault):
    gust = Fault(Verb.GUST, 0, None, agents=tuple(range(1, 8)), vector=(1.0, 2.0))
    z = ZHAO7.nominal
    after = moved(replace(world, disturbance=pushes(0.1)), 0, z, REST, fault, gust)
    np.testing.assert_array_equal(after[ABSENT], z[ABSENT])
    assert (after[~ABSENT] != z[~ABSENT]).all()


COASTING = [
    Fault(Verb.PAUSE, 0, None, agents=GONE, under_way=UnderWay.HOLD),
    Fault(Verb.DEPART, 0, None, agents=GONE, body=DepartedBody.DRIFT),
]


@pytest.mark.parametrize("fault", COASTING, ids=lambda fault: fault.verb)
def test_paused_and_drifting_bodies_fly_on_as_they_did_whatever_is_commanded(world, fault):
    before, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    flown = world.flown(0, scene(ZHAO7.nominal, velocity=before), u, under(fault))
    np.testing.assert_array_equal(flown[ABSENT], before[ABSENT])
    np.testing.assert_array_equal(flown[~ABSENT], u[~ABSENT])
    np.testing.assert_allclose(moved(world, 0, ZHAO7.nominal, flown, fault), ZHAO7.nominal + 0.01 * flown, atol=1e-15)


def test_a_body_flies_on_for_as_long_as_its_agent_is_paused(world):
    timeline = Timeline(SEVEN, [Fault(Verb.PAUSE, 2, 5, agents=(4,), under_way=UnderWay.HOLD)])
    here, flown = scene(ZHAO7.nominal), []
    for tick in range(7):
        now, commanded = timeline.at(tick), np.full((7, 2), float(tick + 1))
        flown.append(world.flown(0, here, commanded, now))
        here = world.step(tick, here, here.measured, flown[-1], now)
    assert [each[3, 0] for each in flown] == [1, 2, 2, 2, 2, 6, 7]
    assert [each[4, 0] for each in flown] == [1, 2, 3, 4, 5, 6, 7]


@pytest.mark.parametrize("fault", COASTING, ids=lambda fault: fault.verb)
def test_a_body_that_coasts_holds_when_its_agent_dies(world, fault):
    u = np.ones((7, 2))
    flown = world.flown(0, scene(ZHAO7.nominal, velocity=u), u, under(fault, Fault(Verb.KILL, 0, None, agents=(4,))))
    assert flown[:, 0].tolist() == [1, 1, 1, 0, 1, 1, 1]


def test_an_agent_that_departs_while_paused_holds(world):
    u = np.ones((7, 2))
    flown = world.flown(0, scene(ZHAO7.nominal, velocity=u), u, under(COASTING[0], HOLDING[1]))
    np.testing.assert_array_equal(flown[ABSENT], 0.0)


def test_gusts_carry_their_agents_on_top_of_what_they_fly(world):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    one, two = (
        Fault(Verb.GUST, 0, None, agents=(2, 5), vector=(3.0, -1.0)),
        Fault(Verb.GUST, 0, None, agents=(5,), vector=(0.0, 4.0)),
    )
    push = np.zeros((7, 2))
    push[1], push[4] = (3.0, -1.0), (3.0, 3.0)
    np.testing.assert_allclose(moved(world, 0, z, u, one, two), z + 0.01 * (u + push), atol=1e-15)


def test_a_gust_is_no_input_of_its_agent(world):
    gust = under(Fault(Verb.GUST, 0, None, agents=(2,), vector=(3.0, -1.0)))
    u = world.flown(0, scene(ZHAO7.nominal), np.ones((7, 2)), gust)
    np.testing.assert_array_equal(u, 1.0)
    np.testing.assert_array_equal(world.step(0, scene(ZHAO7.nominal), UNSEEN, u, gust).velocity, 1.0)


def test_disturbance_is_a_displacement_per_tick_of_the_deviation_asked_for(world):
    gusty = replace(world, disturbance=pushes(0.2))
    drawn = np.array([moved(gusty, tick, REST, REST) for tick in range(5000)])
    assert drawn.std() == pytest.approx(0.2, rel=0.02)
    np.testing.assert_allclose(np.corrcoef(drawn.reshape(5000, 14).T), np.eye(14), atol=0.06)


def test_disturbance_of_an_agent_is_the_same_whatever_other_agents_exist(world):
    few = Formation(ZHAO7.nominal[:3], ((1, 2), (1, 3)), (1, 2, 3))
    small = replace(world, formation=few, links=Links.both_ways(3, few.edges), disturbance=pushes(0.2))
    seven = moved(replace(world, disturbance=pushes(0.2)), 9, REST, REST)
    after = small.step(9, few_at_rest(), np.zeros((4, 2)), REST[:3], under(links=small.links))
    assert after.position.tobytes() == seven[:3].tobytes()


def test_leaders_start_on_their_targets_and_followers_about_theirs(world):
    flying = replace(world, manoeuvre=corridor(np.arange(6001) * 0.01), spread=0.5)
    starts = np.array([replace(flying, run_seed=seed).begin().position for seed in range(500)])
    offset = starts - flying.target(0)
    np.testing.assert_array_equal(offset[:, :3], 0.0)
    assert offset[:, 3:].std() == pytest.approx(0.5, rel=0.05)
    assert np.abs(offset[:, 3:].mean(axis=0)).max() < 0.1


def test_spread_zero_starts_everybody_on_target(world):
    np.testing.assert_array_equal(replace(world, spread=0.0).begin().position, ZHAO7.nominal)


def test_everybody_starts_at_rest_with_a_true_picture(world):
    begun = world.begin()
    np.testing.assert_array_equal(begun.velocity, REST)
    np.testing.assert_array_equal(begun.measured, begun.position[SEVEN.dst - 1] - begun.position[SEVEN.src - 1])


# ---- double integrators


@pytest.fixture
def heavy(world):
    return replace(world, body=integrators(2))


def test_a_double_integrator_gains_velocity_and_a_half_of_it_already_moves_it(heavy):
    z, v, u = np.random.default_rng(1).normal(size=(3, 7, 2))
    z[3], v[3], u[3] = (1.0, 2.0), (10.0, 0.0), (200.0, -400.0)
    after = heavy.step(0, scene(z, velocity=v), BEFORE, u, QUIET)
    np.testing.assert_allclose(after.position[3], [1.0 + 0.1 + 0.01, 2.0 - 0.02], atol=1e-15)
    np.testing.assert_allclose(after.velocity[3], [12.0, -4.0], atol=1e-14)
    np.testing.assert_allclose(after.position, z + 0.01 * v + 0.01**2 / 2 * u, atol=1e-15)
    np.testing.assert_allclose(after.velocity, v + 0.01 * u, atol=1e-15)
    np.testing.assert_array_equal(after.measured, BEFORE)


def test_only_those_that_do_not_command_their_velocity_are_told_how_they_move(world):
    motion = np.random.default_rng(1).normal(size=(3, 7, 2))
    assert world.odometry(scene(REST, velocity=motion[0])) is None
    for order in (2, 3, 4):
        told = replace(world, body=integrators(order)).odometry(scene(REST, motion[0], higher=motion[1 : order - 1]))
        np.testing.assert_array_equal(told, np.moveaxis(motion[: order - 1], 0, 1))


@pytest.mark.parametrize("fault", COASTING, ids=lambda fault: fault.verb)
def test_double_integrators_that_nobody_steers_keep_their_velocity(heavy, fault):
    z, v, u = np.random.default_rng(1).normal(size=(3, 7, 2))
    flown = heavy.flown(0, scene(z, velocity=v), u, under(fault))
    np.testing.assert_array_equal(flown[ABSENT], 0.0)
    np.testing.assert_array_equal(flown[~ABSENT], u[~ABSENT])
    after = heavy.step(0, scene(z, velocity=v), UNSEEN, flown, under(fault))
    np.testing.assert_array_equal(after.velocity[ABSENT], v[ABSENT])
    np.testing.assert_allclose(after.position[ABSENT], (z + 0.01 * v)[ABSENT], atol=1e-15)
    assert (after.velocity != v).all(axis=1).tolist() == (~ABSENT).tolist()


def test_a_double_integrator_gains_nothing_for_as_long_as_its_agent_is_paused(heavy):
    timeline = Timeline(SEVEN, [Fault(Verb.PAUSE, 2, 5, agents=(4,), under_way=UnderWay.HOLD)])
    here, speed = scene(ZHAO7.nominal), []
    for tick in range(7):
        now = timeline.at(tick)
        here = heavy.step(tick, here, here.measured, heavy.flown(0, here, np.full((7, 2), 100.0), now), now)
        speed.append(here.velocity[[3, 4], 0])
    np.testing.assert_allclose(speed, np.transpose([[1, 2, 2, 2, 2, 3, 4], [1, 2, 3, 4, 5, 6, 7]]), atol=1e-12)


@HELD
def test_absent_double_integrators_stop_at_once_whatever_happens(heavy, fault):
    z, v, u = np.random.default_rng(1).normal(size=(3, 7, 2))
    gust = Fault(Verb.GUST, 0, None, agents=tuple(range(1, 8)), vector=(1.0, 2.0))
    flown = heavy.flown(0, scene(z, velocity=v), u, under(fault))
    after = replace(heavy, disturbance=pushes(0.1)).step(0, scene(z, velocity=v), UNSEEN, flown, under(fault, gust))
    np.testing.assert_array_equal(flown[ABSENT], 0.0)
    np.testing.assert_array_equal(after.position[ABSENT], z[ABSENT])
    np.testing.assert_array_equal(after.velocity[ABSENT], 0.0)
    assert (after.position[~ABSENT] != z[~ABSENT]).all()
    np.testing.assert_allclose(after.velocity[~ABSENT], (v + 0.01 * u)[~ABSENT], atol=1e-15)


def test_gusts_and_disturbances_displace_a_double_integrator_and_give_it_no_velocity(heavy):
    z, v, u = np.random.default_rng(1).normal(size=(3, 7, 2))
    gust, push = Fault(Verb.GUST, 0, None, agents=(2, 5), vector=(3.0, -1.0)), np.zeros((7, 2))
    push[[1, 4]] = (3.0, -1.0)
    here = scene(z, velocity=v)
    calm = heavy.step(0, here, UNSEEN, u, QUIET)
    windy = heavy.step(0, here, UNSEEN, heavy.flown(0, here, u, under(gust)), under(gust))
    shaken = replace(heavy, disturbance=pushes(0.2)).step(0, here, UNSEEN, u, QUIET)
    np.testing.assert_allclose(windy.position - calm.position, 0.01 * push, atol=1e-15)
    assert (shaken.position != calm.position).all()
    np.testing.assert_array_equal(windy.velocity, calm.velocity)
    np.testing.assert_array_equal(shaken.velocity, calm.velocity)


# ---- integrators of any order


def chain(order, seconds):
    """How position, its derivatives and a held input go on over a time, shape (order + 1, order + 1)."""
    return expm(seconds * np.eye(order + 1, k=1))


def derivatives_of(order, here):
    """Position and the derivatives that bodies of this order have, shape (order, N, D)."""
    return np.stack([here.position, *np.moveaxis(here.motion, 1, 0)])[:order]


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_bodies_move_as_the_exponential_of_a_chain_of_integrators_says(world, order):
    slow = replace(world, body=integrators(order), dt=0.5)
    z, v, a, j = np.random.default_rng(order).normal(size=(4, 7, 2))
    here = scene(z, velocity=v, higher=(a, j)[: max(0, order - 2)])
    for tick, u in enumerate(np.random.default_rng(7).normal(size=(3, 7, 2))):
        before = np.concatenate([derivatives_of(order, here), u[None]])
        expected = np.tensordot(chain(order, 0.5), before, 1)
        here = slow.step(tick, here, UNSEEN, u, QUIET)
        np.testing.assert_allclose(derivatives_of(order, here), expected[:order], rtol=1e-13, atol=1e-13)
        assert here.motion.shape == (7, max(1, order - 1), 2)
        # Without what the input does within the tick, nothing would be right.
        assert (np.abs(expected[0] - np.tensordot(chain(order, 0.5)[0, :-1], before[:-1], 1)) > 1e-6).any()
    if order == 1:
        np.testing.assert_array_equal(here.velocity, u)
    np.testing.assert_array_equal(here.velocity, here.motion[:, 0])


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("pushed", [1, 2], ids=["one push for all axes", "a push for each"])
def test_integrators_have_the_bits_of_what_carries_their_derivatives(order, pushed):
    rng = np.random.default_rng(order)
    position, flown, push = (rng.normal(size=(7, axes)) for axes in (2, 2, pushed))
    higher = [*rng.normal(size=(order - 1, 7, 2))]
    moved = Integrators(order).moved(Motion(position, np.stack(higher, axis=1), NOWHERE), flown, push, 0.013)
    driven = [*higher, flown]
    np.testing.assert_array_equal(moved.position, carried([position, driven[0] + push, *driven[1:]], 0.013))
    led = [carried(driven[level:], 0.013) for level in range(order - 1)]
    np.testing.assert_array_equal(moved.derivatives, np.stack(led, axis=1))


def test_single_and_double_integrators_fly_the_bits_of_their_formulas(world, heavy):
    z, v, u = np.random.default_rng(1).normal(size=(3, 7, 2))
    gust, push = Fault(Verb.GUST, 0, None, agents=(2, 5), vector=(3.0, -1.0)), np.zeros((7, 2))
    push[[1, 4]] = (3.0, -1.0)
    here, dt = scene(z, velocity=v), 0.7
    single, double = (
        replace(each, dt=dt, disturbance=pushes(0.2)).step(4, here, UNSEEN, u, under(gust)) for each in (world, heavy)
    )
    np.testing.assert_array_equal(single.disturbance, double.disturbance)
    w = single.disturbance
    assert (w != 0.0).all()
    np.testing.assert_array_equal(single.position, z + dt * (u + push) + w)
    np.testing.assert_array_equal(double.position, z + dt * (v + push) + 0.5 * dt**2 * u + w)
    np.testing.assert_array_equal(single.velocity, u)
    np.testing.assert_array_equal(double.velocity, v + dt * u)


HIGHER = pytest.mark.parametrize("order", [3, 4])


def moving(order, seed=1):
    """A scene of bodies that move in every way they can, and what their agents command."""
    z, u, v, *higher = np.random.default_rng(seed).normal(size=(order + 1, 7, 2))
    return scene(z, velocity=v, higher=higher), u


@HIGHER
def test_everybody_of_any_order_starts_at_rest(world, order):
    begun = replace(world, body=integrators(order)).begin()
    np.testing.assert_array_equal(begun.motion, np.zeros((7, order - 1, 2)))
    np.testing.assert_array_equal(begun.position, world.begin().position)


@HIGHER
@pytest.mark.parametrize("fault", COASTING, ids=lambda fault: fault.verb)
def test_integrators_that_nobody_steers_fly_no_input_and_go_on_as_they_moved(world, order, fault):
    slow, (here, u) = replace(world, body=integrators(order), dt=0.5), moving(order)
    flown = slow.flown(0, here, u, under(fault))
    np.testing.assert_array_equal(flown[ABSENT], 0.0)
    np.testing.assert_array_equal(flown[~ABSENT], u[~ABSENT])
    after = slow.step(0, here, UNSEEN, flown, under(fault))
    adrift = np.tensordot(chain(order - 1, 0.5), derivatives_of(order, here), 1)
    np.testing.assert_allclose(derivatives_of(order, after)[:, ABSENT], adrift[:, ABSENT], rtol=1e-13, atol=1e-13)
    assert (np.abs(derivatives_of(order, after) - adrift)[:, ~ABSENT] > 1e-4).all()


@HIGHER
@HELD
def test_absent_integrators_of_any_order_stop_at_once_whatever_happens(world, order, fault):
    heavy, (here, u) = replace(world, body=integrators(order), disturbance=pushes(0.1)), moving(order)
    gust = Fault(Verb.GUST, 0, None, agents=tuple(range(1, 8)), vector=(1.0, 2.0))
    flown = heavy.flown(0, here, u, under(fault))
    after = heavy.step(0, here, UNSEEN, flown, under(fault, gust))
    np.testing.assert_array_equal(flown[ABSENT], 0.0)
    np.testing.assert_array_equal(after.position[ABSENT], here.position[ABSENT])
    np.testing.assert_array_equal(after.motion[ABSENT], 0.0)
    assert (after.position[~ABSENT] != here.position[~ABSENT]).all()
    assert (after.motion[~ABSENT] != here.motion[~ABSENT]).all()


@HIGHER
def test_gusts_and_disturbances_displace_integrators_of_any_order_and_give_them_no_motion(world, order):
    heavy, (here, u) = replace(world, body=integrators(order)), moving(order)
    gust, push = Fault(Verb.GUST, 0, None, agents=(2, 5), vector=(3.0, -1.0)), np.zeros((7, 2))
    push[[1, 4]] = (3.0, -1.0)
    calm = heavy.step(0, here, UNSEEN, u, QUIET)
    windy = heavy.step(0, here, UNSEEN, heavy.flown(0, here, u, under(gust)), under(gust))
    shaken = replace(heavy, disturbance=pushes(0.2)).step(0, here, UNSEEN, u, QUIET)
    np.testing.assert_allclose(windy.position - calm.position, 0.01 * push, atol=1e-15)
    np.testing.assert_allclose(shaken.position - calm.position, shaken.disturbance, atol=1e-15)
    assert (shaken.disturbance != 0.0).all()
    np.testing.assert_array_equal(windy.motion, calm.motion)
    np.testing.assert_array_equal(shaken.motion, calm.motion)


# ---- sensors that fail

BIASED, OTHERS = SEVEN.index[4, 2], np.arange(len(SEVEN)) != SEVEN.index[4, 2]


def failing(world, *faults, tick=3):
    """What sensors say, and what they would say if they worked."""
    here = scene(ZHAO7.nominal, measured=BEFORE)
    return world.measure(tick, here, under(*faults)), world.measure(tick, here, QUIET)


def test_biases_are_added_to_the_measurements_of_their_links(world):
    one = Fault(Verb.BIAS, 0, None, pairs=((4, 2), (1, 2)), vector=(0.5, -1.0))
    said, right = failing(world, one, replace(one, pairs=((4, 2),), vector=(1.0, 0.0)))
    np.testing.assert_allclose(said[BIASED] - right[BIASED], [1.5, -1.0], atol=1e-14)
    np.testing.assert_allclose(said[SEVEN.index[1, 2]] - right[SEVEN.index[1, 2]], [0.5, -1.0], atol=1e-14)
    assert (said != right).any(axis=1).sum() == 2


def test_a_frozen_sensor_says_what_it_said_in_the_tick_before(world):
    said, right = failing(world, Fault(Verb.FREEZE, 0, None, pairs=((4, 2),)))
    np.testing.assert_array_equal(said[BIASED], 77.0)
    np.testing.assert_array_equal(said[OTHERS], right[OTHERS])


def test_a_frozen_sensor_says_the_same_until_it_thaws(world):
    timeline = Timeline(SEVEN, [Fault(Verb.FREEZE, 2, 5, pairs=((4, 2),))])
    here, said = world.begin(), []
    for tick in range(7):
        said.append(world.measure(tick, here, timeline.at(tick)))
        here = world.step(tick, here, said[-1], REST, timeline.at(tick))
    changed = [not np.array_equal(one[BIASED], other[BIASED]) for one, other in pairwise(said)]
    assert changed == [True, False, False, False, True, True]


def test_a_sensor_frozen_in_the_first_tick_says_the_truth_for_good(world):
    now, here = under(Fault(Verb.FREEZE, 0, None, pairs=((4, 2),))), world.begin()
    truth = here.measured[BIASED]
    for tick in range(3):
        here = world.step(tick, here, world.measure(tick, here, now), np.ones((7, 2)), now)
        np.testing.assert_array_equal(here.measured[BIASED], truth)


def test_a_frozen_sensor_is_neither_biased_nor_stray(world):
    on = {"pairs": ((4, 2),)}
    faults = (
        Fault(Verb.BIAS, 0, None, **on, vector=(1.0, 1.0)),
        Fault(Verb.OUTLIER, 0, None, **on, probability=1.0, deviation=9.0),
    )
    assert failing(world, Fault(Verb.FREEZE, 0, None, **on), *faults)[0][BIASED].tolist() == [77.0, 77.0]


def test_outliers_strike_with_their_probability_and_stray_by_their_deviation(world):
    now = under(Fault(Verb.OUTLIER, 0, None, pairs=((4, 2), (1, 2)), probability=0.3, deviation=5.0))
    ticks, here = range(1000), scene(ZHAO7.nominal)
    off = np.array([world.measure(tick, here, now) - world.measure(tick, here, QUIET) for tick in ticks])
    struck = np.array([world.outliers(tick, now) for tick in ticks])
    np.testing.assert_array_equal((off != 0.0).all(axis=-1), struck)
    np.testing.assert_array_equal((off != 0.0).any(axis=-1), struck)
    assert set(np.flatnonzero(struck.any(axis=0))) == {BIASED, SEVEN.index[1, 2]}
    assert abs(struck[:, BIASED].sum() - 300) < 3 * np.sqrt(1000 * 0.3 * 0.7)
    assert off[struck].std() == pytest.approx(5.0, rel=0.1)
    assert abs((off[:, BIASED, 0] * off[:, BIASED, 1]).sum() / 300 / 25.0) < 0.2


def test_sensors_fail_as_they_are_told():
    on_1_2, on_2_1 = {"pairs": ((1, 2),)}, {"pairs": ((2, 1),)}
    links = Links.both_ways(2, [(1, 2)])
    there, back = links.index[1, 2], links.index[2, 1]
    now = under(
        Fault(Verb.BIAS, 0, None, **on_1_2, vector=(1.0, 0.0)),
        Fault(Verb.OUTLIER, 0, None, **on_1_2, probability=0.5, deviation=2.0),
        Fault(Verb.FREEZE, 0, None, **on_2_1),
        links=links,
    )
    measured, before, standard = np.full((2, 2), 10.0), np.full((2, 2), 7.0), np.full((2, 2), 3.0)
    said = sensors.astray(measured, before, sensors.stray(np.array([0.4, 0.4]), now), standard, now)
    assert (said[there].tolist(), said[back].tolist()) == ([17.0, 16.0], [7.0, 7.0])
    said = sensors.astray(measured, before, sensors.stray(np.array([0.6, 0.6]), now), standard, now)
    assert (said[there].tolist(), said[back].tolist()) == ([11.0, 10.0], [7.0, 7.0])
