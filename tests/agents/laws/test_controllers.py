"""The control laws of paper 000, Table II, on cases small enough to work out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from briefs import BRIEF, ESTIMATE, FORCE

from agents.agent import Agent
from agents.brief import Brief, Own
from agents.estimate import Estimate
from agents.estimators.none import NoEstimator
from agents.exchange import Heard
from agents.laws.base import stress_force
from agents.laws.leaders import pilot
from agents.laws.single import ConstantVelocity, Static, VaryingVelocity
from analysis.models.affine import Manoeuvre
from analysis.models.sensor import Sensor
from netem.core.channels import INPUT
from netem.core.links import Links
from world.formation.manoeuvre import corridor
from world.formation.nominal import PRESETS
from world.formation.stress import laplacian

FLYING = np.array([0.5, -0.5])
OWN = Own(FLYING, FLYING)
STILL = Own(np.zeros((7, 2)), np.zeros((7, 2)))
SAID = Heard({"velocity": np.array([[1.0, 0.0], [2.0, 4.0], [0.0, 0.0]])}, np.array([True, True, False]))
SILENCE = Heard({"velocity": np.full((3, 2), 77.0)}, np.zeros(3, dtype=bool))


def command(law, brief=BRIEF, state=None, tick=0, estimate=ESTIMATE, inputs=SAID):
    return law.command(brief, law.init(brief, ()) if state is None else state, tick, OWN, estimate, inputs)


def test_stress_force_is_the_weighted_sum_of_the_estimates():
    np.testing.assert_allclose(stress_force(BRIEF, ESTIMATE), FORCE)


def test_an_edge_without_estimate_contributes_nothing():
    deaf = ESTIMATE._replace(known=np.array([False, True, False]))
    np.testing.assert_allclose(stress_force(BRIEF, deaf), [-4.0, 1.0])


def test_nothing_known_is_no_force():
    blind = ESTIMATE._replace(known=np.zeros(3, dtype=bool))
    np.testing.assert_array_equal(stress_force(BRIEF, blind), [0.0, 0.0])


def test_static_falls_against_the_force():
    _, u = command(Static(alpha=2.0))
    np.testing.assert_allclose(u, [2.0, -14.0])


def test_constant_velocity_adds_the_bare_sum_of_all_forces_so_far():
    law = ConstantVelocity(alpha=2.0, eta=0.5)
    state, first = command(law)
    np.testing.assert_allclose(first, -2.0 * FORCE - 0.5 * FORCE)
    state, second = command(law, state=state, tick=1)
    np.testing.assert_allclose(second, -2.0 * FORCE - 0.5 * 2 * FORCE)
    _, third = command(law, state=state, tick=2, estimate=ESTIMATE._replace(relative=np.zeros((3, 2))))
    np.testing.assert_allclose(third, -0.5 * 2 * FORCE)


def test_varying_velocity_moves_as_the_neighbours_say_and_falls_against_the_force():
    _, u = command(VaryingVelocity(alpha=2.0))
    motion = 3 * np.array([1.0, 0.0]) - np.array([2.0, 4.0])
    np.testing.assert_allclose(u, (motion - 2.0 * FORCE) / (3 - 1))


def test_varying_velocity_takes_neighbours_never_heard_for_at_rest():
    _, u = command(VaryingVelocity(alpha=2.0), inputs=SILENCE)
    np.testing.assert_allclose(u, -2.0 * FORCE / 2)


def test_varying_velocity_holds_what_it_heard_last():
    law = VaryingVelocity(alpha=2.0)
    state, before = command(law)
    state, held = command(law, state=state, tick=1, inputs=SILENCE)
    np.testing.assert_array_equal(held, before)
    half = Heard({"velocity": np.array([[5.0, 5.0], [77.0, 77.0], [0.0, 0.0]])}, np.array([True, False, False]))
    _, newer = command(law, state=state, tick=2, inputs=half)
    np.testing.assert_allclose(newer, (3 * np.array([5.0, 5.0]) - np.array([2.0, 4.0]) - 2.0 * FORCE) / 2)


def test_varying_velocity_takes_neighbours_velocities_from_the_estimate():
    law = VaryingVelocity(alpha=2.0, source="estimated")
    relative_velocity = np.array([[0.5, 0.0], [-1.0, 1.0], [0.0, 0.0]])
    _, u = command(law, estimate=ESTIMATE._replace(relative_velocity=relative_velocity), inputs=SILENCE)
    motion = 3 * (FLYING - [0.5, 0.0]) - (FLYING - [-1.0, 1.0])
    np.testing.assert_allclose(u, (motion - 2.0 * FORCE) / 2)


def test_varying_velocity_takes_neighbours_velocities_from_the_manoeuvre():
    # Everything grows by a tenth in a tick and moves by (1, 2): the neighbour at (1, 0) by (1.1, 2).
    theta = np.array([np.eye(2), 1.1 * np.eye(2)])
    told = replace(BRIEF, mission=Manoeuvre(theta, np.array([[0.0, 0.0], [1.0, 2.0]])))
    _, u = command(VaryingVelocity(alpha=2.0, source="feed-forward"), told, inputs=SILENCE)
    motion = 3 * np.array([10.0, 20.0]) - np.array([11.0, 20.0])
    np.testing.assert_allclose(u, (motion - 2.0 * FORCE) / 2)


def test_relaxation_mixes_the_law_with_the_input_now_flying():
    _, law = command(VaryingVelocity(alpha=2.0))
    _, relaxed = command(VaryingVelocity(alpha=2.0, relaxation=0.25))
    np.testing.assert_allclose(relaxed, 0.75 * FLYING + 0.25 * law)


def test_estimated_velocities_need_an_estimator_of_velocities():
    with pytest.raises(ValueError, match="'estimated' needs an estimator that tracks relative velocities"):
        command(VaryingVelocity(source="estimated"))


def test_feed_forward_needs_the_mission():
    with pytest.raises(ValueError, match="'feed-forward' needs the mission"):
        command(VaryingVelocity(source="feed-forward"))


def test_only_feed_forward_needs_the_mission():
    laws = [Static(), ConstantVelocity(), VaryingVelocity(), VaryingVelocity(source="estimated")]
    assert not any(law.wants.mission for law in laws)
    assert VaryingVelocity(source="feed-forward").wants.mission


@pytest.fixture(scope="module")
def zhao7():
    formation = PRESETS["zhao7"]
    links = Links.both_ways(7, formation.edges)
    w = np.array([4, 4, -2, -2, 8, -2, 8, -2, 1, 4, 4, 2]) / np.sqrt(213)
    stress = -np.take_along_axis(laplacian(formation, w), links.neighbours, axis=1)
    relative = formation.nominal[:, None] - formation.nominal[links.neighbours]
    return Brief(
        dt=0.01,
        number=np.arange(1, 8),
        nominal=formation.nominal,
        relative=np.where(links.present[..., None], relative, 0.0),
        present=links.present,
        back=links.back,
        stress=np.where(links.present, stress, 0.0),
        leads=links.present & formation.is_leader[links.neighbours],
        sensor=Sensor("coordinates", 0.01 * np.eye(2)),
        process=np.zeros((7, 8, 8)),
        persistence=0.0,
        lateness=0,
        leader=formation.is_leader,
        target=None,
        mission=corridor(np.arange(0, 125, 0.01)),
    )


def affine(brief, theta):
    seen = np.ones(brief.present.shape, dtype=bool)
    covariance = np.zeros((*seen.shape, 2, 2))
    return Estimate(brief.relative @ np.array(theta).T, seen, covariance, np.full(7, np.nan))


@pytest.mark.parametrize("theta", [[[1, 0], [0, 1]], [[0.3, 2], [-1, 0.7]], [[-1.375, -0.375], [0, 0]]])
def test_there_is_no_force_in_an_affine_formation(zhao7, theta):
    np.testing.assert_allclose(stress_force(zhao7, affine(zhao7, theta)), 0.0, atol=1e-12)


def test_there_is_a_force_out_of_an_affine_formation(zhao7):
    bent = affine(zhao7, np.eye(2))
    bent.relative[3, 0] += 0.1
    np.testing.assert_allclose(stress_force(zhao7, bent)[3], 0.1 * zhao7.stress[3, 0] * np.ones(2), atol=1e-12)
    np.testing.assert_allclose(np.delete(stress_force(zhao7, bent), 3, axis=0), 0.0, atol=1e-12)


def test_in_formation_followers_fly_the_velocity_of_the_manoeuvre(zhao7):
    law, tick = VaryingVelocity(source="feed-forward"), 5200
    _, u = law.command(
        zhao7,
        law.init(zhao7, (7,)),
        tick,
        STILL,
        affine(zhao7, zhao7.mission.theta[tick]),
        Heard({"velocity": np.zeros((7, 4, 2))}, zhao7.present),
    )
    np.testing.assert_allclose(u, zhao7.mission.velocity(tick, zhao7.nominal, 0.01), atol=1e-11)


def test_pilot_flies_the_velocity_of_the_target_and_pulls_toward_it():
    mission = Manoeuvre(np.array([np.eye(2), np.eye(2)]), np.array([[0.0, 0.0], [0.2, 0.0]]))
    u = pilot(BRIEF, mission, 3.0, 0, np.array([0.0, 1.5]))
    np.testing.assert_allclose(u, [0.2 / 0.1 + 3.0 * 1.0, 3.0 * -0.5])


def test_pilot_halves_its_error_every_tick_at_gain_one_half_per_tick(zhao7):
    position = np.array([1.0, -2.0]) + zhao7.mission.target(5000, zhao7.nominal)
    for tick in range(5000, 5010):
        position = position + 0.01 * pilot(zhao7, zhao7.mission, 50.0, tick, position)
    left = position - zhao7.mission.target(5010, zhao7.nominal)
    np.testing.assert_allclose(left, np.broadcast_to([1.0, -2.0], (7, 2)) / 2**10, atol=1e-12)


def test_leaders_follow_the_pilot_and_followers_the_law(zhao7):
    agent = Agent(zhao7, NoEstimator(), Static(alpha=2.0), leaders="pilot", leader_gain=1.0, limit=None)
    measured, position = np.random.default_rng(1).normal(size=(2, 7, 4, 2))
    position = position[:, 0]
    state, said = agent.sense(agent.init((7,)), 0, measured, zhao7.present, None)
    np.testing.assert_array_equal(said[INPUT]["velocity"], np.zeros((7, 2)))
    heard = {INPUT: Heard({"velocity": np.zeros((7, 4, 2))}, zhao7.present)}
    state, action = agent.act(state, 40, heard, position, None, None)
    np.testing.assert_allclose(action.input[:3], pilot(zhao7, zhao7.mission, 1.0, 40, position)[:3])
    np.testing.assert_allclose(action.input[3:], -2.0 * stress_force(zhao7, action.estimate)[3:])
    _, said = agent.sense(state, 1, measured, zhao7.present, None)
    np.testing.assert_array_equal(said[INPUT]["velocity"], action.input)


CLOCKS = np.array([5200, 5200, 5150, 5200, 5199, 5300, 0])


def test_a_leader_flies_by_its_own_clock(zhao7):
    position = np.random.default_rng(1).normal(size=(7, 2))
    together = pilot(zhao7, zhao7.mission, 3.0, CLOCKS, position)
    for agent, tick in enumerate(CLOCKS.tolist()):
        alone = pilot(zhao7.of(agent), zhao7.mission, 3.0, tick, position[agent])
        assert together[agent].tobytes() == alone.tobytes()
    right = pilot(zhao7, zhao7.mission, 3.0, 5200, position)
    assert (together != right).any(axis=1).tolist() == [False, False, True, False, True, True, True]


def test_feed_forward_flies_by_the_clock_of_the_agent_for_all_its_neighbours(zhao7):
    law, silence = VaryingVelocity(source="feed-forward"), Heard({"velocity": np.zeros((7, 4, 2))}, zhao7.present)
    estimate = affine(zhao7, np.eye(2))

    def commanded(tick):
        return law.command(zhao7, law.init(zhao7, (7,)), tick, STILL, estimate, silence)[1]

    together = commanded(CLOCKS)
    for agent, tick in enumerate(CLOCKS.tolist()):
        np.testing.assert_array_equal(together[agent], commanded(tick)[agent])
    assert (together != commanded(5200)).any(axis=1).tolist() == [False, False, True, False, True, True, True]


def test_everybody_rests_when_the_clock_is_past_the_manoeuvre(zhao7):
    late, law = len(zhao7.mission.theta) + 100, VaryingVelocity(source="feed-forward")
    position = zhao7.mission.target(late, zhao7.nominal)
    np.testing.assert_array_equal(pilot(zhao7, zhao7.mission, 3.0, late, position), 0.0)
    silence = Heard({"velocity": np.zeros((7, 4, 2))}, zhao7.present)
    estimate = affine(zhao7, np.eye(2))
    _, u = law.command(zhao7, law.init(zhao7, (7,)), late, STILL, estimate, silence)
    np.testing.assert_allclose(u, 0.0, atol=1e-12)
