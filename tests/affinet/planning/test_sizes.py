"""The smallest swarms, and those of which nobody is left: flown, or refused in one line."""

import numpy as np
import pytest
from extremes import BASES
from flying import plan_of
from scripted import timeline

from affinet.planning import limits
from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.sections import Scenario, TrustSection
from affinet.studies.batch import fly_all
from analysis.metrics.errors import procrustes_error, root_mean_square, tracking_error
from analysis.models import graph

TRIANGLE = {"nodes": [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], "edges": ["1-2", "1-3", "2-3"]}
PAIR = {"nodes": [[0.0, 0.0], [1.0, 0.0]], "edges": ["1-2"]}
ALONE = {"nodes": [[1.0, 2.0]], "edges": []}


def resting(formation, estimator, law="rest"):
    return {
        "formation": formation,
        "manoeuvre": {"preset": "hover"},
        "time": {"dt": 0.05, "duration": 0.25},
        "sensing": {"sigma": 0.1},
        "agents": {"estimator": estimator, "law": law},
    }


@pytest.mark.parametrize(
    ("formation", "law", "words"),
    [
        # IndexError at the first batch, or "cannot reshape array of size 0 into shape (1,0,newaxis)"
        (
            {**ALONE, "leaders": [1]},
            "rest",
            "graph: one agent has nobody to see or hear: give a second node, and an edge to it",
        ),
        ({**PAIR, "edges": [], "leaders": [1]}, "rest", "agents [2] cannot be reached from agent 1"),
        (
            {**PAIR, "leaders": [1]},
            "static",
            "an affine map of 2 dimensions needs 3 leaders that lie on no common line",
        ),
        ({**TRIANGLE, "leaders": [1, 2, 3]}, "static", "every agent is a leader: nobody is left to follow"),
        (
            {**TRIANGLE, "leaders": []},
            "static",
            "an affine map of 2 dimensions needs 3 leaders that lie on no common line",
        ),
    ],
)
@pytest.mark.parametrize("estimator", ["none", "conral", "jor", "crkf"])
def test_what_is_no_swarm_is_refused(formation, law, words, estimator):
    with pytest.raises(PlanError) as error:
        planning.make(Scenario.model_validate(resting(formation, estimator, law)))
    assert str(error.value).endswith(words)


@pytest.mark.parametrize(
    "estimator", ["none", "rkf", "imm", "ral", "conral", "ga-rkf", "mmse", "edge-kf", "joint-kf", "crkf", "jor"]
)
@pytest.mark.parametrize(
    "formation", [{**PAIR, "leaders": [1]}, {**TRIANGLE, "leaders": [1, 2, 3]}], ids=["two", "all lead"]
)
def test_the_smallest_swarms_fly(formation, estimator):
    made = planning.make(Scenario.model_validate(resting(formation, estimator)))
    assert rehearse(made).outcome.verdict == "pass"
    assert np.isfinite(fly_all(made, [1, 2], 1).quantities["error"]).all()


def test_two_agents_leave_a_recording(tmp_path):
    made = planning.make(Scenario.model_validate(resting({**PAIR, "leaders": [1]}, "rkf")))
    assert fly(made, "inprocess", tmp_path / "run", lambda *_: None).verdict == "pass"


@pytest.mark.parametrize("base", ["swarm", "line-of-sight", "target"])
@pytest.mark.parametrize("verb", ["kill", "depart"])
@pytest.mark.parametrize(("at", "ticks"), [(0.0, 5), (0.1, 3)])
def test_a_run_in_which_nobody_is_left_is_no_pass(base, verb, at, ticks):
    entries = [{"verb": verb, "agents": ["all"], "at": at}]
    flown = rehearse(planning.make(Scenario.model_validate({**BASES[base], "timeline": entries})))
    assert flown.outcome.verdict == "vacuous"  # it passed, with null for its tracking error
    assert flown.outcome.tracking_error["final"] is None
    words = f"nobody took part in {ticks} of 5 ticks: there is no tracking error, and it proved nothing"
    assert flown.outcome.reasons == (words,)


