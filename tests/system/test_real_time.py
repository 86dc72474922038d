"""Runs in real time: agents act by their own clocks on what has arrived, and everything else works as in lockstep.

Nothing here asks the machine to be quick: who is late is told, and what is checked holds however late it is.
"""

import json
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from awaiting import await_true
from flying import PROCESSES, TRIANGLE, digest_of, plan_of
from scripted import timeline

from affinet.cli import commands, status
from affinet.planning import making as planning
from affinet.runtimes.inject import Access, InjectRequest
from affinet.runtimes.launcher import Launcher
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import outcome as outcomes
from affinet.verdicts import reading
from netem.core import arrow
from netem.medium import deliveries, journal
from netem.medium.medium import JOURNAL
from netem.medium.verdict import Verdict
from world.books import history, timing

pytestmark = PROCESSES

DT = 0.05
# Four times slower than the clock on the wall: a busy machine has a fifth of a second for a tick.
SLOW = 'time.mode="real"', "time.real.factor=0.25", "time.real.late=60"
QUICK = 'time.mode="real"', "time.real.late=60"
BASE = (f"time.dt={DT}", "time.duration=2", "network.availability=1", "record.enabled=false", 'agents.estimator="rkf"')
WAYWARD = str(Path(__file__).parents[1] / "programs" / "wayward_agent.py")


