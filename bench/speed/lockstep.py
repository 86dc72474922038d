"""A tick over processes: GA-RKF against floors in which nobody computes, and RKF against a swarm that is built by hand.

The floors carry the messages of a tick of GA-RKF, and compute nothing. The swarm built by hand computes the estimates of RKF,
which is looked at first, and keeps arrays of the run; affinet records with its journal and its viewer's file.
"""

from __future__ import annotations

import importlib.util
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Literal, NamedTuple

import numpy as np
from speed import floors, handbuilt_swarm
from speed.launched import Cost, fly
from speed.monte_carlo import TOLERANCE, affinet
from speed.problem import planned
from speed.rows import Row, compared, missing
from speed.started import PeerFailed

_TICKS, _BARE_TICKS, _CHECKED = 250, {"Ray actors": 250}, 40
_USUAL_BARE_TICKS = 1000
_PER_HOST = 5
_FUSED, _ALONE, _HOSTS, _BARE = "GA-RKF", "RKF", f"RKF, {_PER_HOST} in a process", "RKF unrecorded"
_BY_HAND = "ZeroMQ and filterpy by hand"
_GROUP = "not installed: uv sync --inexact --group bench"

_Flight = Callable[[], Cost]


class Pair(NamedTuple):
    """Whose cost is held against whose."""

    what: str
    cost: Literal["tick_s", "processor_s", "start_s", "memory_mb"]
    ours: str
    theirs: str


PAIRS = (
    *(Pair("tick", "tick_s", _FUSED, transport) for transport in floors.TRANSPORTS),
    Pair("tick", "tick_s", _ALONE, _BY_HAND),
    Pair("tick", "tick_s", _HOSTS, _BY_HAND),
    Pair("tick", "tick_s", _HOSTS, _ALONE),
    Pair("tick", "tick_s", _ALONE, _BARE),
    Pair("processors' time of a tick", "processor_s", _ALONE, _BY_HAND),
    Pair("processors' time of a tick", "processor_s", _HOSTS, _BY_HAND),
    Pair("processors' time of a tick", "processor_s", _HOSTS, _ALONE),
    Pair("processors' time of a tick", "processor_s", _ALONE, _BARE),
    Pair("start", "start_s", _ALONE, _BY_HAND),
    Pair("start", "start_s", _HOSTS, _ALONE),
    Pair("memory of an agent", "memory_mb", _ALONE, _BY_HAND),
    Pair("memory of an agent", "memory_mb", _HOSTS, _ALONE),
)


def measure(scenario: str, rounds: int, share: float) -> list[Row]:
    """Costs of a tick of a scenario, of its start, of memory, and of recording."""
    costs, absent = defaultdict[str, list[Cost]](list), dict[str, str]()
    with _flights(scenario, share, absent) as flights:
        for _ in range(rounds):
            for name, flight in flights.items():
                if name not in absent:
                    try:
                        costs[name].append(flight())
                    except PeerFailed as failure:
                        absent[name] = str(failure)
    agents = planned(scenario, 1).world.formation.agents
    return [row(agents, pair, costs, absent) for pair in PAIRS]


@contextmanager
def _flights(scenario: str, share: float, absent: dict[str, str]) -> Iterator[Mapping[str, _Flight]]:
    ticks = max(5, round(_TICKS * share))
    fused, filtered = planned(scenario, ticks, "agents.estimator='ga-rkf'"), planned(scenario, ticks)
    hosted = planned(scenario, ticks, f"agents.per_process={_PER_HOST}")
    bare = planned(scenario, ticks, "record.enabled=false")
    flights: dict[str, _Flight] = {}
    with ExitStack() as standing:
        for transport in floors.TRANSPORTS:
            if not floors.is_installed(transport):
                absent[transport] = _GROUP
                continue
            try:
                bare_ticks = max(5, round(_BARE_TICKS.get(transport, _USUAL_BARE_TICKS) * share))
                flights[transport] = standing.enter_context(floors.standing(transport, fused, bare_ticks))
            except PeerFailed as failure:
                absent[transport] = str(failure)
        for name, plan in ((_FUSED, fused), (_ALONE, filtered), (_HOSTS, hosted), (_BARE, bare)):
            flights[name] = partial(fly, plan)
        if importlib.util.find_spec("zmq") is None:
            absent[_BY_HAND] = _GROUP
        else:
            _check(scenario, max(5, round(_CHECKED * share)))
            flights[_BY_HAND] = lambda: handbuilt_swarm.fly(filtered).cost
        yield flights


def _check(scenario: str, ticks: int) -> None:
    plan = planned(scenario, ticks)
    ours = affinet(plan, range(plan.scenario.seed, plan.scenario.seed + 1))[:, 0]
    off = float(np.abs(handbuilt_swarm.fly(plan, as_affinet=True).estimate - ours).max())
    if not off < TOLERANCE:
        raise SystemExit(f"bench/speed: the swarm built by hand estimates something else, off by {off:g} m")


def row(agents: int, pair: Pair, costs: Mapping[str, Sequence[Cost]], absent: Mapping[str, str]) -> Row:
    """What came of a pair."""
    theirs = f"{pair.theirs}, nobody computes" if pair.theirs in floors.TRANSPORTS else pair.theirs
    name = f"{pair.what}, {agents} agents: {pair.ours} / {theirs}"
    if pair.theirs in absent:
        return missing(name, absent[pair.theirs])
    own, other = ([getattr(cost, pair.cost) for cost in costs[whose]] for whose in (pair.ours, pair.theirs))
    if not np.isfinite([own, other]).all():
        return missing(name, "too few ticks to tell")
    return compared(name, own, other, "MB" if pair.cost == "memory_mb" else "s")