def test_a_run_that_everybody_sleeps_through_is_no_pass():
    asleep = timeline({"verb": "pause", "agents": ["all"], "at": 0.0})
    done = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=0.5", asleep)).outcome
    assert (done.verdict, done.reasons) == ("vacuous", ("nobody was awake in any tick: it proved nothing",))


def test_nobody_for_a_while_is_no_pass_either():
    gap = timeline({"verb": "depart", "agents": ["all"], "at": 0.1}, {"verb": "rejoin", "agents": ["all"], "at": 0.2})
    flown = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=0.5", gap))
    assert flown.outcome.verdict == "vacuous"
    assert flown.outcome.tracking_error["mean"] is None


def test_metrics_of_nobody_are_no_numbers():
    nowhere, nobody = np.zeros((3, 0, 2)), np.zeros((3, 0), dtype=bool)
    assert np.isnan(tracking_error(nowhere, nowhere, nobody)).all()
    assert np.isnan(root_mean_square(nowhere, nobody)).all()
    assert procrustes_error(nowhere, nowhere[0], nobody).tolist() == [0.0] * 3


def test_one_agent_is_connected_to_itself():
    alone = np.zeros((4, 1, 1), dtype=bool)
    assert graph.connected(alone).all()
    assert graph.algebraic_connectivity(alone).tolist() == [0.0] * 4


def test_check_says_that_half_a_turn_by_theta_collapses_the_formation():
    half = "{time=%s,theta=[[%s,0],[0,%s]],offset=[0,0]%s}"

    def said(first, last):
        made = planning.make(loading.load("corridor", [f"manoeuvre={{keyframes=[{first},{last}]}}"]))
        return [(finding.level, finding.says) for finding in made.findings if finding.check == "manoeuvre"]

    assert said(half % (0.0, 1, 1, ""), half % (9.0, -1, -1, ""))[1] == (
        "note",
        "keyframes 1 to 2: on the way the formation shrinks to 0.0% of its width, as entries of theta go straight; "
        "to turn it, give keyframes an angle (rad)",
    )
    assert said(half % (0.0, 1, 1, ""), half % (9.0, 1, 1, "")) == [
        ("ok", "the formation turns by 0 rad from keyframe to keyframe")
    ]
    whole = "0.9999999999999998"
    assert said(half % (0.0, 1, 1, ""), half % (9.0, whole, whole, ""))[1] == (
        "note",
        "keyframes 1 to 2: theta is the same but for rounding, and nothing turns; "
        "for a full turn, give keyframes an angle (rad)",
    )
    assert said(half % (0.0, 1, 1, ",angle=0.0"), half % (9.0, 1, 1, ",angle=6.283185307179586")) == [
        ("ok", "the formation turns by 6.28 rad from keyframe to keyframe")
    ]


def test_agents_that_say_more_at_once_than_is_taken_do_not_fly():
    given = ['formation={preset="swarm50"}', "agents.law=static", "agents.estimator=joint-kf", "time.duration=0.1"]
    assert planning.make(loading.load("corridor", given))
    with pytest.raises(
        PlanError, match=r"agents say up to .* at once, and 1 KiB are taken; raise trust\.largest_message"
    ):
        planning.make(loading.load("corridor", [*given, "trust.largest_message=1024"]))


def test_agents_that_speak_more_often_than_is_looked_at_do_not_fly():
    said, trust = np.full(11, 100.0), TrustSection(messages_per_tick=10)
    (finding,) = limits.messages(said, plan_of("corridor").world, {}, trust)
    assert finding.fatal
    assert "agents speak 11 times in a tick, and 10 messages are looked at" in finding.says
    assert not limits.messages(said[:10], plan_of("corridor").world, {}, trust)
