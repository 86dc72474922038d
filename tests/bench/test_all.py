"""`bench/all.py`: what is kept, what it is held against, and with which status it ends."""

import json
import runpy
import sys

import pytest
from paths import BENCH
from speed import floors, history, lockstep, monte_carlo
from speed.measured import Measured
from speed.problem import planned
from speed.rows import compared, missing
from speed.started import PeerFailed, all_of

ALL = BENCH / "all.py"
NAME = "run-step: affinet / another"


def ended(monkeypatch, file, costs, *arguments):
    """The status that it ends with where affinet's runs cost so much more than those of a peer."""
    monkeypatch.setattr(
        monte_carlo,
        "measure",
        lambda rounds, _: [compared(NAME, [costs] * rounds, [1.0] * rounds), missing("x", "gone")],
    )
    monkeypatch.setattr(sys, "argv", [str(ALL), "--only", "runs", "--history", str(file), *arguments])
    with pytest.raises(SystemExit) as exit_:
        runpy.run_path(str(ALL), run_name="__main__")
    return exit_.value.code


def test_it_fails_where_a_ratio_is_a_fifth_worse_than_the_one_kept_last(monkeypatch, tmp_path, capsys):
    file = tmp_path / "history.json"
    assert ended(monkeypatch, file, 2.0) == 0
    assert "nothing was kept on such a machine" in capsys.readouterr().out
    assert not file.exists()
    assert ended(monkeypatch, file, 2.0, "--keep") == 0
    assert ended(monkeypatch, file, 2.3) == 0
    assert "worse" not in capsys.readouterr().out
    assert ended(monkeypatch, file, 2.5) == 1
    assert f"worse: {NAME}: 2.5 (2.5 to 2.5), was 2 (2 to 2)" in capsys.readouterr().out
    assert ended(monkeypatch, file, 1.0, "--keep") == 0
    assert ended(monkeypatch, file, 2.0) == 1
    assert len(history.read(file)) == 2


def test_other_machines_and_other_shares_are_no_measure(monkeypatch, tmp_path):
    file = tmp_path / "history.json"
    assert ended(monkeypatch, file, 2.0, "--keep") == 0
    assert ended(monkeypatch, file, 9.0, "--share", "0.5") == 0
    monkeypatch.setattr(history, "machine", lambda: "another")
    assert ended(monkeypatch, file, 9.0) == 0


def test_the_last_entry_that_has_a_ratio_counts():
    def entry(**ratios):
        return history.Entry("2026-01-01", "m", (0.0, 0.0), 1.0, {}, ratios, {})

    old, new = Measured(1.0, 1.0, 1.0, 5), Measured(2.0, 2.0, 2.0, 5)
    assert history.last([entry(a=old, b=old), entry(b=new)], entry()) == {"a": old, "b": new}


def test_a_history_is_read_as_it_was_kept(tmp_path):
    entry = history.Entry(
        "2026-01-01",
        "m",
        (1.5, 2.0),
        1.0,
        {"python": "3"},
        {"a": Measured(1.0, 0.5, 2.0, 5)},
        {"b": Measured(0.1, 0.1, 0.2, 5)},
    )
    history.keep(tmp_path / "h.json", entry)
    history.keep(tmp_path / "h.json", entry)
    assert history.read(tmp_path / "h.json") == [entry, entry]


@pytest.mark.parametrize("text", ["{", "[1]", json.dumps([{"day": "2026"}])])
def test_a_file_that_is_no_history_is_named(tmp_path, text):
    (tmp_path / "h.json").write_text(text)
    with pytest.raises(ValueError, match=r"h\.json is no history of bench/all\.py"):
        history.read(tmp_path / "h.json")


def test_the_history_that_is_committed_can_be_read():
    assert all(entry.ratios for entry in history.read(history.FILE))


# The peers


def test_all_peers_compute_the_same():
    off = monte_carlo.differences(planned("corridor", 70))
    assert set(off) == {"batched NumPy", "compiled loop", "filterpy", "affinet alone"}
    assert max(off.values()) < 1e-12


@pytest.mark.parametrize("peer", ["batched_numpy", "compiled", "filterpy_objects"])
def test_a_peer_that_computes_something_else_ends_it(monkeypatch, peer):
    right = getattr(monte_carlo.peers, peer)
    monkeypatch.setattr(monte_carlo.peers, peer, lambda *given: right(*given) + 1e-6)
    with pytest.raises(SystemExit, match="peers do not compute what affinet does"):
        monte_carlo.measure(1, 0.02)


def test_a_peer_that_ends_before_its_time_is_said_in_its_row(monkeypatch):
    with pytest.raises(PeerFailed, match=r"nothing\.py ended with status 1"), all_of("nothing", {"only": {}}):
        pass

    def failed(*_):
        raise PeerFailed("it does not start")

    flown = lockstep.Flown(0.01, 1.0, 10.0)
    monkeypatch.setattr(lockstep, "fly", lambda _: flown)
    monkeypatch.setattr(floors, "tick", failed)
    monkeypatch.setattr(floors, "is_installed", lambda transport: transport != "ZeroMQ")
    monkeypatch.setattr(lockstep.importlib.util, "find_spec", lambda _: None)
    rows = {row.name: row.ours for row in lockstep.measure("corridor", 2, 0.02) if row.kind == "nothing"}
    absent = "not installed: uv sync --inexact --group bench"
    assert rows == {
        "tick of 7 agents: GA-RKF / pipes, nobody computes": "it does not start",
        "tick of 7 agents: GA-RKF / ZeroMQ, nobody computes": absent,
        "tick of 7 agents: GA-RKF / Zenoh, nobody computes": "it does not start",
        "tick of 7 agents: GA-RKF / Ray actors, nobody computes": "it does not start",
        "tick of 7 agents: RKF / ZeroMQ and filterpy by hand": absent,
    }
