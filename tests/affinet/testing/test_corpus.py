"""What hunts leave for the next."""

import json

import pytest

from affinet.cli import commands
from affinet.scenario.wrong import ScenarioError
from affinet.testing import corpus
from affinet.testing.trial import Trial

CUT = {"verb": "cut", "at": 0.0, "links": ["2->4"]}
TRIAL = Trial(("network.availability=0.9",), 3, ([CUT], [{"verb": "kill", "at": 0.1, "agents": [4]}]))
HUNT = ("hunt", "corridor", "--set", "time.dt=0.05", "--duration", "2", "--estimator", "rkf", "--verbs", "dropout")


def test_what_is_kept_is_read_again_once(tmp_path):
    assert corpus.read(tmp_path / "none") == []
    assert corpus.keep(tmp_path / "kept", "corridor", [(TRIAL, ("bounded(5)",)), (TRIAL, ("bounded(5)",))]) == 1
    assert corpus.keep(tmp_path / "kept", "corridor", [(TRIAL, ("bounded(5)",))]) == 0
    (found,) = corpus.read(tmp_path / "kept")
    assert found.trial == TRIAL
    assert found.file.name.startswith("breaks-")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"seed": -1}, "seed: Input should be greater"),
        ({"seed": "1"}, "seed: Input should be a valid integer"),
        ({"faults": []}, "faults: List should have at least 1 item"),
        ({"faults": [[{"at": 1.0}]]}, "faults: Value error, a fault is one entry with its verb"),
        ({"faults": [[CUT, CUT]]}, "faults: Value error, a fault is one entry with its verb"),
        ({"fault": []}, "fault: Extra inputs are not permitted"),
    ],
)
def test_a_file_that_is_none_of_a_corpus_is_named(change, says, tmp_path):
    corpus.keep(tmp_path, "corridor", [(TRIAL, ())])
    (file,) = tmp_path.iterdir()
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(ScenarioError, match="covers-") as raised:
        corpus.read(tmp_path)
    assert says in str(raised.value)


def test_a_file_that_is_no_json_and_a_folder_that_is_a_file_are_named(tmp_path):
    (tmp_path / "broken.json").write_text("{")
    with pytest.raises(ScenarioError, match=r"broken\.json: it: Invalid JSON"):
        corpus.read(tmp_path)
    with pytest.raises(ScenarioError, match="it is a file; name a folder"):
        corpus.read(tmp_path / "broken.json")


def test_what_broke_flies_first_in_the_next_hunt(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    known = Trial((), 1, ([{"verb": "dropout", "at": 0.0, "links": ["2->4"], "p": 1.0}],))
    elsewhere = Trial((), 1, ([{"verb": "dropout", "at": 0.0, "links": ["2->44"], "p": 1.0}],))
    off = Trial(("network.availabilty=1",), 1, known.faults)
    corpus.keep(tmp_path / "kept", "corridor", [(known, ("x",)), (elsewhere, ()), (off, ())])
    options = ("--invariant", "bounded(5)", "--corpus", "kept", "--budget", "1", "--seed", "8", "--json")
    assert commands.main([*HUNT, *options, "--duration", "4"]) == 1
    said = capsys.readouterr()
    found = json.loads(said.out.splitlines()[-1])
    assert found["found"][0]["seed"] == 1
    assert found["tried"]["schedules"] == 1
    assert said.err.count("left out, as it does not fit corridor") == 2
    assert "agent 44 does not exist" in said.err
    assert "kept: 1 flown first" in said.err
    assert len(list((tmp_path / "kept").iterdir())) > 3


def test_what_covers_something_new_is_kept(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    options = ("--invariant", "bounded(1e9)", "--corpus", "kept", "--budget", "6")
    assert commands.main([*HUNT, *options]) == 0
    capsys.readouterr()
    kept = corpus.read(tmp_path / "kept")
    assert 1 < len(kept) <= 6
    assert commands.main([*HUNT, *options]) == 0
    assert f"kept: {len(kept)} flown first, 0 new" in capsys.readouterr().err
