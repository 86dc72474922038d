"""A slow swarm is not a stalled one: a hundred processes on two cores, batches of five hundred ticks, agents that think."""

import sys

import pytest
import tomli_w
from flying import PROCESSES, TRIANGLE, plan_of
from paths import PROGRAMS

from affinet.runtimes.launcher import Launcher
from affinet.runtimes.run import fly
from world.books import history

pytestmark = PROCESSES

SIDE = 10


def grid():
    """A hundred agents who see their neighbours, straight and across, and estimate where these are."""
    place = {(row, column): SIDE * row + column + 1 for row in range(SIDE) for column in range(SIDE)}
    steps = ((0, 1), (1, 0), (1, 1), (1, -1))
    edges = [
        f"{agent}-{place[row + down, column + right]}"
        for (row, column), agent in place.items()
        for down, right in steps
        if (row + down, column + right) in place
    ]
    return {
        "formation": {
            "nodes": [[float(column), float(row)] for row, column in place],
            "edges": edges,
            "leaders": [1, SIDE, SIDE * SIDE],
            "spread": 0.1,
        },
        "manoeuvre": {"preset": "hover"},
        "time": {"dt": 0.02, "duration": 2.0},
        "sensing": {"sigma": 0.1},
        "agents": {"estimator": "rkf", "law": "rest"},
        "network": {"availability": 0.9},
    }


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_hundred_processes_take_off_and_pass_however_slowly(tmp_path):
    path = tmp_path / "grid.toml"
    path.write_text(tomli_w.dumps(grid()))
    plan = plan_of(str(path))
    outcome = fly(plan, "processes", tmp_path / "run", lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.ticks == 100
    assert len(outcome.processes) == 103  # the nursery, medium and world too
    assert outcome.digest == fly(plan, "inprocess", tmp_path / "again", lambda *_: None).digest


@pytest.mark.slow
def test_agents_that_think_and_batches_that_take_longer_than_patience_pass(tmp_path):
    path = tmp_path / "triangle.toml"
    path.write_text(TRIANGLE)
    plan = plan_of(str(path), "time.duration=3", "time.patience=2", "record.enabled=true", "record.every=500")
    thinking = [sys.executable, "-P", str(PROGRAMS / "wayward_agent.py"), "thinks"]
    out = tmp_path / "run"
    out.mkdir()
    flight = Launcher(plan, out, watch=lambda *_: None, programs=dict.fromkeys((1, 2, 3), thinking)).fly()
    assert flight.failure is None, flight.failure
    assert flight.wall_s > 60 * 0.1
    assert len(history.load(out / history.ARRAYS)["error"]) == 60
