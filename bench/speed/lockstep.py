"""A tick over processes: GA-RKF against floors in which nobody computes, and RKF against a swarm that is built by hand.

The floors carry the messages of a tick of GA-RKF, and compute nothing. The swarm built by hand computes the estimates of RKF,
which is looked at first, and keeps arrays of the run; affinet records with its journal and its viewer's file.
"""

from __future__ import annotations

import importlib.util
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np
from speed import floors, handbuilt_swarm
from speed.monte_carlo import TOLERANCE, affinet
from speed.problem import planned
from speed.rows import Row, compared, missing
from speed.started import PeerFailed

from affinet.planning.plan import Plan
from affinet.runtimes.launcher import Launcher

_TICKS, _CHECKED = 250, 40
_PEER_BY_HAND = "ZeroMQ and filterpy by hand"
_GROUP = "not installed: uv sync --inexact --group bench"


class Flown(NamedTuple):
    """Seconds of a tick, seconds to the first tick, and the largest agent's memory in MB, its share of what is shared."""

    tick_s: float
    start_s: float
    memory_mb: float


def fly(plan: Plan) -> Flown:
    """A run over processes.

    Raises
    ------
    SystemExit
        When it fails.
    """
    with tempfile.TemporaryDirectory() as out:
        flight = Launcher(plan, Path(out), watch=lambda *_: None).fly()
    if flight.failure or flight.uninstructed:
        raise SystemExit(f"the run failed: {flight.failure}, {flight.uninstructed} lost")
    memory = max(process["pss_mb"] for process in flight.processes if process["role"] == "agent")
    return Flown(flight.wall_s / plan.world.ticks, flight.start_s, memory)


def measure(scenario: str, rounds: int, share: float) -> list[Row]:
    """Costs of a tick of a scenario, of its start, of memory, and of recording."""
    ticks = max(5, round(_TICKS * share))
    fused = planned(scenario, ticks, "agents.estimator='ga-rkf'")
    filtered = planned(scenario, ticks)
    bare = planned(scenario, ticks, "record.enabled=false")
    by_hand = importlib.util.find_spec("zmq") is not None
    if by_hand:
        _check(scenario, max(5, round(_CHECKED * share)))
    transports = [transport for transport in floors.TRANSPORTS if floors.is_installed(transport)]
    absent = {transport: _GROUP for transport in floors.TRANSPORTS if transport not in transports}
    costs: dict[str, list[float]] = defaultdict(list)
    for _ in range(rounds):
        for transport in [one for one in transports if one not in absent]:
            try:
                costs[transport].append(floors.tick(transport, fused, ticks))
            except PeerFailed as failure:
                absent[transport] = str(failure)
        costs["GA-RKF"].append(fly(fused).tick_s)
        recorded = fly(filtered)
        costs["RKF"].append(recorded.tick_s)
        costs["start"].append(recorded.start_s)
        costs["memory"].append(recorded.memory_mb)
        costs["unrecorded"].append(fly(bare).tick_s)
        if by_hand:
            theirs = handbuilt_swarm.fly(filtered)
            costs["by hand"].append(theirs.tick_s)
            costs["start by hand"].append(theirs.start_s)
            costs["memory by hand"].append(theirs.memory_mb)
    return _rows(f"{fused.world.formation.agents} agents", costs, absent, by_hand)


def _check(scenario: str, ticks: int) -> None:
    plan = planned(scenario, ticks)
    ours = affinet(plan, range(plan.scenario.seed, plan.scenario.seed + 1))[:, 0]
    off = float(np.abs(handbuilt_swarm.fly(plan, as_affinet=True).estimate - ours).max())
    if not off < TOLERANCE:
        raise SystemExit(f"bench/speed: the swarm built by hand estimates something else, off by {off:g} m")


def _rows(who: str, costs: dict[str, list[float]], absent: dict[str, str], by_hand: bool) -> list[Row]:
    rows = []
    for transport in floors.TRANSPORTS:
        name = f"tick of {who}: GA-RKF / {transport}, nobody computes"
        if transport in absent:
            rows.append(missing(name, absent[transport]))
        else:
            rows.append(compared(name, costs["GA-RKF"], costs[transport]))
    rows.append(compared(f"tick of {who}: RKF recorded / unrecorded", costs["RKF"], costs["unrecorded"]))
    if not by_hand:
        return [*rows, missing(f"tick of {who}: RKF / {_PEER_BY_HAND}", _GROUP)]
    return [
        *rows,
        compared(f"tick of {who}: RKF / {_PEER_BY_HAND}", costs["RKF"], costs["by hand"]),
        compared(f"start of {who}: RKF / {_PEER_BY_HAND}", costs["start"], costs["start by hand"]),
        compared(f"memory of an agent of {who}: RKF / {_PEER_BY_HAND}", costs["memory"], costs["memory by hand"], "MB"),
    ]
