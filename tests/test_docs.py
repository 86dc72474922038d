"""The documentation shows what is."""

import re
from pathlib import Path

import pytest
from flying import digest_of, plan_of

from affinet import sections
from affinet.run import fly

DOCS = Path(__file__).parents[1] / "docs"


def test_the_estimator_of_the_docs_flies_in_both_runtimes(tmp_path, out, monkeypatch):
    (code,) = re.findall(r"```python\n(# held\.py.*?)```", (DOCS / "estimators.md").read_text(), flags=re.DOTALL)
    (tmp_path / "held.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    held = ('agents.estimator="held:HoldLast"', "time.duration=1")
    outcome = fly(plan_of("corridor", *held), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("corridor", *held)


SECTIONS = ["formation", "manoeuvre", "time", "sensing", "dynamics", "agents", "network", "record"]


@pytest.mark.parametrize("section", SECTIONS)
def test_every_key_of_a_scenario_is_documented(section):
    text = (DOCS / "scenario.md").read_text()
    model = sections.Scenario.model_fields[section].annotation
    for key in model.model_fields:
        assert f"`{section}.{key}`" in text


def test_every_verb_of_the_timeline_is_documented():
    text = (DOCS / "scenario.md").read_text()
    for verb, model in sections.VERBS.items():
        assert f"| `{verb}` |" in text
        for key in set(model.model_fields) - {"verb"}:
            assert f"`{key}`" in text
