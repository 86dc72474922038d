"""Who can pursue a target, and who is refused in one line."""

import pytest
from flying import plan_of
from pursuits import ALONE, NAME, SINGLE, TRIPLE, bodies, refusal

from agents.laws.pursuit import Pursuit

POINT = "{time=%s,position=[%s]}"


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (('agents.estimator="none"',), "the estimator has to report them"),
        (("target.order=1", ALONE), "derivatives up to 2"),
        (('agents.estimator="none"', *SINGLE), "derivatives up to 1"),
        (("target.order=1",), "a target of order 1 needs 2 gains k and gamma"),
        (('agents.parameters.target={output="optimal"}',), "fusion = 'redcho' wants output = 'smooth'"),
        (('agents.parameters.target={output="optimal",fusion="mean"}',), "fusion = 'mean' wants output = 'smooth'"),
        (('agents.parameters.target={fusion="median"}',), '"redcho", "mean" or "none", got "median"'),
        (
            (*bodies(3, 1, 3, 3), ALONE),
            "up to 3: the estimator has to report them, and the target to be of order 3 at least",
        ),
        (bodies(2, 1), "bodies are double-integrators; set it to 'single-integrator'"),
        (bodies(2, 1, 3, 3), "pursuit steers jerks, and bodies are double-integrators; set it to 'triple-integrator'"),
        (bodies(3, 1, 4, 6, 4), "pursuit steers snaps, and bodies are triple-integrators; set it to 'quadruple-i"),
        (bodies(4, 1, 2), "pursuit steers accelerations, and bodies are quadruple-integrators; set it to 'double-i"),
        (bodies(2), "agents.parameters.pursuit: kappa needs a gain for each of 1 to 4 times that bodies integrate"),
        (bodies(2, 1, -1), "agents.parameters.pursuit: with kappa [1.0, -1.0] agents leave the reference"),
        ((*TRIPLE, ALONE, "formation.leaders=[1,2,3]"), "formation.leaders: who leads is steered by velocities or acc"),
        (("agents.parameters.target.alpha=0.0",), "alpha must be above 0"),
        (
            ("agents.parameters.target.first=[[1.0,2.0]]",),
            "first has 2 numbers for each of the 10 agents, in their order",
        ),
        (("agents.parameters.target.internal=[[[1.0]]]",), "internal has 3 x 7 numbers for each of the 10 agents"),
        (("agents.parameters.target.first=[[1.0,2.0],[1.0]]",), "first has 2 numbers for each of the 10 agents"),
        (("target.latencies=[0.5,0.0031]",), "target.latencies"),
        (("target.latencies=[0.5]",), "a variance for each latency"),
        (("target.position=[1,2,3]",), "target.position"),
        ((f"target.path=[{POINT % (0, '0,0')}]",), "target.path"),
        ((f"target.path=[{POINT % (0, '0,0')},{POINT % (1, '0,0,0')}]",), "target.path.2.position: must be 2 numbers"),
        ((f"target.path=[{POINT % (1, '0,0')},{POINT % (1, '0,1')}]",), "times of the path must increase"),
        (
            (f"target.path=[{POINT % (1, '0,0')},{POINT % (1.001, '0,1')}]",),
            "target.path.2.time: 1.001 s is less than a tick (0.002 s) after the one before",
        ),
        (
            (f"target.path=[{POINT % (0, '0,0')},{POINT % (1, '0,1')}]", "target.true_intensity=1"),
            "a target on a path has no true_intensity",
        ),
    ],
)
def test_what_cannot_pursue_is_refused_in_one_line(overrides, says):
    assert says in refusal(*overrides)


def test_latencies_that_are_no_whole_number_of_ticks_are_named():
    said = refusal("target.latencies=[0.105,0.1]", "time.dt=0.01")
    assert "target.latencies: [0.105, 0.1] s are not whole numbers of ticks of 0.01 s" in said


def test_an_estimator_of_a_target_needs_one():
    assert "give the scenario a [target]" in refusal('agents.estimator="target"', name="localization")
    assert "give the scenario a [target]" in refusal('agents.estimator="target"', ALONE, name="localization")


def test_gains_of_the_laws_are_read_from_the_scenario():
    assert plan_of(NAME, "agents.parameters.pursuit={kappa=[4.0,5.0]}").law.build() == Pursuit([4.0, 5.0])
    for order in (1, 2, 3, 4):
        kappa = [[1.0], [1.0, 5.0], [1.0, 5.0, 2.0], [1.0, 5.0, 8.0, 7.0]][order - 1]
        made = plan_of(NAME, *bodies(order, *kappa), f"target.order={order}", ALONE)
        assert (made.law.build(), made.scenario.dynamics.order, made.agents.law.order) == (Pursuit(kappa), order, order)


def test_who_pursues_by_velocities_or_accelerations_may_have_leaders():
    for overrides in (SINGLE, ()):
        assert plan_of(NAME, *overrides, "formation.leaders=[1,2,3]").world.formation.is_leader.sum() == 3


def test_a_swarm_at_rest_begins_where_all_of_it_is_told():
    said = refusal("agents.parameters.jor.start=[[1.0,2.0]]", name="localization")
    assert "start has 2 numbers for each of the 10 agents, in their order" in said


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        ((), None),
        (("target.misses=0.99",), None),
        (("target.misses=1.0",), "no detection ever finds the target"),
        (("time.duration=0.75",), "a detection that takes 1 s (target.latencies) is not done in a run of 0.75 s"),
        (("time.duration=0.1",), "a detection that takes 1 or 0.5 s (target.latencies) is not done in a run of 0.1 s"),
    ],
)
def test_detections_that_find_nothing_are_noted(overrides, says):
    found = [finding for finding in plan_of(NAME, *overrides).findings if finding.check == "detections"]
    assert [finding.level for finding in found] == ["note"] * bool(says)
    assert all(says in finding.says for finding in found)
