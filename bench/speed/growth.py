"""How a tick of RKF grows with the number of agents and of neighbours: exponents, in process and over processes.

Agents at rest in a ring, with neighbours on both sides: nobody steers, so that no stress has to be found for any size.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
from speed.launched import fly
from speed.measured import exponent, over_rounds
from speed.problem import PATIENCE_S
from speed.rows import Row, seconds

from affinet.planning import making
from affinet.planning.plan import Plan
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.scenario import loading

_SMALL, _LARGE = (5, 10, 20, 40), (80, 160, 320, 640)
_SMALL_REACHES, _LARGE_REACHES = (1, 2, 4, 8), (4, 8, 16, 32)
_OVER_PROCESSES, _REACHES_OVER_PROCESSES, _IN_HOSTS, _PER_HOST = (5, 10, 20), (1, 2, 4), (10, 20, 40), 5
_USUAL_REACH, _FEW, _SOME, _MANY = 2, 10, 20, 160
_TICKS, _TICKS_OVER_PROCESSES = 128, 120


def ring(agents: int, reach: int, ticks: int, per_process: int = 1) -> Plan:
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
        f"per_process = {per_process}",
        "[network]\navailability = 0.7",
    ]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "ring.toml"
        file.write_text("\n".join(written) + "\n")
        return making.make(loading.load(str(file)))


def measure(rounds: int, share: float) -> Iterator[Row]:
    """Exponents of the tick."""
    ticks, over_processes = (max(5, round(many * share)) for many in (_TICKS, _TICKS_OVER_PROCESSES))
    _in_process(ring(_SMALL[0], _USUAL_REACH, ticks))  # loads what is compiled
    for sizes in (_SMALL, _LARGE):
        plans = [ring(agents, _USUAL_REACH, ticks) for agents in sizes]
        yield _row(f"tick in process, {_agents(sizes)}", sizes, plans, _in_process, rounds)
    for agents, reaches in ((_SOME, _SMALL_REACHES), (_MANY, _LARGE_REACHES)):
        plans = [ring(agents, reach, ticks) for reach in reaches]
        yield _row(f"tick in process, {_neighbours(reaches, agents)}", reaches, plans, _in_process, rounds)
    plans = [ring(agents, _USUAL_REACH, over_processes) for agents in _OVER_PROCESSES]
    yield _row(f"tick over processes, {_agents(_OVER_PROCESSES)}", _OVER_PROCESSES, plans, _flown, rounds)
    plans = [ring(_FEW, reach, over_processes) for reach in _REACHES_OVER_PROCESSES]
    what = f"tick over processes, {_neighbours(_REACHES_OVER_PROCESSES, _FEW)}"
    yield _row(what, _REACHES_OVER_PROCESSES, plans, _flown, rounds)
    plans = [ring(agents, _USUAL_REACH, over_processes, _PER_HOST) for agents in _IN_HOSTS]
    what = f"tick over processes of {_PER_HOST} agents each, {_agents(_IN_HOSTS)}"
    yield _row(what, _IN_HOSTS, plans, _flown, rounds)


def _agents(sizes: Sequence[int]) -> str:
    return f"{sizes[0]} to {sizes[-1]} agents of {2 * _USUAL_REACH} neighbours"


def _neighbours(reaches: Sequence[int], agents: int) -> str:
    return f"{2 * reaches[0]} to {2 * reaches[-1]} neighbours of {agents} agents"


def _flown(plan: Plan) -> float:
    return fly(plan).tick_s


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
