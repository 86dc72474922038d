"""`bench/all.py`: what is kept, what it is held against, and with which status it ends."""

import json
import runpy
import sys
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from paths import BENCH
from speed import floors, history, launched, lockstep, monte_carlo
from speed.launched import Cost
from speed.measured import Measured
from speed.problem import planned
from speed.rows import compared, missing
from speed.started import PeerFailed, all_of

from affinet.runtimes.launcher import LaunchRecord

ALL = BENCH / "all.py"
NAME = "run-step: affinet / another"


def ended(monkeypatch, file, costs, *arguments, spread=1.0):
    """The status that it ends with where affinet's runs cost so much more than those of a peer."""
    monkeypatch.setattr(
        monte_carlo,
        "measure",
        lambda rounds, _: [
            compared(NAME, np.linspace(costs, costs * spread, rounds), [1.0] * rounds),
            missing("x", "gone"),
        ],
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


def test_a_noisy_ratio_is_said_and_neither_kept_nor_compared(monkeypatch, tmp_path, capsys):
    file = tmp_path / "history.json"
    said = "1 of 2 rows are noisy on this machine now, and neither kept nor compared"
    assert ended(monkeypatch, file, 2.0, "--keep", spread=1.7) == 0
    assert said in (printed := capsys.readouterr().out)
    assert f"| {NAME} | 2.7 s | 1 s | 2.7 (2 to 3.4) | 5, noisy |" in printed
    assert not file.exists()
    assert ended(monkeypatch, file, 2.0, "--keep", "--rounds", "4") == 0  # so few cannot tell
    assert said in capsys.readouterr().out
    assert not file.exists()
    assert ended(monkeypatch, file, 2.0, "--keep", spread=1.3) == 0
    assert "noisy" not in capsys.readouterr().out
    assert ended(monkeypatch, file, 9.0, spread=1.7) == 0
    assert said in capsys.readouterr().out
    assert ended(monkeypatch, file, 9.0, spread=1.3) == 1


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

    monkeypatch.setattr(lockstep, "fly", lambda _: Cost(0.01, 0.01, 1.0, 10.0))
    monkeypatch.setattr(floors, "standing", failed)
    monkeypatch.setattr(floors, "is_installed", lambda transport: transport != "ZeroMQ")
    monkeypatch.setattr(lockstep.importlib.util, "find_spec", lambda _: None)
    rows = {row.name: row.ours for row in lockstep.measure("corridor", 2, 0.02) if row.kind == "nothing"}
    absent = "not installed: uv sync --inexact --group bench"
    assert {name: why for name, why in rows.items() if "by hand" not in name} == {
        "tick, 7 agents: GA-RKF / pipes, nobody computes": "it does not start",
        "tick, 7 agents: GA-RKF / ZeroMQ, nobody computes": absent,
        "tick, 7 agents: GA-RKF / Zenoh, nobody computes": "it does not start",
        "tick, 7 agents: GA-RKF / Ray actors, nobody computes": "it does not start",
    }
    assert {why for name, why in rows.items() if "by hand" in name} == {absent}


def test_a_floor_stands_through_its_rounds_and_none_is_left_where_one_dies():
    here = psutil.Process()
    others = here.children()  # of tests before it
    plan = planned("corridor", 5, "agents.estimator='ga-rkf'")
    with floors.standing("pipes", plan, 5) as flown:
        started = [one for one in here.children() if one not in others]
        assert all(flown().tick_s > 0.0 for _ in range(2))
        assert [one for one in here.children() if one not in others] == started
        started[0].kill()  # the world
        with pytest.raises(PeerFailed, match=r"floor\.py ended with status -9"):
            flown()
        assert not [one for one in started if one.is_running()]


def test_a_process_that_carries_several_agents_divides_its_memory(monkeypatch):
    processes = [("world", None, 90.0), ("host", 1, 50.0), ("host", 2, 16.0)]
    reports = [{"role": role, "id": number, "pss_mb": memory} for role, number, memory in processes]

    def launcher(plan, out, watch):  # noqa: ARG001
        def fly():
            for tick in (1, 3, 7, 9, 10):
                looks.append(tick)
                watch(tick, 0.0)
            return LaunchRecord(uninstructed=0, start_s=2.0, wall_s=1.0, processes=reports)

        return SimpleNamespace(fly=fly)

    looks = []
    child = SimpleNamespace(cpu_times=lambda: (0.5 * looks[-1], 0.25 * looks[-1]))
    monkeypatch.setattr(launched, "Launcher", launcher)
    monkeypatch.setattr(launched.psutil.Process, "children", lambda *_, **__: [child])
    plan = planned("corridor", 10, "agents.per_process=5")
    assert launched.fly(plan) == Cost(0.1, 0.75, 2.0, 10.0)
    # At the end of a run, processes are gone, and with them what they were busy with.
    assert np.isnan(launched.fly(planned("corridor", 9, "agents.per_process=5")).processor_s)


def test_what_too_few_ticks_cannot_tell_has_a_row_that_says_so():
    costs = {"RKF": [Cost(0.1)], "RKF unrecorded": [Cost(0.1)]}
    pairs = [pair for pair in lockstep.PAIRS if pair.theirs == "RKF unrecorded"]
    rows = [lockstep.row(7, pair, costs, {}) for pair in pairs]
    assert [row.ours for row in rows] == ["100 ms", "too few ticks to tell"]
