"""Many runs: affinet in process against filterpy, batched NumPy and a compiled loop, on one core.

All compute the same estimates, which is looked at before anything is timed. affinet alone also decides a verdict on every
message of three channels, carries what is said, and checks what estimator and law return.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from speed import monte_carlo_peers as peers
from speed.problem import Counted, Generated, Swarm, numbers, planned
from speed.rows import Row, compared

from affinet.planning.plan import Plan
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.side_by_side import side_by_side
from analysis.models.arrays import Array

TOLERANCE = 1e-7  # m: what rounding leaves between filters that update by other, equal formulas
SIDE_BY_SIDE = 200
_TICKS = 128  # two blocks of draws that affinet makes ahead
_CHECKED_RUNS = 2
_AS_MANY = 3  # rounds for each that is asked for: they are short
_ALONE, _MANY = "affinet, 1 run", f"affinet, {SIDE_BY_SIDE} runs"
_OBJECTS, _NUMPY, _NUMPY_MANY = "filterpy, an object an edge", "NumPy, 1 run", f"NumPy, {SIDE_BY_SIDE} runs"
_COMPILED = f"compiled loop, {SIDE_BY_SIDE} runs"
_PAIRS = (
    (_ALONE, _OBJECTS),
    (_ALONE, _NUMPY),
    (_MANY, _OBJECTS),
    (_MANY, _NUMPY_MANY),
    (_MANY, _COMPILED),
)


class _Flight(NamedTuple):
    """A way to fly, with how many runs and ticks."""

    fly: Callable[[], object]
    steps: int


def affinet(plan: Plan, seeds: range) -> Array:
    """Estimates (T, R, L, D) of runs flown by affinet."""
    together = plan if seeds == range(plan.scenario.seed, plan.scenario.seed + 1) else side_by_side(plan, [*seeds])
    present = together.world.links.present
    kept = [instant.acted.action.estimate.relative[present] for instant in InProcessSwarm(together).ticks()]
    return np.stack(kept).reshape(len(kept), len(seeds), -1, 2)


def differences(plan: Plan) -> Mapping[str, float]:
    """How far the estimates of each peer are from affinet's at the most, in metres, given the same draws."""
    swarm, seeds = numbers(plan), range(plan.scenario.seed, plan.scenario.seed + _CHECKED_RUNS)
    ours = affinet(plan, seeds)
    theirs = {
        "batched NumPy": peers.batched_numpy(swarm, Counted(seeds)),
        "compiled loop": peers.compiled(swarm, np.array(seeds, dtype=np.uint64)),
        "filterpy": np.concatenate([peers.filterpy_objects(swarm, Counted([seed])) for seed in seeds], axis=1),
        "affinet alone": np.concatenate(
            [affinet(planned("corridor", swarm.ticks, f"seed={seed}"), range(seed, seed + 1)) for seed in seeds], axis=1
        ),
    }
    return {name: float(np.abs(estimates - ours).max()) for name, estimates in theirs.items()}


def measure(rounds: int, share: float) -> list[Row]:
    """Costs of a run-step, in seconds of one core.

    Raises
    ------
    SystemExit
        When a peer computes something else.
    """
    ticks = max(2, round(_TICKS * share))
    plan = planned("corridor", ticks, "record.enabled=false")
    apart = {name: off for name, off in differences(plan).items() if not off < TOLERANCE}
    if apart:
        raise SystemExit(f"bench/speed: peers do not compute what affinet does, off by so many metres: {apart}")
    flights = _flights(plan, numbers(plan))
    costs: dict[str, list[float]] = {name: [] for name in flights}
    for _ in range(_AS_MANY * rounds):
        for name, flight in flights.items():
            began = time.process_time()
            flight.fly()
            costs[name].append((time.process_time() - began) / flight.steps)
    return [compared(f"run-step: {ours} / {theirs}", costs[ours], costs[theirs]) for ours, theirs in _PAIRS]


def _flights(plan: Plan, swarm: Swarm) -> dict[str, _Flight]:
    seeds = range(1, SIDE_BY_SIDE + 1)
    words = np.array(seeds, dtype=np.uint64)
    alone, many = swarm.ticks, swarm.ticks * SIDE_BY_SIDE
    return {
        _ALONE: _Flight(lambda: affinet(plan, range(1, 2)), alone),
        _MANY: _Flight(lambda: affinet(plan, seeds), many),
        _OBJECTS: _Flight(lambda: peers.filterpy_objects(swarm, Generated(1)), alone),
        _NUMPY: _Flight(lambda: peers.batched_numpy(swarm, Generated(1)), alone),
        _NUMPY_MANY: _Flight(lambda: peers.batched_numpy(swarm, Generated(SIDE_BY_SIDE)), many),
        _COMPILED: _Flight(lambda: peers.compiled(swarm, words), many),
    }
