"""The documentation shows what is."""

import re
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
from flying import PROCESSES, digest_of, plan_of
from paths import ROOT

from affinet import library
from affinet.planning import making as planning
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading, profiles, verbs
from affinet.studies import quantities, study
from affinet.testing.swarm import Swarm

pytestmark = PROCESSES

DOCS = ROOT / "docs"


def test_the_estimator_of_the_docs_flies_in_both_runtimes(tmp_path, out, monkeypatch):
    (code,) = re.findall(r"```python\n(# held\.py.*?)```", (DOCS / "estimators.md").read_text(), flags=re.DOTALL)
    (tmp_path / "held.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    held = ('agents.estimator="held:HoldLast"', "time.duration=1")
    outcome = fly(plan_of("corridor", *held), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("corridor", *held)


def test_the_loss_of_the_docs_flies_in_both_runtimes(tmp_path, out):
    page = (DOCS / "extending.md").read_text()
    (code,) = re.findall(r"```python\n(# fading\.py.*?)```", page, flags=re.DOTALL)
    (losses,) = re.findall(r"^    loss = (.*)$", page, flags=re.MULTILINE)
    (tmp_path / "fading.py").write_text(code)
    over = (
        "time.duration=1",
        "network.availability=1.0",
        "network.profile=mine",
        f"network.profiles.mine.loss={losses}",
    )
    plan = planning.make(loading.load("corridor", over, tmp_path))
    outcome = fly(plan, "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == rehearse(plan).outcome.digest
    assert outcome.digest != digest_of("corridor", "time.duration=1", "network.availability=1.0")


def test_a_package_names_a_loss_as_the_docs_say():
    page = (DOCS / "extending.md").read_text()
    assert f'[project.entry-points."{profiles.IMPAIRMENTS}"]' in page


def test_the_realised_graph_of_the_docs_is_computed(tmp_path, monkeypatch):
    fly(plan_of("corridor", "time.duration=1"), "inprocess", tmp_path / "runs" / "RUN", lambda *_: None)
    (code,) = re.findall(r"```python\n(# realised\.py.*?)```", (DOCS / "network.md").read_text(), flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    names = {}
    exec(code, names)
    assert names["graph"].heard.shape == (100, 4, 24)
    assert not names["graph"].stabilised(plan_of("corridor", "time.duration=1").world.formation)[0].any()


def test_the_study_of_the_docs_can_be_flown_and_judged(tmp_path):
    (text,) = re.findall(r"```toml\n(title = .*?)```", (DOCS / "studies.md").read_text(), flags=re.DOTALL)
    (tmp_path / "mine.toml").write_text(text)
    planned = study.plans(study.load(str(tmp_path / "mine.toml")), quick=True)
    assert [case.labels["estimator"] for case, _ in planned] == ["none", "rkf", "none", "rkf"]


PROFILES = re.findall(r"^\| `(\w+)` \| (mean loss .*) \|$", (DOCS / "network.md").read_text(), flags=re.MULTILINE)


@pytest.mark.parametrize(("name", "says"), PROFILES)
def test_the_profiles_come_to_what_the_docs_say(name, says):
    plan = plan_of("corridor", "network.availability=1.0", f"network.profile={name}", "time.duration=1")
    (air,) = [finding.says for finding in plan.findings if finding.check == "air"]
    assert air.endswith(f": {says}")


def test_every_profile_and_model_is_documented():
    assert {name for name, _ in PROFILES} == set(profiles.presets())
    text = (DOCS / "network.md").read_text()
    for model in profiles.LOSSES:
        assert f"`{model}`" in text, model


def test_the_scenario_of_the_docs_flies(tmp_path):
    (text,) = re.findall(r"```toml\n(# patrol\.toml.*?)```", (DOCS / "scenario.md").read_text(), flags=re.DOTALL)
    (tmp_path / "patrol.toml").write_text(text)
    outcome = rehearse(planning.make(loading.load(str(tmp_path / "patrol.toml")))).outcome
    assert outcome.verdict == "pass", outcome.reasons


def test_every_check_and_quantity_of_a_study_is_explained():
    text = (DOCS / "studies.md").read_text().partition("## A study of your own")[2]
    checks = get_args(study.Claim.model_fields["check"].annotation)
    for word in (*checks, *quantities.NAMES):
        assert re.search(rf"^\| (`\w+`, )*`{word}`", text, re.MULTILINE), word


def test_the_page_of_scenarios_leads_to_every_verb():
    linked = re.findall(r"\[`(\w+)`\]\(reference/verbs\.md#(\w+)\)", (DOCS / "scenario.md").read_text())
    assert linked == [(verb, verb) for verb in verbs.VERBS]


def test_the_script_of_all_verbs_flies_and_each_touches_something():
    faults = re.findall(r"^\| `(\.fault\(.*\))` \|", (DOCS / "testing.md").read_text(), re.MULTILINE)
    given = loading.load("corridor", ("time.dt=0.05", "time.duration=16"))
    script = eval(f"swarm{''.join(faults)}", {"swarm": Swarm(given, library.run, lambda *_: None)})
    assert sorted(entry.verb for entry in script.scenario.timeline) == sorted(verbs.VERBS)
    flown = library.run(script.scenario)
    assert flown.outcome.verdict == "pass", flown.outcome.reasons
    assert all(bite.touched for bite in flown.bites)


def test_the_tests_in_the_docs_pass(tmp_path):
    for page in ("README.md", "docs/testing.md"):
        blocks = re.findall(r"```python\n(.*?)```", (DOCS.parent / page).read_text(), flags=re.DOTALL)
        tests = [block for block in blocks if "def test_" in block]
        assert tests
        (tmp_path / f"test_{Path(page).stem}.py").write_text("\n\n".join(tests))
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "--rootdir",
        str(tmp_path),
        str(tmp_path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stdout


def test_what_docs_have_one_make_can_be_made():
    targets = set(re.findall(r"^([a-z-]+):", (DOCS.parent / "Makefile").read_text(), flags=re.MULTILINE))
    pages = [DOCS.parent / "README.md", DOCS.parent / "CONTRIBUTING.md", *DOCS.glob("*.md")]
    asked = {word for page in pages for word in re.findall(r"(?:`|^    )make ([a-z-]+)", page.read_text(), flags=re.M)}
    assert "test-wheel" in asked
    assert asked - targets == set()
