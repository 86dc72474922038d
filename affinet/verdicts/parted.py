"""Where a run that fails parts from one that passes, though their draws differ: in which quantities, and after what.

Draws differ from the first tick on, and so do all bits. So it is asked where a quantity of the agent that goes wrong most
leaves that of the other run for good, and what was lost on the links to that agent before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from affinet.verdicts import measures
from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Array, Mask
from netem.medium.verdict import Verdict
from world.books import realised
from world.physics import sensors

_FOR_GOOD = 0.1  # of the largest excess: below that a quantity has not left
_BEFORE_S = 2.0  # looked at before
_MOST = 3  # links that are named
_NOT_LOST = (Verdict.DELIVERED, Verdict.DELAYED, Verdict.SILENT)


class NotAlike(ValueError):
    """Two runs cannot be held against each other tick by tick."""


@dataclass(frozen=True)
class Left:
    """A quantity of an agent that leaves that of the other run for good.

    Parameters
    ----------
    tick
        The first in which it has.
    quantity, unit
        What it is.
    agent
        Whose, from 1.
    failing, passing
        Its value in both runs when the failing one is farthest off.
    """

    tick: int
    quantity: str
    unit: str
    agent: int
    failing: float
    passing: float


@dataclass(frozen=True)
class LinkBefore:
    """What a link to that agent lost in the seconds before, in both runs, out of so many messages; and why most of it."""

    link: str
    failing: int
    passing: int
    offered: int
    reason: str


@dataclass(frozen=True)
class Parted:
    """Where and after what a failing run parts from a passing one.

    Parameters
    ----------
    dt
        Tick, in seconds.
    left
        The quantities that leave, the first to do so first; the last tick of the run failing that is looked at.
    before
        Links to that agent over which more was lost than in the other run, the worst first.
    begins, ends
        The ticks in which that is counted.
    """

    dt: float
    left: tuple[Left, ...]
    before: tuple[LinkBefore, ...]
    begins: int
    ends: int

    def lines(self) -> list[str]:
        """In words, a line each."""
        said = [
            f"{one.tick * self.dt:g} s (tick {one.tick}): {one.quantity} of agent {one.agent} leaves for good: "
            f"{one.failing:.3g} {one.unit} at the worst, {one.passing:.3g} in the other run".replace("  ", " ")
            for one in self.left
        ]
        span = f"from {self.begins * self.dt:g} to {self.ends * self.dt:g} s"
        said += [
            f"before, {span}: {one.link} lost {one.failing} of {one.offered} messages ({one.reason}), "
            f"{one.passing} in the other run"
            for one in self.before
        ]
        if not self.before:
            said.append(f"before, {span}: no link to it lost more than in the other run")
        return said


def parted(failing: Evidence, passing: Evidence, at: int | None = None) -> Parted | None:
    """Where a failing run parts from a passing one; None where no agent is farther off in it than in the other.

    Parameters
    ----------
    failing, passing
        The runs.
    at
        The tick in which the one fails: of the agent that is farthest off then, and of what comes before. None is when an
        agent is farthest off in all of the run, which may be at its begin, where draws scatter the agents.

    Raises
    ------
    NotAlike
        When they are of different formations, clocks or channels.
    """
    if failing.plan.world.links.index != passing.plan.world.links.index or failing.dt != passing.dt:
        raise NotAlike(
            "the runs are of different formations or clocks: nothing can be held against anything tick by tick"
        )
    if failing.plan.channels != passing.plan.channels:
        raise NotAlike("the runs talk over different channels: their verdicts cannot be held against each other")
    ticks = min(failing.ticks, passing.ticks)
    (matters, one), (_, other) = (_quantities(run, ticks) for run in (failing, passing))
    off = _excess(one[matters][0], other[matters][0])
    if at is not None:
        off = np.where(np.arange(ticks)[:, None] == min(at, ticks - 1), off, 0.0)
    if not (off > 0).any():
        return None
    worst, agent = (int(place) for place in np.unravel_index(int(np.argmax(off)), off.shape))
    left = [
        found
        for name, (values, unit) in one.items()
        if (found := _left(name, unit, values[: worst + 1, agent], other[name][0][: worst + 1, agent], agent + 1))
        is not None
    ]
    left.sort(key=lambda one: one.tick)
    ends = left[0].tick if left else worst
    begins = max(0, ends - round(_BEFORE_S / failing.dt))
    ends = max(ends, begins + 1)
    return Parted(failing.dt, tuple(left), _links(failing, passing, agent, slice(begins, ends)), begins, ends)


def _quantities(run: Evidence, ticks: int) -> tuple[str, Mapping[str, tuple[Array, str]]]:
    """The name of the one that matters, and all of them, of every agent in every tick, shape (T, N)."""
    with np.errstate(over="ignore", invalid="ignore"):  # of one that has diverged
        name, off = measures.by_agent(run.plan, run.timeline, run.arrays)
    error = off[:ticks]
    return name, {
        name: (
            np.where(run.present[:ticks] & np.isfinite(error), error, np.where(run.present[:ticks], np.inf, 0.0)),
            "m",
        ),
        "error of its estimates": (_estimation(run, ticks), "m"),
        "age of its news": (_age(run, ticks), "s"),
    }


def _estimation(run: Evidence, ticks: int) -> Array:
    links = run.plan.world.links
    true = sensors.relative(run.position[:ticks], links)[:, links.slots]
    known = run.arrays["known"][:ticks]
    off = np.where(known[..., None], run.arrays["estimate"][:ticks] - true, 0.0)
    mean = (off * off).sum(axis=(-1, -2)) / np.maximum(known.sum(axis=-1), 1)
    return np.where(np.isfinite(mean), np.sqrt(mean), np.inf)


def _age(run: Evidence, ticks: int) -> Array:
    """How old the oldest news is that each agent has of a neighbour."""
    plan, links = run.plan, run.plan.world.links
    graph = realised.realise(run.arrays["newest"][:ticks], plan.world.formation, run.timeline, run.dt, plan.window)
    none_yet = run.seconds[:ticks, None, None] + run.dt
    oldest = np.where(np.isnan(graph.age_s), none_yet, graph.age_s).max(axis=1)
    return np.stack(
        [oldest[:, links.dst == agent].max(axis=1, initial=0.0) for agent in range(1, links.agents + 1)], axis=1
    )


def _excess(one: Array, other: Array) -> Array:
    with np.errstate(invalid="ignore"):  # of two that are infinite
        return np.nan_to_num(one - other, nan=0.0, posinf=np.finfo(np.float64).max)


def _left(name: str, unit: str, one: Array, other: Array, agent: int) -> Left | None:
    off = _excess(one, other)
    worst = int(np.argmax(off))
    if off[worst] <= 0.0:
        return None
    near: Mask = off[:worst] <= _FOR_GOOD * off[worst]
    tick = int(np.flatnonzero(near)[-1]) + 1 if near.any() else 0
    return Left(tick, name, unit, agent, float(one[worst]), float(other[worst]))


def _links(failing: Evidence, passing: Evidence, agent: int, span: slice) -> tuple[LinkBefore, ...]:
    links, found = failing.plan.world.links, list[LinkBefore]()
    for row in np.flatnonzero(links.dst == agent + 1).tolist():
        one, other = (run.arrays["verdicts"][span, :, row] for run in (failing, passing))
        lost = [int((~np.isin(each, _NOT_LOST)).sum()) for each in (one, other)]
        if lost[0] > lost[1]:
            counts = np.bincount(one.ravel(), minlength=len(Verdict))
            counts[list(_NOT_LOST)] = 0
            offered = int((one != Verdict.SILENT).sum())
            found.append(
                LinkBefore(
                    f"{links.src[row]}->{agent + 1}", lost[0], lost[1], offered, Verdict(int(counts.argmax())).label
                )
            )
    found.sort(key=lambda one: (one.passing - one.failing, one.link))
    return tuple(found[:_MOST])
