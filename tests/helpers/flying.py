"""Plans, and digests of runs in this process, that many tests share."""

from functools import cache

import pytest

from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from world.books.history import digest

# Tests that fly processes stay on one worker: two swarms of processes at once are too many for two cores.
PROCESSES = pytest.mark.xdist_group("processes")

# The smallest swarm: five processes.
TRIANGLE = """
[formation]
nodes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
edges = ["1-2", "2-3", "1-3"]
leaders = [1, 2, 3]
[manoeuvre]
preset = "hover"
[time]
dt = 0.05
duration = 0.5
[sensing]
sigma = 0.1
[agents]
estimator = "none"
law = "rest"
[record]
enabled = false
"""


@cache
def plan_of(name: str, *overrides: str) -> Plan:
    """The plan of a scenario, made once."""
    return planning.make(loading.load(name, overrides))


@cache
def digest_of(name: str, *overrides: str) -> str:
    """The digest of a scenario flown in this process, once."""
    return digest(rehearse(plan_of(name, *overrides)).arrays)
