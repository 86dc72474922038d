"""Leaders that keep their distances, and the swarm that takes its shape from them wherever it is."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from briefs import hears
from flying import plan_of

from affinet.planning import making as planning
from affinet.planning.checks import leaders_apart
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from agents.agent import Agent
from agents.estimate import Estimate
from agents.estimators.none import NoEstimator
from agents.laws.base import stress_force
from agents.laws.leaders import hold_distances
from agents.laws.single import Static
from analysis.metrics.errors import procrustes_error
from world.formation.nominal import Formation

COARSE = ("time.dt=0.01", "time.duration=12")
NOISELESS = ("dynamics={}", "sensing={sigma=1e-6}", 'agents.estimator="mle"')


def agent_of(plan, row):
    """The agent's brief, and its relative positions when all are where `position` says."""
    links, own = plan.world.links, plan.brief.of(row)

    def relative(position):
        return np.where(links.present[row][:, None], position[row] - position[links.neighbours[row]], 0.0)

    return own, relative


def estimate_of(z, known):
    return Estimate(z, known, np.zeros((*z.shape, z.shape[-1])), np.array(np.nan))


@pytest.mark.parametrize(
    "name",
    [("rigid",), ("rigid", "formation.preset=octa10", "formation.leaders=[7, 8, 9, 10]")],
    ids=["plane", "space"],
)
def test_leaders_go_down_the_gradient_of_how_far_their_distances_are_off(name):
    plan = plan_of(*name, *NOISELESS)
    nominal = plan.world.formation.nominal
    leaders = np.flatnonzero(plan.world.formation.is_leader)
    place = nominal + 0.3 * np.random.default_rng(1).normal(size=nominal.shape)

    def potential(position):
        pairs = combinations(leaders, 2)
        return sum(
            (((position[i] - position[j]) ** 2).sum() - ((nominal[i] - nominal[j]) ** 2).sum()) ** 2 / 4
            for i, j in pairs
        )

    for row in leaders:
        own, relative = agent_of(plan, row)
        u = hold_distances(own, 2.5, estimate_of(relative(place), own.present))
        slope = np.zeros(own.dimension)
        for axis in range(own.dimension):
            step = np.zeros_like(place)
            step[row, axis] = 1e-5
            slope[axis] = (potential(place + step) - potential(place - step)) / 2e-5
        assert np.abs(slope).min() > 0.01
        np.testing.assert_allclose(u, -2.5 * slope, rtol=1e-6, atol=1e-7)


def test_a_leader_stays_where_its_distances_are_kept_however_the_swarm_is_turned_and_moved():
    plan = plan_of("rigid")
    turned = plan.world.formation.nominal @ [[0.6, 0.8], [0.8, -0.6]] + [70.0, -3.0]
    for row in np.flatnonzero(plan.world.formation.is_leader):
        own, relative = agent_of(plan, row)
        z = relative(turned)
        np.testing.assert_allclose(hold_distances(own, 1.0, estimate_of(z, own.present)), 0.0, atol=1e-12)
        # A follower may be anywhere.
        z[~own.leads] *= 3.0
        np.testing.assert_allclose(hold_distances(own, 1.0, estimate_of(z, own.present)), 0.0, atol=1e-12)


def test_a_leader_it_knows_nothing_of_does_not_move_a_leader():
    plan = plan_of("rigid")
    row = 3
    own, relative = agent_of(plan, row)
    z = relative(2 * plan.world.formation.nominal)
    one = np.flatnonzero(own.leads)[0]
    u = hold_distances(own, 1.0, estimate_of(z, own.present & (np.arange(len(z)) != one)))
    (other,) = np.flatnonzero(own.leads)[1:]
    p = own.relative[other]
    np.testing.assert_allclose(u, -3 * (p @ p) * 2 * p)
    np.testing.assert_array_equal(hold_distances(own, 1.0, estimate_of(z, np.zeros(len(z), dtype=bool))), 0.0)


