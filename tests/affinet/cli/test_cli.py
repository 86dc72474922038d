"""The command line as a user meets it."""

import json
import re
import subprocess
import sys

import pytest
from flying import PROCESSES
from paths import ROOT

pytestmark = PROCESSES


def affinet(*arguments, cwd=ROOT):
    command = [sys.executable, "-m", "affinet", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, check=False)


def test_json_is_the_last_line_and_has_every_figure(out):
    done = affinet("run", "corridor", "--duration", "1", "--seed", "3", "--json", "--out", str(out))
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout.splitlines()[-1])
    promised = {
        "verdict",
        "digest",
        "ticks",
        "wall_s",
        "ticks_per_s",
        "real_time_factor",
        "tracking_error",
        "messages",
        "processes",
        "out",
    }
    assert promised <= set(summary)
    assert set(summary["tracking_error"]) == {"mean", "final", "max"}
    assert set(summary["messages"]) == {
        "ticks",
        "offered",
        "copies",
        "delivered",
        "dropped",
        "in_flight",
        "transport_lost",
        "uninstructed",
    }
    assert set(summary["processes"][0]) == {"role", "id", "pid", "pss_mb", "exit"}
    assert (summary["verdict"], summary["ticks"], summary["messages"]["uninstructed"]) == ("pass", 100, 0)


def test_options_override_the_scenario(out):
    options = ("--estimator", "rkf", "--availability", "0.25", "--duration", "0.5", "--runtime", "inprocess")
    done = affinet("run", "corridor", *options, "--set", "formation.spread=0.0", "--out", str(out))
    assert done.returncode == 0, done.stderr
    flown = json.loads((out / "scenario.json").read_text())
    assert flown["agents"]["estimator"] == "rkf"
    assert flown["network"]["availability"] == 0.25
    assert flown["formation"]["spread"] == 0.0
    assert "pass" in done.stdout


def test_bad_input_is_one_line_and_exit_2():
    done = affinet("run", "corridor", "--set", "network.availabilty=0.5")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "network.availabilty" in line
    assert "did you mean 'availability'" in line


def test_a_run_directory_is_never_overwritten_nor_is_such_a_run_announced(out):
    short = ("run", "corridor", "--duration", "0.1", "--runtime", "inprocess", "--out", str(out))
    assert affinet(*short).returncode == 0
    again = affinet(*short)
    assert again.returncode == 2
    (line,) = again.stderr.splitlines()
    assert "holds a run already" in line


def test_a_run_that_has_no_place_is_not_announced(tmp_path):
    (tmp_path / "file").touch()
    done = affinet("run", "corridor", "--duration", "0.1", "--out", str(tmp_path / "file"))
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"'{tmp_path / 'file'}': File exists; ")


@pytest.mark.parametrize(
    "words", [("run", "corridor", "--out="), ("replay", ""), ("study", "paper-003", "--out="), ("fit", "")]
)
def test_an_empty_path_is_none(words, tmp_path):
    done = affinet(*words, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.endswith(": it is empty: name a directory\n")
    assert list(tmp_path.iterdir()) == []


def test_check_says_why_a_scenario_cannot_fly():
    done = affinet("check", "hexa", "--set", "formation.leaders=[4,5,7]", "--json")
    assert done.returncode == 2
    report = json.loads(done.stdout)
    assert report["flies"] is False
    assert any(f["level"] == "error" and "1.327 >= 1" in f["says"] for f in report["findings"])


def test_check_prints_a_table():
    done = affinet("check", "hexa")
    assert done.returncode == 0
    assert "can fly" in done.stdout
    assert "0.873 < 1" in done.stdout


def test_a_design_is_written_once_and_checked_by_its_name(tmp_path):
    ask = ("design", "grid", "--agents", "45", "--range", "2.25", "--settle", "12")
    done = affinet(*ask, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    says, how = done.stdout.splitlines()
    assert re.fullmatch(r"45 agents, \d+ edges, \d+ leaders: what is slowest settles to 1/e in \d+\.\d s", says)
    assert how == "designed-grid.toml: affinet run designed-grid.toml --runtime inprocess"
    checked = affinet("check", "designed-grid.toml", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout
    assert "can fly" in checked.stdout
    again = affinet(*ask, "--out", "designed-grid.toml", cwd=tmp_path)
    assert again.returncode == 2
    assert "is there already; name another file with --out" in again.stderr


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("grid", "--agents", "45", "--range", "1"),
            "--range 1: agents 1, 2, 3, 4, 5, 6 and 39 more are in no clique",
        ),
        (("grid", "--agents", "45", "--range", "-1"), "'-1': give a number from 1e-09 to 1e+09"),
        (("grid", "--range", "2"), "--agents: how many there are in the grid?"),
        (("nowhere.csv", "--range", "2"), "nowhere.csv: no such file; give one with a node in each line"),
    ],
)
def test_what_cannot_be_designed_is_said_and_leaves_no_file(words, says, tmp_path):
    done = affinet("design", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr.splitlines()[-1]
    assert list(tmp_path.iterdir()) == []


def test_a_diverged_swarm_fails(out):
    absurd = (
        "--set",
        "timeline=[{verb='lie',at=0,agents=['all'],matrix=[[1e9,0],[0,1e9]]}]",
        "--duration",
        "1",
        "--runtime",
        "inprocess",
    )
    done = affinet("run", "corridor", *absurd, "--out", str(out), "--json")
    assert done.returncode == 1
    summary = json.loads(done.stdout.splitlines()[-1])
    assert summary["verdict"] == "fail"
    assert "diverged" in summary["reasons"][0]
    assert summary["tracking_error"]["final"] is None


README = re.findall(r"^    (affinet [^\n#]+)", (ROOT / "README.md").read_text(), flags=re.MULTILINE)


def test_the_readme_tells_the_truth(tmp_path):
    assert len(README) >= 5
    for command in README:
        _, *arguments = command.split()
        coarse = ["--set", "time.dt=0.05"] if "partition" in arguments else ["--duration", "1"]
        short = coarse if arguments[0] == "run" and "--duration" not in arguments else []
        done = affinet(*arguments, *short, cwd=tmp_path)
        assert done.returncode == 0, done.stdout + done.stderr
