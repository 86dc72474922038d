"""The examples of docs/agents.md in a swarm, over processes: they fly, through losses, a kill and a pause."""

import shutil
import sys

import numpy as np
import pytest
from flying import PROCESSES, plan_of
from paths import DOCS

from affinet.runtimes.run import fly
from world.books import history

pytestmark = PROCESSES

PYTHON = f'"5" = "{sys.executable} {DOCS / "examples" / "agent.py"}"'
NODE = f'"5" = "node {DOCS / "examples" / "node" / "agent.mjs"}"'
EXAMPLES = [
    pytest.param(PYTHON, id="python"),
    pytest.param(NODE, id="node", marks=pytest.mark.skipif(shutil.which("node") is None, reason="no node on the path")),
]
AIR = ("time.dt=0.05", "time.duration=5", 'agents.estimator="none"', "record.enabled=false", "manoeuvre.preset=hover")


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_keeps_its_place_among_ours(example, out):
    plan = plan_of("corridor", *AIR, "network.availability=1", f"agents.programs={{ {example} }}", "agents.limit=0.5")
    outcome = fly(plan, "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    arrays = history.load(out / history.ARRAYS)
    away = np.linalg.norm((arrays["position"][:-1] - arrays["target"])[:, 4], axis=-1)
    assert away[-1] < 0.3 * away[0]
    assert np.linalg.norm(arrays["input"][:, 4], axis=-1).max() <= 0.5 * (1 + 1e-9)


@pytest.mark.parametrize("example", EXAMPLES)
def test_an_example_goes_on_through_losses_a_kill_and_a_pause(example, out):
    faults = (
        '{verb="kill",at=1.0,agents=[5]},{verb="restart",at=1.5,agents=[5]},'
        '{verb="pause",at=2.5,agents=[5]},{verb="resume",at=3.0,agents=[5]}'
    )
    air = ("network.availability=0.7", "network.delay_ticks=1", f"timeline=[{faults}]")
    outcome = fly(
        plan_of("corridor", *AIR, *air, f"agents.programs={{ {example} }}"), "processes", out, lambda *_: None
    )
    assert outcome.verdict == "pass", outcome.reasons
