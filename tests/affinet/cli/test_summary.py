"""What a summary and the closing table say: with what a run was flown, and the error that matters of it."""

import json
import platform
from dataclasses import replace
from importlib.metadata import version

import numpy as np
import pytest
from flying import plan_of

from affinet.cli import show
from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts.checkers import localized

VERSIONS = {
    "affinet": version("affinet"),
    "numpy": np.__version__,
    "zenoh": version("eclipse-zenoh"),
    "python": platform.python_version(),
}


def table(evidence, capsys):
    """What the closing table says, each row as its two cells."""
    show.outcome(evidence.outcome, evidence.plan)
    rows = [line.split("│")[1:3] for line in capsys.readouterr().out.splitlines() if line.count("│") == 3]
    return {name.strip(): says.strip() for name, says in rows if name.strip()}


def summary(evidence):
    """What the summary says, as it is written."""
    return json.loads(json.dumps(evidence.outcome.to_json(), allow_nan=False))


def test_a_run_says_with_what_it_was_flown(capsys):
    evidence = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=0.5", "seed=7", "agents.law=static"))
    told, rows = summary(evidence), table(evidence, capsys)
    assert told["flown"] == {"estimator": "ga-rkf", "law": "static", "seed": 7, "versions": VERSIONS}
    assert (rows["estimator, law"], rows["seed"]) == ("ga-rkf, static", "7")
    assert f"affinet {VERSIONS['affinet']}, numpy {VERSIONS['numpy']}" in rows["versions"]
    assert told["tracking_error"]["final"] == evidence.error[-1]
    assert rows["tracking error"].endswith(" m²")
    assert not told.keys() & {"localization_error", "goal_distance", "target_error", "errors"}


def test_agents_that_find_out_where_they_are_say_how_far_off_they_are(capsys):
    evidence = rehearse(plan_of("localization", "time.duration=0.3"))
    told, rows = summary(evidence), table(evidence, capsys)
    assert not evidence.error.any()  # at rest on their targets: it says nothing
    assert "tracking_error" not in told
    assert "tracking error" not in rows
    off = told["localization_error"]
    assert 0.0 < off["final"] < off["mean"] < off["max"]
    assert rows["localization error"] == f"mean {off['mean']:.4g} m  final {off['final']:.4g} m  max {off['max']:.4g} m"
    assert localized(off["final"] * 1.001, by=0.29)(evidence).verdict == "pass"
    assert localized(off["final"] * 0.999, by=0.29)(evidence).verdict == "fail"


def test_agents_that_pursue_a_target_say_how_far_it_is_and_how_well_they_know_it(capsys):
    evidence = rehearse(plan_of("target", "time.dt=0.01", "time.duration=0.3"))
    told, rows = summary(evidence), table(evidence, capsys)
    goal = evidence.arrays["target"]
    apart = np.linalg.norm(evidence.position - goal, axis=-1)
    assert told["goal_distance"]["final"] == pytest.approx(np.sqrt((apart[-1] ** 2).mean()), rel=1e-12)
    known = evidence.arrays["reference"][:, :, 0] - (goal - evidence.plan.world.formation.nominal)
    missed = np.sqrt((known**2).sum(axis=-1).mean(axis=-1))
    assert told["target_error"] == pytest.approx(
        {"mean": missed.mean(), "final": missed[-1], "max": missed.max()}, rel=1e-12
    )
    assert "tracking_error" not in told
    assert {"goal distance", "target error"} <= rows.keys()
    assert "tracking error" not in rows


REFUSED = (
    {"agent": 2, "by": "netem", "wrong": "flood", "count": 7},
    {"agent": 2, "by": "world", "wrong": "oversized", "count": 1},
    {"agent": None, "by": "netem", "wrong": "malformed", "count": 2},
)


def test_what_was_refused_is_said_of_each_agent_and_qualifies_the_verdict(capsys):
    evidence = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=0.5"))
    assert evidence.outcome.says == "pass"
    evidence = replace(evidence, outcome=replace(evidence.outcome, refused=REFUSED))
    show.outcome(evidence.outcome, evidence.plan)
    said = capsys.readouterr().out
    assert said.splitlines()[0].strip() == evidence.outcome.says == "pass, 10 wrong messages refused"
    rows = table(evidence, capsys)
    assert rows["wrong, of agent 2"] == "7 flood (netem), 1 oversized (world)"
    assert rows["wrong, of the control login"] == "2 malformed (netem)"
    assert summary(evidence)["refused"] == list(REFUSED)
    assert replace(evidence.outcome, verdict="fail").says == "fail"
