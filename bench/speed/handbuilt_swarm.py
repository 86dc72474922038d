"""A swarm over ZeroMQ with filterpy in every agent, flown: its tick, its start, and its memory."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil
from speed.launched import Cost
from speed.problem import numbers
from speed.started import all_of

from affinet.planning.plan import Plan
from affinet.runtimes.private import socket_folder
from analysis.models.arrays import Array


class Swarmed(NamedTuple):
    """What it cost, and its estimates, shape (T, L, D)."""

    cost: Cost
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
            processes = {role: psutil.Process(process.pid) for role, process in started.items()}
            before = _processor_s(processes.values())
            for role in (*(role for role in started if role != "world"), "world"):
                started[role].tell("go")
            start = time.perf_counter() - launched
            tick = float(started["world"].said())
            busy = (_processor_s(processes.values()) - before) / swarm.ticks
            memory = max(one.memory_full_info().pss for role, one in processes.items() if role != "world") / 2**20
        with np.load(Path(folder) / "arrays.npz") as arrays:
            return Swarmed(Cost(tick, busy, start, memory), arrays["estimate"])


def _processor_s(processes: Iterable[psutil.Process]) -> float:
    return float(sum(sum(process.cpu_times()[:2]) for process in processes))
