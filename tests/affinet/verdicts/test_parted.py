"""Where a run that fails parts from one that passes: planted causes are found, in the order in which they act."""

import json
from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of

from affinet import load
from affinet.cli.commands import main
from affinet.cli.differing import _warn
from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts import measures
from affinet.verdicts.parted import NotAlike, parted
from netem.medium.verdict import Verdict

COARSE = ("time.dt=0.05", "time.duration=12", "network.availability=0.9", "agents.estimator=none")
CUT = 'timeline=[{verb="cut",at=6,until=9,links=["5->7","6->7"]}]'


@pytest.fixture(scope="module")
def runs():
    """One whose agent 7 hears nothing of two neighbours for three seconds, and one with other draws, undisturbed."""
    return rehearse(plan_of("corridor", *COARSE, CUT)), rehearse(plan_of("corridor", *COARSE, "seed=5"))


def test_the_agent_that_was_cut_off_is_named_and_what_was_lost_before(runs):
    found = parted(*runs)
    assert {one.agent for one in found.left} == {7}
    by_name = {one.quantity: one for one in found.left}
    age, error = by_name["age of its news"], by_name["error"]
    # The news stops when the cut begins, and the agent goes astray after that.
    assert 6.0 <= age.tick * 0.05 <= 6.5
    assert age.tick <= error.tick <= 9.0 / 0.05
    assert age.failing == pytest.approx(3.0, abs=0.2)
    assert [one.tick for one in found.left] == sorted(one.tick for one in found.left)
    assert found.lines()[0].startswith(f"{found.left[0].tick * 0.05:g} s (tick {found.left[0].tick}): ")


def test_of_a_moment_the_agent_that_is_farthest_off_then_is_looked_at(runs):
    failing, passing = runs
    off = np.linalg.norm(failing.position - failing.arrays["target"], axis=-1)
    other = np.linalg.norm(passing.position - passing.arrays["target"], axis=-1)
    for tick in (20, 100, 200):
        found = parted(failing, passing, tick)
        assert {one.agent - 1 for one in found.left} == {int(np.argmax((off - other)[tick]))}
        assert all(one.tick <= tick for one in found.left)


def test_what_links_lost_is_counted_in_the_seconds_before(runs):
    failing, passing = runs
    found = parted(failing, passing)
    links, channels = failing.plan.world.links, len(failing.plan.channels)
    assert (found.ends - found.begins) * 0.05 == pytest.approx(2.0)
    for one in found.before:
        src, dst = map(int, one.link.split("->"))
        lost = [
            int((run.arrays["verdicts"][found.begins : found.ends, :, links.index[src, dst]] > Verdict.DELAYED).sum())
            for run in (failing, passing)
        ]
        assert [one.failing, one.passing] == lost
        assert one.offered == channels * (found.ends - found.begins)


def test_a_run_is_held_against_another_of_its_kind_alone(runs):
    failing, passing = runs
    assert parted(passing, passing) is None
    with pytest.raises(NotAlike, match="different formations or clocks"):
        parted(failing, rehearse(plan_of("corridor", "time.dt=0.04", "time.duration=1")))
    with pytest.raises(NotAlike, match="different channels"):
        parted(failing, rehearse(plan_of("corridor", *COARSE, "agents.estimator=ga-rkf")))


def test_one_that_left_the_numbers_is_farther_off_than_any(runs):
    _, passing = runs
    position = passing.arrays["position"].copy()
    position[100:, 3] = np.nan
    lost = replace(passing, arrays=passing.arrays | {"position": position})
    found = parted(lost, passing)
    assert (found.left[0].agent, found.left[0].tick, found.left[0].failing) == (4, 100, np.inf)


def test_the_command_reads_both_or_flies_one_with_another_seed(tmp_path, capsys):
    kept = str(tmp_path / "kept")
    words = [
        "corridor",
        "--runtime",
        "inprocess",
        "--out",
        kept,
        "--set",
        *" --set ".join(COARSE).split(" "),
        "--set",
        CUT,
    ]
    assert main(["run", *words]) == 0
    capsys.readouterr()
    assert main(["diff", kept, "--seed", "5", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    other = rehearse(plan_of("corridor", *COARSE, CUT, "seed=5"))
    assert said["left"][0]["tick"] == parted(load(kept), other).left[0].tick
    assert main(["diff", kept, kept]) == 0
    assert capsys.readouterr().out == "no agent is farther off in it than in the other run\n"
    assert main(["diff", kept]) == 2
    assert "give the directory of a run that passes, or --seed to fly one" in capsys.readouterr().err
    assert main(["diff", kept, kept, "--at", "12"]) == 2
    assert capsys.readouterr().err == "--at 12: give a moment from 0 to 11.95 s\n"


def test_a_run_that_is_no_better_or_shorter_is_told(capsys):
    failing = rehearse(plan_of("corridor", *COARSE))
    lost = replace(failing.outcome, verdict="fail", reasons=("the swarm diverged at 3 s",))
    cut_off = {name: values[:60] for name, values in failing.arrays.items()}
    _warn(failing, replace(failing, outcome=lost, arrays=cut_off))
    first, second = capsys.readouterr().err.splitlines()
    assert first == "note: the other run fails too: the swarm diverged at 3 s"
    assert second == "note: the other run has 60 ticks: nothing is said of what came after them"
    _warn(failing, failing)
    assert not capsys.readouterr().err


def test_nobody_who_looks_at_a_run_changes_what_the_next_one_sees(runs):
    run, _ = runs
    looked_at = [*run.arrays.values(), run.error, run.position, run.present, run.embodied, run.awake, run.located]
    for values in looked_at:
        with pytest.raises(ValueError, match="read-only"):
            values[...] = 0


def test_what_matters_is_where_agents_think_they_are_or_the_target_is():
    cut = 'timeline=[{verb="cut",at=0.5,lasts=2,links=["1->4","6->4"]}]'
    found = parted(rehearse(plan_of("localization", cut)), rehearse(plan_of("localization")))
    assert (found.left[0].quantity, found.left[0].agent) == ("localization error", 4)
    assert {one.link for one in found.before} == {"1->4", "6->4"}
    short = "time.duration=0.4"
    found = parted(rehearse(plan_of("target", short)), rehearse(plan_of("target", short, "seed=2")))
    assert "target error" in {one.quantity for one in found.left}


@pytest.mark.parametrize(("name", "more"), [("localization", ()), ("target", ("time.duration=0.4",))])
def test_that_of_every_agent_comes_to_that_of_all(name, more):
    run = rehearse(plan_of(name, *more))
    _, whole = measures.over_time(run.plan, run.timeline, run.arrays)
    _, each = measures.by_agent(run.plan, run.timeline, run.arrays)
    told = ~np.isnan(each)
    expected = np.sqrt(np.where(told, each * each, 0.0).sum(axis=1) / told.sum(axis=1))
    there = ~np.isnan(whole)
    assert there.any()
    np.testing.assert_allclose(whole[there], expected[there], rtol=1e-9)
