"""Runs in this process that leave nothing behind: one, or many side by side, each of them bit for bit the run alone."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import psutil

from affinet.planning import limits
from affinet.planning.plan import Plan, PlanError
from affinet.runtimes import judged_again
from affinet.runtimes.alike import alike
from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.side_by_side import Flight, NotABatch, side_by_side, together
from affinet.verdicts import outcome
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.outcome import Outcome
from analysis.metrics.errors import tracking_error
from analysis.models.arrays import Integers
from netem.faults.timeline import Timeline
from netem.medium.entry import Entry, by_part
from netem.processes.user_code import UserCodeError
from world.books.described import AGENT, BY_TICK, LINK
from world.books.history import Arrays, History

_MOST = 100  # runs at once: what a tick costs however many fly is then no more than half of it
_BYTES = 2**29  # of all arrays of those that fly at once


def rehearse(plan: Plan) -> Evidence:
    """Run a plan in this process, and leave nothing behind.

    Raises
    ------
    UserCodeError
        When estimator or law do something wrong.
    PlanError
        When it is too long for the memory.
    """
    channels = len(plan.channels)
    fits = limits.rehearsal(plan.world, channels, plan.reports, psutil.virtual_memory().total)
    if fits.fatal:
        raise PlanError([fits])
    swarm, flown = InProcessSwarm(plan), History(plan.world, channels, plan.reports)
    started = time.perf_counter()
    swarm.fly(flown.extend, plan.batch)
    wall_s, arrays = time.perf_counter() - started, flown.arrays()
    return Evidence(plan, arrays, _judged(plan, swarm.timeline, arrays, swarm.in_flight, wall_s))


def rehearse_all(plans: Sequence[Plan]) -> list[Evidence]:
    """Run plans in this process, side by side where they can be.

    Raises
    ------
    UserCodeError
        When estimator or law do something wrong in one of them.
    PlanError
        When one is too long for the memory.
    """
    found: dict[int, Evidence] = {}
    for numbers in _groups(plans):
        some = [plans[number] for number in numbers]
        flown = [rehearse(some[0])] if len(some) == 1 else _side_by_side(some)
        found.update(zip(numbers, flown, strict=True))
    return [found[number] for number in range(len(plans))]


def why_alone(plan: Plan) -> str | None:
    """Why runs of a plan do not fly side by side; None if they do."""
    try:
        side_by_side(plan, [0])
    except NotABatch as error:
        return str(error).partition(";")[0]
    return None


def _groups(plans: Sequence[Plan]) -> Iterator[list[int]]:
    """Numbers of the plans that fly at once."""
    groups: list[list[int]] = []
    for number, plan in enumerate(plans):
        if why_alone(plan):
            yield [number]
            continue
        for group in groups:
            if alike(plans[group[0]], plan):
                group.append(number)
                break
        else:
            groups.append([number])
    for group in groups:
        plan = plans[group[0]]
        each = limits.of_a_tick(plan.world, len(plan.channels), plan.reports) * plan.world.ticks
        most = max(1, min(_MOST, int(_BYTES / each)))
        yield from (group[first : first + most] for first in range(0, len(group), most))


def _side_by_side(plans: Sequence[Plan]) -> list[Evidence]:
    batch, runs = together([Flight(plan, [plan.scenario.seed]) for plan in plans]), len(plans)
    swarm, flown = InProcessSwarm(batch), History(batch.world, len(batch.channels), batch.reports)
    counted = _Counted(runs, len(plans[0].world.links))
    started = time.perf_counter()
    try:
        swarm.fly(flown.extend, batch.batch, counted.take)
    except UserCodeError:  # of which run, and which agent of it, is told by the run alone
        return [rehearse(plan) for plan in plans]
    wall_s, arrays = (time.perf_counter() - started) / runs, flown.arrays()
    changed = judged_again.changed(batch, plans, arrays["verdicts"], arrays["position"])
    waiting = swarm.under_way.reshape(runs, -1).sum(axis=1)
    found = []
    for number, plan in enumerate(plans):
        own = _of_run(plan, number, arrays) | counted.of(number)
        done = _judged(plan, plan.timeline, own, int(waiting[number]), wall_s, changed[number])
        found.append(Evidence(plan, own, done))
    return found


def _of_run(plan: Plan, number: int, arrays: Arrays) -> Arrays:
    """The arrays of a run, among those of all."""
    sizes = {AGENT: plan.world.formation.agents, LINK: len(plan.world.links)}
    own: Arrays = {}
    for name, array in arrays.items():
        axes = BY_TICK[name].axes if name in BY_TICK else ("", AGENT)
        axis = next((place for place, axis in enumerate(axes) if axis in sizes), None)
        if axis is not None:
            size = sizes[axes[axis]]
            rows = [slice(None)] * axis + [slice(number * size, (number + 1) * size)]
            own[name] = np.ascontiguousarray(array[tuple(rows)])
    ticks = len(own["target"])
    present = plan.timeline.present(range(ticks))
    return own | {"error": tracking_error(own["position"][:ticks], own["target"], present)}


class _Counted:
    """What is told of all runs in one figure, counted of each, tick by tick."""

    def __init__(self, runs: int, links: int) -> None:
        self._runs, self._links = runs, links
        self._ticks: list[tuple[Integers, Integers, Integers]] = []

    def take(self, entry: Entry, _: int) -> None:
        """Count a tick."""
        self._ticks.append(by_part(entry, self._runs, self._links))

    def of(self, run: int) -> Arrays:
        """Of one run, by the names of arrays."""
        names = ("copies", "late", "dropped")
        return {name: np.stack([tick[place][run] for tick in self._ticks]) for place, name in enumerate(names)}


def _judged(
    plan: Plan,
    timeline: Timeline,
    arrays: Arrays,
    in_flight: int,
    wall_s: float,
    changed: Mapping[int, int] | None = None,
) -> Outcome:
    return outcome.judge(
        plan,
        timeline,
        arrays,
        accounts=outcome.accounts_of(arrays, in_flight),
        uninstructed=0,
        failure=None,
        user_code=False,
        wall_s=wall_s,
        processes=[],
        out=Path(),
        changed=changed,
    )
