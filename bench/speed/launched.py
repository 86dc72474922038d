"""A run of affinet over processes, flown: its tick, its start, and its memory."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import NamedTuple

import psutil

from affinet.planning.plan import Plan
from affinet.runtimes.launcher import Launcher
from affinet.runtimes.machines.seats import hosts_of

_SETTLED, _NEARLY_OVER = 0.2, 0.8  # as shares of a run, between which processors are looked at


class Cost(NamedTuple):
    """What a swarm over processes costs; NaN is what was not measured.

    Parameters
    ----------
    tick_s
        Seconds of a tick.
    processor_s
        Seconds that all processes together keep processors busy for a tick.
    start_s
        Seconds from the first process to the first tick.
    memory_mb
        An agent's, in the largest process, in MB: its own and its share of what is shared (PSS).
    """

    tick_s: float
    processor_s: float = math.nan
    start_s: float = math.nan
    memory_mb: float = math.nan


def fly(plan: Plan) -> Cost:
    """A run over processes.

    Raises
    ------
    SystemExit
        When it fails.
    """
    busy = _Busy(plan.world.ticks)
    with tempfile.TemporaryDirectory() as out:
        flight = Launcher(plan, Path(out), watch=busy.look).fly()
    if flight.failure or flight.uninstructed:
        raise SystemExit(f"the run failed: {flight.failure}, {flight.uninstructed} lost")
    carried = {("host", host): len(agents) for host, agents in hosts_of(plan, ()).items()}
    found = [
        process["pss_mb"] / carried.get((process["role"], process["id"]), 1)
        for process in flight.processes
        if process["role"] in ("agent", "host") and process["pss_mb"]
    ]
    return Cost(flight.wall_s / plan.world.ticks, busy.of_a_tick, flight.start_s, max(found, default=math.nan))


class _Busy:
    """How long processors were busy with all processes of a run, looked at twice while they all are there."""

    def __init__(self, ticks: int) -> None:
        self._ticks, self._looks = ticks, list[tuple[int, float]]()

    def look(self, tick: int, error: float) -> None:  # noqa: ARG002
        begun, over = _SETTLED * self._ticks <= tick, tick >= self._ticks
        if begun and not over and (not self._looks or tick >= _NEARLY_OVER * self._ticks > self._looks[-1][0]):
            processes = psutil.Process().children(recursive=True)
            self._looks.append((tick, sum(sum(process.cpu_times()[:2]) for process in processes)))

    @property
    def of_a_tick(self) -> float:
        if len(self._looks) < 2:
            return math.nan
        (first, before), (last, after) = self._looks
        return (after - before) / (last - first)
