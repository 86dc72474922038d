"""A swarm over ZeroMQ with filterpy in every agent, flown: the seconds of its tick, its start, and its memory."""

from __future__ import annotations

import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
from speed.problem import numbers
from speed.started import all_of

from affinet.planning.plan import Plan
from analysis.models.arrays import Array
from netem.wire.session import socket_folder


class Swarmed(NamedTuple):
    """Seconds of a tick, seconds to the first tick, the largest agent's memory in MB, and the estimates, (T, L, D)."""

    tick_s: float
    start_s: float
    memory_mb: float
    estimate: Array


def fly(plan: Plan, *, as_affinet: bool = False) -> Swarmed:
    """The swarm of a plan.

    Parameters
    ----------
    plan
        Of RKF, and of the varying-velocity law.
    as_affinet
        Whether it draws what affinet draws.
    """
    swarm = numbers(plan)
    fields = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in asdict(swarm).items()}
    with tempfile.TemporaryDirectory(prefix="affinet-", dir=socket_folder()) as folder:
        common = {"folder": folder, "seed": plan.scenario.seed, "as_affinet": as_affinet}
        told: dict[str, dict[str, Any]] = {"world": {"role": "world", **common, **fields}}
        shared = {name: fields[name] for name in ("dt", "alpha", "leader_gain", "sigma", "F", "Q", "prior")}
        for agent in range(len(swarm.degree)):
            told[str(agent)] = {
                "role": "agent", "agent": agent, "folder": folder, **shared,
                "stress": swarm.stress[swarm.dst == agent].tolist(),
                "degree": float(swarm.degree[agent]),
                "leads": bool(swarm.leader[agent]),
                "target": swarm.target[:, agent].tolist(),
            }  # fmt: skip
        launched = time.perf_counter()
        with all_of("handbuilt", told) as started:
            for role in (*(role for role in started if role != "world"), "world"):
                started[role].tell("go")
            start = time.perf_counter() - launched
            tick = float(started["world"].said())
            pids = [process.pid for role, process in started.items() if role != "world"]
            memory = max(psutil.Process(pid).memory_full_info().pss for pid in pids) / 1e6
        with np.load(Path(folder) / "arrays.npz") as arrays:
            return Swarmed(tick, start, memory, arrays["estimate"])
