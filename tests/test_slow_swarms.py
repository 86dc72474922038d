"""A slow swarm is not a stalled one: a hundred processes on two cores, batches of five hundred ticks, agents that think."""

import json
import sys
from pathlib import Path

import pytest
from flying import PROCESSES, plan_of

from affinet import scenario
from affinet.launcher import Launcher
from affinet.plan import make
from affinet.run import fly

pytestmark = PROCESSES

PROGRAMS = Path(__file__).parent / "programs"
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
    path = tmp_path / "grid.json"
    path.write_text(json.dumps(grid()))
    plan = make(scenario.resolved_from(path))
    outcome = fly(plan, "processes", tmp_path / "run", lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.ticks == 100
    assert len(outcome.processes) == 102
    assert outcome.digest == fly(plan, "inprocess", tmp_path / "again", lambda *_: None).digest
