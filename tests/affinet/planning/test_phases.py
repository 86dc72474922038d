"""What `affinet check` says of the phases of a timeline: the stress that agents' own fits complete, and what it leaves open."""

import numpy as np
import pytest
from flying import plan_of

from affinet.planning import phases
from affinet.planning.phases import Graph
from agents.estimators.ral import RelativeAffineLocalization
from agents.exchange import Heard
from agents.laws.base import stress_force

TIMELINES = {
    "one way": '{ verb = "cut", at = 1, links = ["6->4", "7->5"] }',
    "missing": '{ verb = "cut", at = 1, links = ["6-7"] }',
    "too few": '{ verb = "cut", at = 1, links = ["3->6", "7->6"] }',
}


def plan(*entries, name="corridor", overrides=()):
    return plan_of(name, "time.duration=4", *overrides, f"timeline=[{', '.join(entries)}]")


def said(made):
    return [(found.check, found.level, found.says) for found in made.findings if found.check.startswith("phase")]


def force_of(made, measured, position):
    """What RAL makes of these positions: the force sum_j l_ij zhat_ij of every agent, shape (N, D)."""
    links, brief, estimator = made.world.links, made.brief, RelativeAffineLocalization()
    seen = measured[links.slots] & links.present
    edges = np.where(seen[..., None], position[:, None] - position[links.neighbours], 0.0)
    state, _ = estimator.sense(brief, estimator.init(brief, (links.agents,)), edges, seen)
    nobody = np.zeros(seen.shape, dtype=bool)
    maps = {"local": np.zeros((*seen.shape, 2, 2)), "feasible": nobody}
    _, estimate = estimator.fuse(brief, state, {"theta": Heard(maps, nobody)}, None)
    return stress_force(brief, estimate)


@pytest.mark.parametrize("graph", ["zhao7", "hexa10"])
def test_the_completed_stress_is_what_the_force_under_ral_depends_on_positions_by(graph):
    made = plan(overrides=(f'formation.preset="{graph}"',))
    links, swarm, rng = made.world.links, made.swarm, np.random.default_rng(3)
    steered = ~swarm.leader
    for _ in range(20):
        measured = rng.random(len(links)) < 0.7
        matrix, _ = phases.completed_stress(swarm, links, Graph(measured, np.ones(links.agents, dtype=bool), steered))
        position = np.where(steered[:, None], rng.normal(size=(links.agents, 2)), 0.0)
        expected = force_of(made, measured, position)[steered]
        np.testing.assert_allclose(matrix @ position[steered], expected, atol=1e-9)


def test_a_phase_says_what_is_missing_and_which_eigenvalues_are_left():
    ((check, level, says),) = said(plan(TIMELINES["one way"]))
    assert (check, level) == ("phase 1 s", "ok")
    assert says == (
        "from 1 to 4 s without 6->4, 7->5: completed stress of the followers has eigenvalues 0.1370, 0.2414, 0.4111, 0.4829"
    )


def test_agents_that_measure_two_neighbours_are_not_controlled():
    ((_, level, says),) = said(plan(TIMELINES["missing"]))
    assert level == "note"
    assert says.endswith("eigenvalues 0.0000, 0.0000, 0.6852, 0.8222; 2 modes uncontrolled under RAL")


def test_who_measures_too_few_edges_for_a_fit_is_named():
    ((_, level, says),) = said(plan(TIMELINES["too few"]))
    assert level == "note"
    assert "agents [6] measure too few edges for a fit" in says


def test_phases_begin_and_end_where_the_graph_changes_and_nowhere_else():
    gust = '{ verb = "gust", at = 1.5, lasts = 1, agents = [4], velocity = [1.0, 0.0] }'
    of_leaders = '{ verb = "cut", at = 3, until = 3.5, links = ["1-2"] }'
    cut = '{ verb = "cut", at = 1, until = 2, links = ["6-7"] }'
    gone = '{ verb = "depart", at = 2, until = 3, agents = [7] }'
    found = said(plan(cut, gust, gone, of_leaders))
    assert [check for check, _, _ in found] == ["phase 1 s", "phase 2 s"]
    assert found[0][2].startswith("from 1 to 2 s without 7->6, 6->7: ")
    assert found[1][2].startswith("from 2 to 3 s without agents [7]: ")
    assert found[1][2].endswith("eigenvalues 0.0000, 0.3421, 0.7738; 1 mode uncontrolled under RAL")


def test_a_graph_that_comes_back_is_told_once():
    cut = '{ verb = "cut", at = 1, lasts = 0.1, every = 0.5, links = ["6-7"] }'
    ((check, _, says),) = said(plan(cut))
    assert check == "phase 1 s"
    assert says.startswith("from 1 to 1.1 s, and 5 times more, without 7->6, 6->7: ")


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param('verb = "dropout", links = ["6-7"]', id="not measured"),
        pytest.param('verb = "lose", links = ["6-7"], loss = 1.0', id="all lost"),
        pytest.param('verb = "partition", groups = [[6], [1, 2, 3, 4, 5, 7]]', id="apart"),
        pytest.param('verb = "pause", agents = [6]', id="paused"),
        pytest.param('verb = "kill", agents = [6]', id="killed"),
    ],
)
def test_whatever_takes_edges_away_is_a_phase(fault):
    assert [check for check, _, _ in said(plan(f"{{ at = 1, {fault} }}"))] == ["phase 1 s"]


@pytest.mark.parametrize(
    "fault",
    [
        pytest.param('verb = "lose", links = ["6-7"], loss = 0.9', id="most lost"),
        pytest.param('verb = "dropout", links = ["6-7"], p = 0.5', id="half measured"),
        pytest.param('verb = "delay", links = ["6-7"], delay = 0.1', id="late"),
    ],
)
def test_what_leaves_some_of_an_edge_is_none(fault):
    assert not said(plan(f"{{ at = 1, {fault} }}"))


def test_what_waits_for_a_condition_is_in_no_phase():
    made = plan('{ verb = "cut", when = { tracking_error_below = 0.05 }, links = ["6-7"] }')
    (found,) = [one for one in made.findings if one.check.startswith("phase")]
    assert (found.check, found.level) == ("phases", "ok")
    assert found.says == "of 1 that wait for a condition, nobody knows the time: these faults are in no phase"


def test_where_nobody_is_left_to_follow_it_says_so():
    ((_, level, says),) = said(plan('{ verb = "depart", at = 1, agents = ["followers"] }'))
    assert (level, says) == ("note", "from 1 to 4 s without agents [4, 5, 6, 7]: no follower takes part")


def test_a_mode_whose_eigenvalue_is_negative_runs_away():
    """Local RAL fed back can destabilise: one link less is enough."""
    ((_, level, says),) = said(plan('{ verb = "cut", at = 1, links = ["2->4"] }'))
    assert level == "note"
    assert "eigenvalues -0.0173, " in says
    assert says.endswith("; 1 mode runs away under RAL")
