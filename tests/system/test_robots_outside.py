"""Robots outside: a driver that flies what a world would have simulated gets the run of that world, bit for bit."""

import json
import shlex
import sys
from pathlib import Path

import numpy as np
import pytest
from flying import PROCESSES, digest_of
from paths import DOCS, PROGRAMS

from affinet.planning import making
from affinet.planning.plan import PlanError
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from world.books import history

pytestmark = PROCESSES

SHORT = ["time.duration=0.5", "time.dt=0.05", "record.enabled=false"]
EXAMPLE = DOCS / "examples" / "robots"


def driven(*overrides, wrong=None, by=()):
    """A scenario whose robots are those that it would simulate under these overrides, as far as they are the world's."""
    words = [sys.executable, str(PROGRAMS / "driver.py"), "corridor", json.dumps([*SHORT, *by])]
    command = shlex.join([*words, *([wrong] if wrong else [])])
    outside = ['world="external"', f"external.driver={json.dumps(command)}"]
    return loading.load("corridor", [*SHORT, *by, *outside, *overrides])


def flown(given, out):
    outcome = fly(making.make(given), "processes", out, lambda *_: None)
    return outcome, history.load(out / history.ARRAYS) if (out / history.ARRAYS).exists() else None


def test_robots_that_fly_as_the_world_would_are_its_run(out):
    outcome, _ = flown(driven(), out)
    assert (outcome.verdict, outcome.digest) == ("pass", digest_of("corridor", *SHORT)), outcome.reasons


def test_robots_that_fly_otherwise_are_not(out):
    """The counterpart: what stands in the scenario alone, and not outside, does not fly."""
    outcome, _ = flown(driven("formation.spread=2.0"), out)
    assert outcome.digest == digest_of("corridor", *SHORT)
    assert digest_of("corridor", *SHORT, "formation.spread=2.0") != outcome.digest


def test_hosts_fly_them_too(out):
    outcome, _ = flown(driven("agents.per_process=4"), out)
    assert outcome.digest == digest_of("corridor", *SHORT)


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ("malformed", "not MessagePack"),
        pytest.param("oversized", "trust.largest_message", marks=pytest.mark.slow),
        pytest.param("a field too much", "battery", marks=pytest.mark.slow),
        ("spoofed", "'driver' speaks for agent 3"),
        pytest.param("in another's name", "'world' speaks for agent 2", marks=pytest.mark.slow),
        pytest.param("past", "it says what is measured in tick 2, where 3 is due", marks=pytest.mark.slow),
        ("future", "it says what is measured in tick 4, where 3 is due"),
        pytest.param("repeated", "message 2 came where 3 was due", marks=pytest.mark.slow),
        pytest.param("skipped", "message 4 came where 3 was due", marks=pytest.mark.slow),
        pytest.param("two at once", "it says twice what is measured in tick 3", marks=pytest.mark.slow),
        ("a stranger", "expected some of [1, 4, 7], each once, got [99"),
        pytest.param("twice the same", "each once, got [1, 1, 1]", marks=pytest.mark.slow),
        pytest.param("too short", "Measured: measured: ", marks=pytest.mark.slow),
        ("not a number", "expected numbers of at most"),
        pytest.param("infinite", "expected numbers of at most", marks=pytest.mark.slow),
        ("no position", "agents that are told where they are need one"),
        ("dies", "driver (pid "),
        ("quiet", "driver"),
    ],
)
def test_what_a_driver_says_wrong_fails_the_run_by_name(wrong, says, out):
    outcome, _ = flown(driven(wrong=wrong), out)
    assert outcome.verdict == "fail"
    assert any(says in reason for reason in outcome.reasons), outcome.reasons
    assert outcome.ticks <= 4


def test_wrong_messages_may_be_dropped_and_counted(out):
    outcome, _ = flown(driven("trust.wrong_messages=drop", "time.patience=2", wrong="a stranger"), out)
    assert outcome.verdict == "fail"  # nobody says it again, and lockstep waits
    assert [one | {"by": None} for one in outcome.refused] == [
        {"agent": 2, "by": None, "wrong": "wrong shape", "count": 1}
    ]


