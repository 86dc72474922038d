"""Plans, and digests of runs in this process, that many tests share."""

from functools import cache

from affinet import plan as planning
from affinet import scenario
from affinet.inprocess import Swarm
from affinet.plan import Plan
from world.history import digest


@cache
def plan_of(name: str, *overrides: str) -> Plan:
    """The plan of a scenario, made once."""
    return planning.make(scenario.load(name, overrides))


@cache
def digest_of(name: str, *overrides: str) -> str:
    """The digest of a scenario flown in this process, once."""
    swarm = Swarm(plan_of(name, *overrides))
    swarm.fly(lambda _: None, batch=50)
    return digest(swarm.history.arrays())
