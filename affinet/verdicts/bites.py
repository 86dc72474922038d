"""What each fault of a run took hold of: a fault that touched nothing has proved nothing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from affinet.verdicts import vacuous
from analysis.models.arrays import Integers, Mask
from netem.faults import lie
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.relay import Relay
from netem.medium.verdict import VERDICT_OF, Verdict, VerdictCodes
from world.books.history import Arrays


@dataclass(frozen=True)
class Bite:
    """What a fault took hold of.

    Parameters
    ----------
    fault
        As it was placed in the run.
    at
        When it began, in seconds; None if what it waited for never came.
    touched, what
        How many, of what: messages, measurements, or ticks of agents.
    why
        Why it touched nothing, if it did not.
    """

    fault: Fault
    at: float | None
    touched: int
    what: str
    why: str | None

    def __str__(self) -> str:
        when = "never" if self.at is None else f"{self.at:g} s"
        return (
            f"{when}: {self.fault.describe()} touched {self.touched} {self.what}{f': {self.why}' if self.why else ''}"
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {
            "fault": self.fault.describe(),
            "at": self.at,
            "touched": self.touched,
            "what": self.what,
            "why": self.why,
        }


def bites(plan: Plan, timeline: Timeline, arrays: Arrays) -> list[Bite]:
    """What every fault took hold of in the ticks flown.

    Parameters
    ----------
    plan
        What was flown.
    timeline
        Its faults, where they came to lie.
    arrays
        What happened.
    """
    flown = _Rejudged(plan, timeline, arrays)
    found = []
    for number, fault in enumerate(timeline.faults):
        touched, what = _touched(flown, number)
        why = None if touched else vacuous.why(plan, timeline, arrays, number)
        found.append(Bite(fault, _at(fault, plan.world.dt), touched, what, why))
    return found


@dataclass(frozen=True)
class _Rejudged:
    plan: Plan
    timeline: Timeline
    arrays: Arrays

    @cached_property
    def arrivals(self) -> Integers:
        """When every message offered arrives, -1 where it is dropped at once, shape (T, C, L)."""
        return self._judged_again(self.timeline, len(self.arrays["verdicts"]))

    def arrivals_without(self, number: int) -> Integers:
        """The same had one fault not been, up to its end."""
        links, faults = self.timeline.links, self.timeline.faults
        others = [other for place, other in enumerate(faults) if place != number]
        ticks = len(self.arrays["verdicts"][: faults[number].end])
        return self._judged_again(Timeline(links, others, self.timeline.triggers), ticks)

    def _judged_again(self, timeline: Timeline, ticks: int) -> Integers:
        verdicts, position = self.arrays["verdicts"], self.arrays["position"]
        relay = Relay[None](Medium(self.plan.scenario.seed, self.plan.channels, self.plan.profiles, timeline))
        arrivals = np.empty((ticks, *verdicts.shape[1:]), dtype=np.int64)
        for tick in range(ticks):
            decided = relay.decide_on(tick, verdicts[tick] != Verdict.SILENT, position[tick]).verdicts
            relay.finish(tick)
            arrivals[tick] = np.where(decided.kind <= Verdict.DELAYED, decided.due, -1)
        return arrivals


def _at(fault: Fault, dt: float) -> float | None:
    return None if fault.trigger is not None else fault.start * dt


def _touched(flown: _Rejudged, number: int) -> tuple[int, str]:
    plan, timeline, arrays = flown.plan, flown.timeline, flown.arrays
    fault = timeline.faults[number]
    if fault.trigger is not None:
        return 0, "messages"
    ticks = len(arrays["error"])
    span = range(fault.start, ticks if fault.end is None else min(ticks, fault.end))
    verdicts = arrays["verdicts"][fault.start : fault.end]
    held = timeline.held(number)
    match fault.verb:
        case Verb.CLOCK if plan.pace is not None:
            return _agent_ticks(
                span, fault, lambda tick: ~timeline.at(tick).idle
            ), "ticks of agents that wake by the clock"
        case Verb.CLOCK:
            wrong = lambda tick: plan.told_mission & ~timeline.at(tick).idle & (timeline.clock(tick) != tick)  # noqa: E731
            return _agent_ticks(span, fault, wrong), "ticks of agents that fly by the clock"
        case Verb.BIAS:
            return int((_working(timeline, span, verdicts) & held).sum()), "measurements"
        case Verb.OUTLIER:
            hits = np.reshape(
                [plan.world.outliers(tick, timeline.at(tick)) & held for tick in span], (len(span), len(held))
            )
            return int((_working(timeline, span, verdicts) & hits.astype(bool)).sum()), "measurements"
        case Verb.LIE:
            return _told(plan, fault, verdicts), "messages"
        case Verb.LOSE | Verb.DROPOUT | Verb.DELAY | Verb.DEGRADE if plan.journal is None:
            return _otherwise(flown, number), "messages"
        case Verb.DEGRADE:
            return int((verdicts[:, :, held] > Verdict.DELIVERED).sum()), "messages"
    if fault.verb in VERDICT_OF:
        return int((verdicts[:, :, held] == VERDICT_OF[fault.verb]).sum()), "messages"
    if fault.agents:
        return _agent_ticks(span, fault, lambda tick: ~timeline.at(tick).still), "ticks of agents"
    return int((verdicts[:, 0, held] == Verdict.DELIVERED).sum()), "measurements"


def _agent_ticks(span: range, fault: Fault, which: Any) -> int:
    agents = np.array(fault.agents) - 1
    return sum(int(which(tick)[agents].sum()) for tick in span)


def _working(timeline: Timeline, span: range, verdicts: VerdictCodes) -> Mask:
    """Measurements that arrived, and are not those of a sensor that repeats itself, shape (T, L)."""
    frozen = [timeline.at(tick).frozen for tick in span]
    working: Mask = (verdicts[:, 0] == Verdict.DELIVERED) & ~np.reshape(frozen, verdicts[:, 0].shape).astype(bool)
    return working


def _otherwise(flown: _Rejudged, number: int) -> int:
    """How many messages fared otherwise than they would have without a fault."""
    without = flown.arrivals_without(number)
    changed = flown.arrivals[: len(without)] != without
    return int(changed[flown.timeline.faults[number].start :].sum())


def _told(plan: Plan, fault: Fault, verdicts: Any) -> int:
    if lie.CHANNEL not in plan.channels:
        return 0
    said: Mask = np.isin(plan.world.links.src, fault.agents)
    told = verdicts[:, plan.channels.index(lie.CHANNEL), said]
    return int(((told == Verdict.DELIVERED) | (told == Verdict.DELAYED)).sum())