def test_a_robot_that_is_silent_in_real_time_fails_the_run_by_name(out):
    real = ['time.mode="real"', "time.real.late=0.5", "time.real.factor=0.5", "time.duration=5.0"]
    outcome, _ = flown(driven(*real, wrong="robot 2 is quiet"), out)
    assert outcome.verdict == "fail"
    assert any(
        "the robot of agent 2 has said nothing of what is measured after tick 2" in reason for reason in outcome.reasons
    ), outcome.reasons


def test_a_driver_that_repeats_what_is_old_is_late_and_fails_the_run(out):
    real = ['time.mode="real"', "time.real.late=0.5", "time.real.factor=0.5", "time.duration=5.0"]
    outcome, _ = flown(driven(*real, wrong="stuck"), out)
    assert outcome.verdict == "fail"
    assert any("said nothing of what is measured after tick 2" in reason for reason in outcome.reasons), outcome.reasons
    assert outcome.timing.lateness["driver"].missed > 1


@pytest.mark.parametrize(
    "by_place",
    [
        "network.zones=[{centre=[0.0,0.0],radius=1.0,share=1.0}]",
        'timeline=[{verb="cut",links=["1-2"],when={tracking_error_below=0.01},lasts=0.1}]',
    ],
)
def test_what_goes_by_places_makes_every_robot_say_where_it_is(by_place, out):
    outcome, _ = flown(driven(by_place, wrong="nobody but leaders says where it is"), out)
    assert outcome.verdict == "fail"
    assert any("agent 4" in reason and "position" in reason for reason in outcome.reasons), outcome.reasons


def test_followers_need_not_say_where_they_are(out):
    outcome, arrays = flown(driven(wrong="nobody but leaders says where it is"), out)
    assert outcome.verdict == "pass", outcome.reasons
    assert np.isnan(arrays["position"][:, 3:]).all()
    assert not np.isnan(arrays["position"][:, :3]).any()


def example(*overrides):
    command = shlex.join([sys.executable, str(EXAMPLE / "driver.py")])
    return loading.load(EXAMPLE / "outside.toml", [f"external.driver={json.dumps(command)}", *overrides])


def test_the_example_flies_and_is_the_same_twice(tmp_path):
    flights = [flown(example("time.duration=4"), tmp_path / name) for name in ("one", "two")]
    (one, arrays), (two, _) = flights
    assert one.verdict == "pass", one.reasons
    assert one.digest == two.digest
    off = np.linalg.norm(arrays["position"][:-1] - arrays["target"], axis=-1)
    assert off[-1].max() < 0.3 * off[0].max()
    assert one.errors["edge_error"]["mean"] < 0.2


def test_the_example_flies_in_real_time(out):
    outcome, arrays = flown(
        example("time.duration=2", 'time.mode="real"', "time.real.late=60", "time.real.factor=0.2"), out
    )
    assert outcome.verdict == "pass", outcome.reasons
    assert not np.isnan(arrays["position"]).any()
    assert outcome.timing is not None
    assert outcome.timing.lateness["driver"].moments == outcome.ticks
    assert np.linalg.norm(arrays["position"][-1] - arrays["target"][-1], axis=-1).max() < 1.0


def test_in_one_process_there_is_nothing_outside(out):
    plan = making.make(driven())
    with pytest.raises(ScenarioError, match="over processes"):
        fly(plan, "inprocess", out, lambda *_: None)


@pytest.mark.parametrize("command", ["", "'unended"])
def test_what_is_no_command_line_is_refused(command):
    with pytest.raises(ScenarioError, match=r"external\.driver"):
        loading.load("corridor", ['world="external"', f"external.driver={json.dumps(command)}"])


def test_a_driver_that_is_not_there_fails_the_run(out):
    given = loading.load("corridor", [*SHORT, 'world="external"', 'external.driver="/nowhere/driver"'])
    outcome, _ = flown(given, out)
    assert outcome.verdict == "fail"
    assert "/nowhere/driver" in outcome.reasons[0]


def test_what_bodies_feel_is_refused_where_none_are_simulated():
    gust = {"verb": "gust", "agents": [4], "at": 0.1, "lasts": 0.1, "velocity": [1.0, 0.0]}
    with pytest.raises((ScenarioError, PlanError), match="a gust cannot push bodies"):
        making.make(loading.extended(driven(), [gust]))


def test_the_example_is_within_what_its_page_promises():
    text = Path(EXAMPLE / "driver.py").read_text()
    assert "affinet" not in text.replace('f"affinet/{brief', "").replace("docs/hardware.md", "")