def test_leaders_keep_their_distances_and_followers_fly_the_law():
    plan = plan_of("rigid")
    links, own = plan.world.links, plan.brief
    agent = Agent(own, NoEstimator(), Static(alpha=2.0), leaders="distances", leader_gain=0.5, limit=None)
    measured = np.where(
        links.present[..., None], own.relative + np.random.default_rng(1).normal(size=own.relative.shape), 0.0
    )
    state, _ = agent.sense(agent.init((10,)), 0, measured, links.present, None)
    heard = hears(links.present, np.zeros((10, links.present.shape[1], 2)))
    # A position it should not look at: these leaders have no target.
    _, action = agent.act(state, 3, heard, np.full((10, 2), 1e3), None, None)
    np.testing.assert_array_equal(action.input[own.leader], hold_distances(own, 0.5, action.estimate)[own.leader])
    np.testing.assert_array_equal(action.input[~own.leader], -2.0 * stress_force(own, action.estimate)[~own.leader])


def test_nobody_is_told_where_leaders_that_keep_their_distances_should_be():
    assert not plan_of("rigid").told_mission.any()
    piloted = plan_of("rigid", 'agents.leaders="pilot"')
    np.testing.assert_array_equal(piloted.told_mission, piloted.world.formation.is_leader)


# Leaders that see each other


def test_leaders_that_do_not_see_each_other_are_refused_by_name():
    with pytest.raises(PlanError) as refused:
        planning.make(loading.load("rigid", ["formation.leaders=[2, 6, 8]"]))
    assert "there is no edge 2-6, 2-8, 6-8" in str(refused.value)
    assert planning.make(loading.load("rigid", ["formation.leaders=[2, 6, 8]", 'agents.leaders="pilot"']))


def test_only_the_edges_that_are_missing_are_named():
    square = Formation(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), ((1, 2), (3, 2), (3, 4), (1, 4)), (1, 2, 3))
    assert leaders_apart(square).says.endswith("there is no edge 1-3")
    assert leaders_apart(square).fatal
    complete = Formation(square.nominal, (*square.edges, (3, 1)), (1, 2, 3))
    assert not leaders_apart(complete).fatal


# The scenario


def test_everybody_starts_about_the_origin_leaders_too():
    world = plan_of("rigid", "formation.spread=0.5").world
    starts = np.array([replace(world, run_seed=seed).begin().position for seed in range(500)])
    assert starts.std(axis=(0, 2)) == pytest.approx(0.5, rel=0.1)
    assert np.abs(starts.mean(axis=0)).max() < 0.1
    correlation = np.corrcoef(starts.reshape(500, 20).T)
    assert np.abs(correlation - np.eye(20)).max() < 0.2


@cache
def flown(*overrides):
    plan = plan_of("rigid", *COARSE, *overrides)
    return plan.world.formation, rehearse(plan).arrays["position"]


def stretched(formation, position):
    """How far the distances of the leaders are off, in metres."""
    leaders = np.flatnonzero(formation.is_leader)
    pairs = np.array([*combinations(leaders, 2)]).T
    there, wanted = (
        np.linalg.norm(z[..., pairs[0], :] - z[..., pairs[1], :], axis=-1) for z in (position, formation.nominal)
    )
    return np.abs(there - wanted).max(axis=-1)


def error_of(formation, position):
    return procrustes_error(position, formation.nominal, np.ones(position.shape[:-1], dtype=bool))


@pytest.mark.parametrize(
    ("air", "left", "kept"), [((), 0.05, 0.05), (NOISELESS, 0.05, 1e-5)], ids=["noisy", "noiseless"]
)
def test_ten_agents_scattered_at_random_form_the_hexagon(air, left, kept):
    formation, position = flown(*air)
    error = error_of(formation, position)
    assert error[-1] < left * error[0]
    off = stretched(formation, position)
    assert off[0] > 1.0
    assert off[600:].max() < kept
    # Nobody told them where, and they took their shape elsewhere, turned.
    assert np.linalg.norm(position[-1] - formation.nominal, axis=-1).min() > 0.1


def test_leaders_that_are_left_alone_keep_no_distance():
    formation, position = flown(*NOISELESS, "agents.leader_gain=0")
    assert stretched(formation, position)[-1] == pytest.approx(stretched(formation, position)[0])
    assert error_of(formation, position)[-1] > 0.3 * error_of(formation, position)[0]
