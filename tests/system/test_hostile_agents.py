"""A rogue agent in a run over processes: whatever it says on its own keys, the run fails by its name, or goes on without it."""

import json
import sys
from collections import Counter
from pathlib import Path

import pytest
from flying import PROCESSES, TRIANGLE
from hostile import ACT, catalogue
from paths import PROGRAMS

from affinet.planning import making as planning
from affinet.runtimes import run as runs
from affinet.runtimes.launcher import Launcher
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from affinet.verdicts import reading
from netem.wire.wrong import Wrong
from world.books.history import digest

pytestmark = PROCESSES

ROGUE = 2


@pytest.fixture
def flown(tmp_path, monkeypatch):
    """A run in which agent 2 is a rogue: what came of it, and its plan."""
    scenario = tmp_path / "triangle.toml"
    scenario.write_text(TRIANGLE)

    def flown(*says, **trust):
        overrides = [f"trust.{key}={json.dumps(value)}" for key, value in trust.items()]
        plan = planning.make(loading.load(str(scenario), overrides))
        command = [sys.executable, "-P", str(PROGRAMS / "hostile_agent.py"), *says]

        def launcher(*given, **told):
            return Launcher(*given, **told, programs={ROGUE: command})

        monkeypatch.setattr(runs, "Launcher", launcher)
        return fly(plan, "processes", tmp_path / "run", lambda *_: None), plan

    return flown


def counted(done):
    assert {one["agent"] for one in done.refused} <= {ROGUE}
    return {(one["by"], one["wrong"]): one["count"] for one in done.refused}


def test_all_of_it_is_dropped_counted_and_named_and_the_run_is_the_same(flown):
    done, plan = flown("all", wrong_messages="drop", messages_per_tick=1000)
    expected = Counter(("world" if one.on == ACT else "netem", str(one.wrong)) for one in catalogue())
    assert done.reasons == ()
    assert counted(done) == dict(expected)
    assert done.verdict == "pass"
    assert done.says == f"pass, {len(catalogue())} wrong messages refused"
    assert done.digest == digest(rehearse(plan).arrays)
    summary = json.loads((out := Path(done.out)).joinpath("summary.json").read_text())
    assert summary["refused"] == list(done.refused)
    assert reading.evidence(out).outcome.refused == done.refused


@pytest.mark.parametrize(
    ("says", "by", "wrong"),
    [
        ("act: input [1e+308, 0.0]", "world", Wrong.VALUE),
        ("measurement: 10 MB", "netem", Wrong.OVERSIZED),
        pytest.param("act: 10 MB", "world", Wrong.OVERSIZED, marks=pytest.mark.slow),
        pytest.param("act: heard one too many", "world", Wrong.MISCOUNTED, marks=pytest.mark.slow),
        pytest.param("measurement: garbage in it", "netem", Wrong.SHAPE, marks=pytest.mark.slow),
        pytest.param("input: payload nested 1,021 deep", "netem", Wrong.DEEP, marks=pytest.mark.slow),
        pytest.param("input: the number before", "netem", Wrong.REPEATED, marks=pytest.mark.slow),
    ],
)
def test_the_first_wrong_message_fails_the_run_and_names_the_agent(says, by, wrong, flown):
    assert says in map(str, catalogue())
    done, _ = flown(says)
    assert done.verdict == "fail"
    assert done.reasons[0].startswith((f"{by}: WireError: agent {ROGUE}", f"{by}: UninstructedLoss: agent {ROGUE}"))
    assert counted(done) == {(by, str(wrong)): 1}


def test_a_flood_ends_the_run_by_the_name_of_the_agent_and_holds_up_nobody_else(flown):
    """Before: the medium heard nothing any more, and nobody was to blame."""
    done, _ = flown("floods", wrong_messages="drop")
    assert done.verdict == "fail"
    assert f"refused of agent {ROGUE}: 100 malformed (netem), " in done.reasons[0]
    counts = counted(done)
    assert counts["netem", "malformed"] == 100
    assert counts["netem", "flood"] > 1000


def test_who_reads_no_more_is_named(flown):
    done, _ = flown("deaf")
    assert done.reasons[0].startswith(f"agent {ROGUE} (pid ")
    assert "sleeps (state S): nothing moved for " in done.reasons[0]
