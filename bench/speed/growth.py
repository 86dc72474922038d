"""How a tick of RKF grows with the number of agents and of neighbours: exponents, in process and over processes.

Agents at rest in a ring, with neighbours on both sides: nobody steers, so that no stress has to be found for any size.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from speed.lockstep import fly
from speed.measured import exponent, over_rounds
from speed.problem import PATIENCE_S
from speed.rows import Row, seconds

from affinet.planning import making
from affinet.planning.plan import Plan
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.scenario import loading

_AGENTS, _AGENTS_OVER_PROCESSES, _REACHES = (5, 10, 20, 40), (5, 10, 20), (1, 2, 4, 8)
_USUAL_REACH, _USUAL_AGENTS = 2, 20
_TICKS, _TICKS_OVER_PROCESSES = 128, 150


def ring(agents: int, reach: int, ticks: int) -> Plan:
    """A plan of so many agents, linked to so many neighbours on each side."""
    places = [(math.cos(angle), math.sin(angle)) for angle in np.linspace(0.0, 2.0 * math.pi, agents, endpoint=False)]
    edges = {tuple(sorted((i, (i + far) % agents))) for i in range(agents) for far in range(1, reach + 1)}
    written = [
        "[formation]",
        f"nodes = {[[5.0 * x, 5.0 * y] for x, y in places]}",
        f"edges = {[f'{i + 1}-{j + 1}' for i, j in sorted(edges)]}",
        "leaders = [1, 2, 3]",
        '[manoeuvre]\npreset = "hover"',
        f"[time]\ndt = 0.01\nduration = {ticks / 100:g}\npatience = {PATIENCE_S:g}",
        "[sensing]\nsigma = 0.1",
        '[agents]\nestimator = "rkf"\nlaw = "rest"',
        "[network]\navailability = 0.7",
    ]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ring.toml"
        file.write_text("\n".join(written) + "\n")
        return making.make(loading.load(str(file)))


def measure(rounds: int, share: float) -> list[Row]:
    """Exponents of the tick."""
    ticks, over_processes = (max(5, round(many * share)) for many in (_TICKS, _TICKS_OVER_PROCESSES))
    return [
        _row(
            f"tick in process, {_AGENTS[0]} to {_AGENTS[-1]} agents of {2 * _USUAL_REACH} neighbours",
            _AGENTS,
            [ring(agents, _USUAL_REACH, ticks) for agents in _AGENTS],
            _in_process,
            rounds,
        ),
        _row(
            f"tick in process, {2 * _REACHES[0]} to {2 * _REACHES[-1]} neighbours of {_USUAL_AGENTS} agents",
            _REACHES,
            [ring(_USUAL_AGENTS, reach, ticks) for reach in _REACHES],
            _in_process,
            rounds,
        ),
        _row(
            f"tick over processes, {_AGENTS[0]} to {_AGENTS_OVER_PROCESSES[-1]} agents of {2 * _USUAL_REACH} neighbours",
            _AGENTS_OVER_PROCESSES,
            [ring(agents, _USUAL_REACH, over_processes) for agents in _AGENTS_OVER_PROCESSES],
            lambda plan: fly(plan).tick_s,
            rounds,
        ),
    ]


def _in_process(plan: Plan) -> float:
    """Seconds of a tick, of one core."""
    began = time.process_time()
    for _ in InProcessSwarm(plan).ticks():
        pass
    return (time.process_time() - began) / plan.world.ticks


def _row(name: str, sizes: Sequence[int], plans: Sequence[Plan], cost: Callable[[Plan], float], rounds: int) -> Row:
    costs = np.array([[cost(plan) for plan in plans] for _ in range(rounds)])
    least, most = (seconds(over_rounds(costs[:, size].tolist()).median) for size in (0, -1))
    return Row(name, f"{least} to {most}", "", "exponent", exponent(sizes, costs))
