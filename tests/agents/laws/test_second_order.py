"""The control laws for double integrators on cases small enough to work out by hand, and the ravine they fly through."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from briefs import BRIEF, ESTIMATE, FORCE
from flying import plan_of

from affinet.planning import making
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from agents.agent import Agent
from agents.brief import Own
from agents.estimators.none import NoEstimator
from agents.exchange import Heard
from agents.laws.base import stress_force
from agents.laws.double import DoubleConstantVelocity, DoubleVaryingVelocity
from agents.laws.leaders import pilot_of_accelerations, saturated
from agents.laws.single import Static
from analysis.models.affine import Manoeuvre
from netem.core.channels import INPUT
from netem.processes.user_code import UserCodeError
from world.formation.manoeuvre import hover, ravine
from world.physics.bodies import carried

OWN = Own(velocity=np.array([1.0, -0.5]), input=np.array([8.0, 4.0]))
VELOCITIES = np.array([[1.0, 0.0], [2.0, 4.0], [77.0, 77.0]])
ACCELERATIONS = np.array([[1.0, 1.0], [0.0, 2.0], [77.0, 77.0]])
CLOSING = np.array([1.0, 3.0])  # 3 ((1, -0.5) - (1, 0)) - ((1, -0.5) - (2, 4))
GAINED = np.array([3.0, 1.0])  # 3 (1, 1) - (0, 2)

CONSTANT = DoubleConstantVelocity(position_gain=2.0, velocity_gain=0.5)
VARYING = DoubleVaryingVelocity(position_gain=2.0, velocity_gain=0.5)
LAWS = pytest.mark.parametrize("law", [CONSTANT, VARYING], ids=["constant", "varying"])


def said(*fresh, velocity=VELOCITIES, acceleration=ACCELERATIONS):
    """What these neighbours say; of the others there is noise where a message would be."""
    fresh = np.array([*fresh, False])
    noise = np.full((3, 2), 555.0)
    fields = {"velocity": velocity, "acceleration": acceleration}
    return Heard({name: np.where(fresh[:, None], field, noise) for name, field in fields.items()}, fresh)


BOTH, FIRST, NOBODY = said(True, True), said(True, False), said(False, False)


def command(law, state=None, tick=0, estimate=ESTIMATE, inputs=BOTH, own=OWN):
    return law.command(BRIEF, law.init(BRIEF, ()) if state is None else state, tick, own, estimate, inputs)


# ---- the laws


def test_constant_velocity_falls_against_the_force_and_is_damped_by_closing_velocities():
    _, u = command(CONSTANT)
    np.testing.assert_allclose(u, [2.0 - 0.5, -14.0 - 1.5])
    np.testing.assert_allclose(u, -2.0 * FORCE - 0.5 * CLOSING)


def test_varying_velocity_accelerates_as_the_neighbours_say_falls_and_is_damped():
    _, u = command(VARYING)
    np.testing.assert_allclose(u, [(3.0 + 2.0 - 0.5) / 2, (1.0 - 14.0 - 1.5) / 2])
    np.testing.assert_allclose(u, (GAINED - 2.0 * FORCE - 0.5 * CLOSING) / (3 - 1))


@dataclass(frozen=True)
class Orderless:
    """A law that does not say whether it steers velocities or accelerations; nobody gets as far as to call it."""

    init = command = lambda *_: None


def test_a_law_that_does_not_say_its_order_is_refused():
    with pytest.raises(UserCodeError, match=r"Orderless: has no 'order': 1 if it steers velocities"):
        plan_of("corridor", f'agents.law="{__name__}:Orderless"')


@LAWS
def test_there_is_no_damping_among_neighbours_that_fly_alike(law):
    alike = said(True, True, velocity=np.tile(OWN.velocity, (3, 1)), acceleration=np.zeros((3, 2)))
    _, u = command(law, inputs=alike)
    np.testing.assert_allclose(u, -2.0 * FORCE if law is CONSTANT else -2.0 * FORCE / 2)


def test_a_neighbour_never_heard_contributes_no_damping():
    _, u = command(CONSTANT, inputs=NOBODY)
    np.testing.assert_allclose(u, -2.0 * FORCE)
    _, u = command(CONSTANT, inputs=FIRST)
    np.testing.assert_allclose(u, -2.0 * FORCE - 0.5 * 3 * np.array([0.0, -0.5]))


def test_a_neighbour_never_heard_contributes_no_acceleration_either():
    _, u = command(VARYING, inputs=NOBODY)
    np.testing.assert_allclose(u, -2.0 * FORCE / 2)
    _, u = command(VARYING, inputs=FIRST)
    np.testing.assert_allclose(u, (3 * np.array([1.0, 1.0]) - 2.0 * FORCE - 0.5 * 3 * np.array([0.0, -0.5])) / 2)


@LAWS
def test_what_was_heard_last_holds_when_it_is_lost(law):
    state, before = command(law)
    state, held = command(law, state, 1, inputs=NOBODY)
    np.testing.assert_array_equal(held, before)
    newer = FIRST.fields["velocity"] + 1.0, FIRST.fields["acceleration"] - 2.0
    _, half = command(law, state, 2, inputs=said(True, False, velocity=newer[0], acceleration=newer[1]))
    # Of the first neighbour, with weight 3, a newer word; of the second still the first.
    damping, gained = -0.5 * (CLOSING - 3.0), GAINED - 6.0
    expected = -2.0 * FORCE + damping if law is CONSTANT else (gained - 2.0 * FORCE + damping) / 2
    np.testing.assert_allclose(half, expected)


RELATIVE_VELOCITY = np.array([[0.5, 0.0], [-1.0, 1.0], [88.0, 88.0]])
TRACKED = ESTIMATE._replace(relative_velocity=RELATIVE_VELOCITY)
ESTIMATED = 3 * np.array([0.5, 0.0]) - np.array([-1.0, 1.0])  # (2.5, -1)


def test_constant_velocity_takes_closing_velocities_from_the_estimate():
    _, u = command(replace(CONSTANT, source="estimated"), estimate=TRACKED)
    np.testing.assert_allclose(u, -2.0 * FORCE - 0.5 * ESTIMATED)


def test_varying_velocity_takes_closing_velocities_from_the_estimate_and_hears_accelerations():
    _, u = command(replace(VARYING, source="estimated"), estimate=TRACKED)
    np.testing.assert_allclose(u, (GAINED - 2.0 * FORCE - 0.5 * ESTIMATED) / 2)


def test_an_edge_without_estimate_neither_pulls_nor_damps():
    blind = TRACKED._replace(known=np.array([False, True, False]))
    _, u = command(replace(CONSTANT, source="estimated"), estimate=blind)
    np.testing.assert_allclose(u, -2.0 * np.array([-4.0, 1.0]) - 0.5 * np.array([1.0, -1.0]))


def test_an_edge_without_estimate_still_damps_by_what_its_neighbour_said():
    blind = ESTIMATE._replace(known=np.zeros(3, dtype=bool))
    _, u = command(CONSTANT, estimate=blind)
    np.testing.assert_allclose(u, -0.5 * CLOSING)


@LAWS
def test_estimated_velocities_need_an_estimator_of_velocities(law):
    with pytest.raises(ValueError, match="'estimated' needs an estimator that tracks relative velocities"):
        command(replace(law, source="estimated"))


def test_relaxation_mixes_the_law_with_the_acceleration_now_flying():
    _, law = command(VARYING)
    _, relaxed = command(replace(VARYING, relaxation=0.25))
    np.testing.assert_allclose(relaxed, 0.75 * np.array([8.0, 4.0]) + 0.25 * law)


@LAWS
def test_followers_need_no_mission(law):
    assert not law.wants.mission
    assert not replace(law, source="estimated").wants.mission


# ---- the pilot

SECONDS = np.arange(0, 62, 0.01)
TOLD = replace(BRIEF, dt=0.01, nominal=np.array([-0.5, -0.5, 0.5]), leader=np.array(True))
RAVINE = ravine(SECONDS)


def moved(position, velocity, u, dt):
    return carried([position, velocity, u], dt), velocity + dt * u


def test_pilot_flies_the_acceleration_of_the_target_and_pulls_twice():
    # Targets at 0, 0.2 and 0.8: the second gains 40, and passes at 4.
    along = np.array([[0.0, 0.0], [0.2, 0.0], [0.8, 0.0]])
    mission = Manoeuvre(np.broadcast_to(np.eye(2), (3, 2, 2)), along)
    u = pilot_of_accelerations(BRIEF, mission, 3.0, 1, np.array([1.0, 1.5]), np.array([3.0, 0.5]))
    np.testing.assert_allclose(u, [40.0 + 9.0 * 0.2 + 6.0 * (4.0 - 3.0), 9.0 * -0.5 + 6.0 * -0.5])


@pytest.mark.parametrize("tick", [300, 1450, 3800, 4650, 5700])
def test_who_is_where_and_as_fast_as_its_target_is_on_the_target_a_tick_later(tick):
    before, here, after = (RAVINE.target(tick + by, TOLD.nominal) for by in (-1, 0, 1))
    speed = (after - before) / 0.02
    arrived, _ = moved(here, speed, pilot_of_accelerations(TOLD, RAVINE, 5.0, tick, here, speed), 0.01)
    np.testing.assert_allclose(arrived, after, atol=1e-13)
    # By coasting it would have missed.
    assert np.abs(here + 0.01 * speed - after).max() > 1e-7


def flown(mission, gain, offset, ticks):
    """How far a pilot that starts off its target, at rest, is from it in each tick."""
    position, velocity, astray = mission.target(0, TOLD.nominal) + offset, np.zeros(3), []
    for tick in range(ticks):
        astray.append(position - mission.target(tick, TOLD.nominal))
        u = pilot_of_accelerations(TOLD, mission, gain, tick, position, velocity)
        position, velocity = moved(position, velocity, u, 0.01)
    return np.array(astray)


@pytest.mark.parametrize("gain", [0.5, 1.0, 2.0])
def test_pilot_is_critically_damped(gain):
    seconds, offset = SECONDS[:1001], np.array([1.0, -2.0, 0.5])
    left = flown(hover(seconds, 3), gain, offset, 1001) / offset
    assert (np.diff(left, axis=0) <= 0.0).all()
    assert (left > 0.0).all()
    # (1 + g t) exp(-g t) is what is left of an error when both roots are -g; a tick makes little of a difference.
    expected = (1 + gain * seconds) * np.exp(-gain * seconds)
    np.testing.assert_allclose(left, np.broadcast_to(expected[:, None], left.shape), atol=0.003 * gain)
    assert expected[-1] < 0.05


def test_pilot_forgets_its_error_in_flight_as_at_rest():
    offset = np.array([1.0, -2.0, 0.5])
    astray = flown(RAVINE, 1.0, offset, 1500) - flown(RAVINE, 1.0, np.zeros(3), 1500)
    np.testing.assert_allclose(astray, flown(hover(SECONDS, 3), 1.0, offset, 1500), atol=1e-11)


# ---- the limit


def test_saturation_shortens_and_keeps_the_direction():
    commanded = np.array([[3.0, 4.0], [-30.0, 40.0], [0.0, -7.0]])
    np.testing.assert_allclose(saturated(commanded, 2.5), [[1.5, 2.0], [-1.5, 2.0], [0.0, -2.5]], rtol=1e-15)


def test_saturation_leaves_what_is_short_enough_bit_for_bit():
    rng = np.random.default_rng(1)
    short = np.concatenate([rng.normal(size=(100, 3)), [[-0.0, 0.0, 0.0], [3.0, 0.0, 4.0], [1e-300, -1e-310, 0.0]]])
    assert saturated(short, 5.0).tobytes() == short.tobytes()


def test_saturation_shortens_only_those_that_are_too_long():
    commanded = np.array([[[0.1, 0.7], [6.0, 8.0]], [[60.0, 80.0], [0.3, -0.1]]])
    shortened = saturated(commanded, 1.0)
    np.testing.assert_allclose(shortened[[0, 1], [1, 0]], [[0.6, 0.8], [0.6, 0.8]], rtol=1e-15)
    assert shortened[[0, 1], [0, 1]].tobytes() == commanded[[0, 1], [0, 1]].tobytes()


# ---- the agent


@pytest.fixture(scope="module")
def octa10():
    return plan_of("ravine").brief


def drawn(brief, seed=1):
    """A tick of everybody: measured, own position and velocity, and what is heard of the neighbours."""
    rng = np.random.default_rng(seed)
    apart = brief.relative + np.where(brief.present[..., None], 0.1 * rng.normal(size=brief.relative.shape), 0.0)
    position, velocity = rng.normal(size=(2, 10, 3))
    spoken = dict(zip(("velocity", "acceleration"), rng.normal(size=(2, *brief.relative.shape)), strict=True))
    return apart, position, velocity, {INPUT: Heard(spoken, brief.present)}


def act(agent, measured, position, velocity, heard, tick=2000):
    motion = None if velocity is None else velocity[:, None]
    state, _ = agent.sense(agent.init((10,)), 0, measured, agent.brief.present, motion)
    return agent.act(state, tick, heard, position, motion, None)


def test_leaders_follow_the_pilot_and_followers_the_law_of_double_integrators(octa10):
    agent = Agent(octa10, NoEstimator(), CONSTANT, leaders="pilot", leader_gain=1.5, limit=None)
    measured, position, velocity, heard = drawn(octa10)
    _, action = act(agent, measured, position, velocity, heard)
    led = pilot_of_accelerations(octa10, octa10.mission, 1.5, 2000, position, velocity)
    closing = velocity[:, None] - heard[INPUT].fields["velocity"]
    damping = (octa10.stress[..., None] * closing).sum(axis=1)
    law = -2.0 * stress_force(octa10, action.estimate) - 0.5 * damping
    np.testing.assert_allclose(action.input, np.where(octa10.leader[:, None], led, law), atol=1e-12)


def test_double_integrators_say_their_velocity_and_the_acceleration_now_flying(octa10):
    agent = Agent(octa10, NoEstimator(), VARYING, leaders="pilot", leader_gain=1.0, limit=None)
    measured, position, velocity, heard = drawn(octa10)
    _, first = agent.sense(agent.init((10,)), 0, measured, octa10.present, velocity[:, None])
    np.testing.assert_array_equal(first[INPUT]["acceleration"], np.zeros((10, 3)))
    state, action = act(agent, measured, position, velocity, heard)
    _, second = agent.sense(state, 1, measured, octa10.present, velocity[:, None] + 1.0)
    assert {name: field.shape for name, field in agent.channels()[INPUT].items()} == dict.fromkeys(second[INPUT], (3,))
    np.testing.assert_array_equal(second[INPUT]["velocity"], velocity + 1.0)
    np.testing.assert_array_equal(second[INPUT]["acceleration"], action.input)


def test_single_integrators_say_their_input_alone(octa10):
    agent = Agent(octa10, NoEstimator(), Static(), leaders="pilot", leader_gain=1.0, limit=None)
    _, spoken = agent.sense(agent.init((10,)), 0, octa10.relative, octa10.present, None)
    assert set(spoken[INPUT]) == set(agent.channels()[INPUT]) == {"velocity"}


@pytest.mark.parametrize("law", [VARYING, CONSTANT, Static(alpha=30.0)], ids=["varying", "constant", "static"])
def test_the_limit_shortens_the_inputs_of_leaders_and_followers(law, octa10):
    measured, position, velocity, heard = drawn(octa10)
    velocity = velocity if law.order == 2 else None
    free, bound = (
        Agent(octa10, NoEstimator(), law, leaders="pilot", leader_gain=1.0, limit=limit) for limit in (None, 1.0)
    )
    (_, wanted), (state, limited) = (act(agent, measured, position, velocity, heard) for agent in (free, bound))
    length = np.linalg.norm(wanted.input, axis=-1, keepdims=True)
    long = length[:, 0] > 1.0
    assert long[octa10.leader].any()
    assert long[~octa10.leader].any()
    np.testing.assert_allclose(limited.input[long], (wanted.input / length)[long], rtol=1e-14)
    assert limited.input[~long].tobytes() == wanted.input[~long].tobytes()
    # What it tells the others is what it flies.
    np.testing.assert_array_equal(state.input, limited.input)


# ---- the plan


def make(name, *overrides):
    return making.make(loading.load(name, overrides))


@pytest.mark.parametrize("law", ["static", "constant-velocity", "varying-velocity"])
def test_a_law_of_velocities_does_not_steer_double_integrators(law):
    says = (
        rf"dynamics\.model: {law} steers velocities, and bodies are double-integrators; set it to 'single-integrator'"
    )
    with pytest.raises(ScenarioError, match=says):
        make("corridor", f"agents.law={law}", "dynamics.model=double-integrator")


@pytest.mark.parametrize("law", ["double-constant-velocity", "double-varying-velocity"])
def test_a_law_of_accelerations_does_not_steer_single_integrators(law):
    says = rf"dynamics\.model: {law} steers accelerations, and bodies are single-integrators; set it to 'double-integrator'"
    with pytest.raises(ScenarioError, match=says):
        make("corridor", f"agents.law={law}")


@pytest.mark.parametrize(
    ("preset", "name", "dimension"), [("ravine", "corridor", 2), ("corridor", "ravine", 3)], ids=["ravine", "corridor"]
)
def test_a_manoeuvre_is_flown_in_its_own_dimensions(preset, name, dimension):
    says = rf"manoeuvre\.preset: '{preset}' is flown in {5 - dimension} dimensions, not in {dimension}; give keyframes"
    with pytest.raises(ScenarioError, match=says):
        make(name, f"manoeuvre.preset={preset}")


@pytest.mark.parametrize("limit", [0.0, -1.0])
def test_a_limit_below_which_nobody_flies_is_refused(limit):
    with pytest.raises(ScenarioError, match=r"agents\.limit: .*greater than 0"):
        make("ravine", f"agents.limit={limit}")


def test_the_plan_of_the_ravine_says_what_was_checked():
    made = plan_of("ravine")
    assert all(finding.level == "ok" for finding in made.findings)
    found = {finding.check: finding.says for finding in made.findings}
    assert found["one-tick radius"] == "0.648 < 1: accelerations heard one tick late settle"
    assert found["step"].startswith("radius 0.99")
    assert "gain" not in found["step"]
    assert (made.scenario.dynamics.order, made.agents.law.order, made.agents.limit) == (2, 2, 3.0)


# ---- the ravine

NOISELESS = ("sensing.sigma=1e-6", "network.availability=1", "time.dt=0.1")


def test_the_formation_holds_all_through_the_ravine():
    run = rehearse(plan_of("ravine", *NOISELESS))
    assert run.error[0] > 0.1
    # The first 10 s are for the scatter at the start.
    assert run.error[100:].max() < 2e-3
    assert run.error[-1] < 1e-4
    assert np.linalg.norm(run.arrays["input"], axis=-1).max() < 3.0  # the limit of the scenario is not in its way


def test_bodies_that_cannot_accelerate_enough_fall_behind():
    free, bound = (
        rehearse(plan_of("ravine", *NOISELESS, "time.duration=20", f"agents.limit={limit}")) for limit in (3.0, 0.1)
    )
    assert np.linalg.norm(bound.arrays["input"], axis=-1).max() == pytest.approx(0.1, rel=1e-12)
    assert free.error[-1] < 1e-3 < 1.0 < bound.error[-1]