def flown(out, name, *overrides):
    outcome = fly(plan_of(name, *overrides), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    return outcome


def triangle(tmp_path, *overrides):
    file = tmp_path / "triangle.toml"
    file.write_text(TRIANGLE)
    return planning.make(loading.load(str(file), overrides))


@pytest.fixture(scope="module")
def corridor(tmp_path_factory):
    """A run of the corridor through loss and delay, whose outcome and directory tests share."""
    out = tmp_path_factory.mktemp("real") / "run"
    lossy = ("network.availability=0.7", 'network.profiles.slow={delay={model="uniform",mean=0.03,jitter=0.02}}')
    return flown(out, "corridor", *BASE, *QUICK, *lossy, 'network.profile="slow"'), out


def test_with_time_enough_for_everybody_the_answers_are_those_of_lockstep(tmp_path):
    calm = (f"time.dt={DT}", "time.duration=1", "record.enabled=false", 'agents.estimator="rkf"')
    for number, factor in enumerate((0.4, 0.1, 0.02)):
        slow = ('time.mode="real"', f"time.real.factor={factor}", "time.real.late=60")
        outcome = flown(tmp_path / str(number), "corridor", *calm, *slow)
        if not outcome.timing.missed and "unsaid" not in outcome.messages["dropped"]:
            break
    assert outcome.digest == digest_of("corridor", *calm)


def test_every_process_tells_how_it_kept_its_time(corridor):
    outcome, out = corridor
    everybody = ["netem", "world", *(f"agent {number}" for number in range(1, 8))]
    assert sorted(outcome.timing.lateness) == sorted(everybody)
    rows = timing.read(out / timing.FILE)
    for name, of in outcome.timing.lateness.items():
        late = rows["late_s"].to_numpy()[np.array(rows["process"].to_pylist()) == name]
        assert of.moments == len(late) > 0
        assert of.max_ms == pytest.approx(1000.0 * late.max(), abs=1e-3)
        assert of.p50_ms <= of.p99_ms <= of.max_ms
    told = json.loads((out / outcomes.SUMMARY).read_text())["timing"]
    assert told["missed"] == outcome.timing.missed
    assert told["lateness"]["world"]["moments"] == 40


def test_no_message_arrives_before_it_is_due(corridor):
    outcome, out = corridor
    table = deliveries.read(out / deliveries.FILE)
    asked, taken = table["asked_s"].to_numpy(), table["taken_s"].to_numpy()
    assert len(asked) == outcome.messages["delivered"] - (_verdicts(out)[:, 0] == Verdict.DELIVERED).sum()
    assert (taken >= asked - 1e-6).all()
    assert 0.01 <= asked.min() <= asked.max() <= 0.05
    assert len(np.unique(asked)) > 0.4 * len(asked)  # seconds, and no ticks; channels of a link share them
    assert outcome.timing.delays.messages == len(asked)


def _verdicts(out):
    return history.load(out / history.ARRAYS)["verdicts"]


def test_losses_are_those_of_lockstep_but_for_what_nobody_said(corridor):
    outcome, out = corridor
    overrides = ("network.availability=0.7", 'network.profiles.slow={delay={model="uniform",mean=0.03,jitter=0.02}}')
    wanted = rehearse(plan_of("corridor", *BASE, *overrides, 'network.profile="slow"')).arrays["verdicts"]
    verdicts = _verdicts(out)
    said = verdicts != Verdict.UNSAID
    assert said.mean() > 0.2
    np.testing.assert_array_equal(verdicts[said] == Verdict.LOST, wanted[said] == Verdict.LOST)
    assert (verdicts == Verdict.LOST).sum() > 300
    assert outcome.messages["uninstructed"] == 0


def test_a_run_is_read_again_as_the_evidence_it_was_judged_by(corridor):
    outcome, out = corridor
    read = reading.evidence(out).outcome
    assert (read.digest, read.verdict, read.timing) == (outcome.digest, "pass", outcome.timing)


def test_the_journals_verdicts_are_those_of_a_replay_which_says_how_far_apart_the_flights_are(
    corridor, tmp_path, capsys
):
    _, out = corridor
    lockstep = ["--set", 'time.mode="lockstep"', "--runtime", "inprocess", "--out", str(tmp_path / "again")]
    assert commands.main(["replay", str(out), "--verdicts", *lockstep]) == status.PASS
    said = capsys.readouterr().err
    assert "m apart on average" in said
    before, after = (journal.read(run / JOURNAL) for run in (out, tmp_path / "again"))
    for column in ("tick", "src", "dst", "channel", "reason"):
        assert sorted(map(str, before[column].to_pylist())) == sorted(map(str, after[column].to_pylist()))
    kept = _verdicts(out) == Verdict.UNSAID
    np.testing.assert_array_equal(_verdicts(tmp_path / "again") == Verdict.UNSAID, kept)
    assert "100 % of the verdicts are the same" in said


FAULTS = {
    "cut": [{"verb": "cut", "links": ["1-2"], "at": 0.5, "lasts": 0.5, "in_flight": "hold"}],
    "partition": [{"verb": "partition", "groups": "halves", "at": 0.5, "lasts": 0.5}],
    "lose": [{"verb": "lose", "links": ["all"], "loss": 0.3, "at": 0.5, "lasts": 0.5}],
    "delay": [{"verb": "delay", "links": ["all"], "delay": 0.12, "at": 0.5, "lasts": 0.5}],
    "kill": [{"verb": "kill", "agents": [7], "at": 0.5}, {"verb": "restart", "agents": [7], "at": 1.0}],
    "warm": [
        {"verb": "kill", "agents": [7], "at": 0.5},
        {"verb": "restart", "agents": [7], "at": 1.0, "state": "warm"},
    ],
    "pause": [{"verb": "pause", "agents": [6], "at": 0.5}, {"verb": "resume", "agents": [6], "at": 1.0}],
    "clock": [{"verb": "clock", "agents": [2], "rate": -0.5, "at": 0.5, "lasts": 1.0}],
    "depart": [{"verb": "depart", "agents": [5], "at": 0.5}],
    "gust": [{"verb": "gust", "agents": [5], "velocity": [1.0, 0.0], "at": 0.5, "lasts": 0.5}],
    "bias": [{"verb": "bias", "links": ["1->2"], "by": [1.0, 0.0], "at": 0.5, "lasts": 0.5}],
    "lie": [{"verb": "lie", "agents": [3], "matrix": [[2.0, 0.0], [0.0, 1.0]], "at": 0.5, "lasts": 0.5}],
    "when": [{"verb": "cut", "links": ["1-2"], "when": {"tracking_error_below": 1e6}, "lasts": 0.5}],
}


TOGETHER = ("cut", "lose", "delay", "warm", "clock", "gust", "when")


def test_faults_of_links_agents_and_conditions_bite_in_one_flight(out):
    outcome = flown(out, "corridor", *BASE, *SLOW, timeline(*(fault for name in TOGETHER for fault in FAULTS[name])))
    assert len(outcome.faults) == len(TOGETHER)
    assert all(bite.touched for bite in outcome.faults)


def test_who_was_stopped_by_the_script_was_not_late(out):
    patient = [one if "late" not in one else "time.real.late=0.8" for one in SLOW]
    stopped = timeline({"verb": "pause", "agents": [6], "at": 0.5}, {"verb": "resume", "agents": [6], "at": 1.25})
    outcome = flown(out, "corridor", *BASE, *patient, stopped)  # for three seconds
    assert outcome.timing.lateness["agent 6"].max_ms < 800.0


@pytest.mark.slow
@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_bites(name, out):
    estimator = ('agents.estimator="ga-rkf"',) if name == "lie" else ()
    outcome = flown(out, "corridor", *BASE, *estimator, *SLOW, timeline(*FAULTS[name]))
    assert outcome.faults
    assert all(bite.touched for bite in outcome.faults)


def test_an_agent_whose_clock_runs_slow_acts_less_often_and_one_that_runs_fast_does_not_act_more(out):
    slow = {"verb": "clock", "agents": [4], "rate": -0.5, "at": 0.0}
    fast = {"verb": "clock", "agents": [5], "rate": 0.5, "at": 0.0}
    outcome = flown(out, "corridor", *BASE, *SLOW, timeline(slow, fast))
    moments = {name: of.moments for name, of in outcome.timing.lateness.items()}
    assert moments["agent 4"] <= 22
    assert moments["agent 5"] <= 40


@pytest.mark.slow
def test_timers_of_ones_own_are_kept(out):
    timers = "time.real.timers=[{agents=[4],rate=0.5,phase=0.9},{agents=[5],jitter=0.1,drift=-0.2}]"
    outcome = flown(out, "corridor", *BASE, *SLOW, timers)
    moments = {name: of.moments for name, of in outcome.timing.lateness.items()}
    assert moments["agent 4"] <= 20 < moments["agent 1"]
    assert moments["agent 5"] <= 33


def test_agents_of_one_process_wake_together(out):
    outcome = flown(out, "corridor", *BASE, *SLOW, "agents.per_process=4")
    assert {"agent 1", "agent 7"} <= outcome.timing.lateness.keys()
    assert outcome.tracking_error["final"] < outcome.tracking_error["max"]


def test_what_is_injected_holds(out):
    plan = plan_of("corridor", *BASE, *SLOW)
    under_way, done = threading.Event(), []
    thread = threading.Thread(target=lambda: done.append(fly(plan, "processes", out, lambda *_: under_way.set())))
    thread.start()
    await_true(lambda: (out / "control.json").exists() or under_way.is_set(), "it does not fly")
    access = Access.to(out)
    answer = access.ask(InjectRequest("cut", links=("1-2",), lasts_s=0.3).order(plan.scenario))
    thread.join()
    (outcome,) = done
    assert outcome.verdict == "pass", outcome.reasons
    (bite,) = outcome.faults
    assert bite.touched
    assert bite.fault.start == answer.k


def test_who_does_not_act_any_more_fails_the_run_and_is_named(tmp_path):
    plan = triangle(tmp_path, 'time.mode="real"', "time.real.late=0.5", "time.duration=20")
    launcher = Launcher(plan, tmp_path / "run", watch=lambda *_: None, programs={2: [sys.executable, WAYWARD, "hangs"]})
    assert "agent 2 has not acted for" in launcher.fly().failure


def test_in_one_process_there_is_no_real_time(out):
    plan = plan_of("corridor", *BASE, *SLOW)
    for fly_it in (rehearse, lambda plan: fly(plan, "inprocess", out, lambda *_: None)):
        with pytest.raises(ScenarioError, match=r"time\.mode: a run in real time flies over processes"):
            fly_it(plan)
    assert not out.exists()


@pytest.mark.parametrize(
    ("overrides", "says"),
    [
        (("time.real.timers=[{agents=[4],phase=0.9}]",), "acts after it should have waked again"),
        (("time.real.timers=[{agents=[44]}]",), "agent 44 does not exist"),
        (("time.real.timers=[{agents=[4],phase=0.1}]", "agents.per_process=2"), "wake together"),
        (('agents.estimator="centralized"',), "centralized"),
    ],
)
def test_what_cannot_fly_in_real_time_is_refused(overrides, says):
    with pytest.raises(ScenarioError, match=says):
        planning.make(loading.load("corridor", (*BASE, *SLOW, *overrides)))


def test_a_recording_shows_how_late_processes_were(out):
    shown = [one for one in BASE if "record" not in one]
    flown(out, "corridor", *shown, *SLOW, "time.duration=1")
    assert (out / "run.rrd").read_bytes().count(b"timing/agent_4")
    with pytest.raises(arrow.TableError):
        timing.read(out / "graph.arrows")
