"""What each fault of a run took hold of: a fault that touched nothing has proved nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from affinet.verdicts import vacuous
from analysis.models.arrays import Array, Integers, Mask
from netem.faults import lie
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.relay import Relay
from netem.medium.verdict import VERDICT_OF, Verdict, VerdictCodes
from world.books import growing
from world.books.history import Arrays, by_span

_WITH_OTHERS = (Verb.LOSE, Verb.DROPOUT, Verb.DELAY, Verb.DEGRADE)


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


def bites(plan: Plan, timeline: Timeline, arrays: Arrays, changed: Mapping[int, int] | None = None) -> list[Bite]:
    """What every fault took hold of in the ticks flown.

    Parameters
    ----------
    plan
        What was flown.
    timeline
        Its faults, where they came to lie.
    arrays
        What happened.
    changed
        How many messages fared otherwise because of each fault that is judged again; None where that is to be found out.
    """
    judged_again = [number for number, fault in enumerate(timeline.faults) if by_the_models(plan, fault)]
    if changed is None:
        changed = _otherwise(plan, timeline, arrays, judged_again) if judged_again else {}
    found = []
    for number, fault in enumerate(timeline.faults):
        touched, what = _touched(plan, timeline, arrays, number, changed)
        why = None if touched else vacuous.why(plan, timeline, arrays, number)
        found.append(Bite(fault, _at(fault, plan.world.dt), touched, what, why))
        growing.let_go(arrays)
    return found


def by_the_models(plan: Plan, fault: Fault) -> bool:
    """Whether what became of a message does not say that this fault was why: it has to be judged without it, to compare."""
    return plan.journal is None and fault.trigger is None and fault.verb in _WITH_OTHERS


def _otherwise(plan: Plan, timeline: Timeline, arrays: Arrays, numbers: Sequence[int]) -> dict[int, int]:
    """How many messages fared otherwise, up to its end, than they would have without each of these faults.

    Where a fault begins, a relay parts that goes on without it, beside the one that has all: all are gone through once.
    """
    faults, changed = timeline.faults, dict.fromkeys(numbers, 0)
    relay = Relay[None](Medium(plan.scenario.seed, plan.channels, plan.profiles, timeline))
    without: dict[int, Relay[None]] = {}
    last = max(faults[number].end or len(arrays["error"]) for number in numbers)
    tick = 0
    for span in by_span(arrays):
        for verdicts, position in zip(span["verdicts"], span["position"], strict=False):
            if tick == last:
                return changed
            without = {number: other for number, other in without.items() if faults[number].end != tick}
            starting = changed.keys() & timeline.starting_numbers(tick)
            without |= {number: relay.under(timeline.without(number)) for number in starting}
            usual = arriving(relay, tick, verdicts, position)
            for number, other in without.items():
                changed[number] += int((arriving(other, tick, verdicts, position) != usual).sum())
            tick += 1
    return changed


def arriving(relay: Relay[None], tick: int, verdicts: VerdictCodes, position: Array) -> Integers:
    """When every message offered in a tick arrives, -1 where it is dropped at once, shape (C, L)."""
    decided = relay.decide_on(tick, verdicts != Verdict.SILENT, position).verdicts
    relay.finish(tick)
    return np.where(decided.kind <= Verdict.DELAYED, decided.due, -1)


def _at(fault: Fault, dt: float) -> float | None:
    return None if fault.trigger is not None else fault.start * dt


def _touched(
    plan: Plan, timeline: Timeline, arrays: Arrays, number: int, otherwise: Mapping[int, int]
) -> tuple[int, str]:
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
        case _ if number in otherwise:
            return otherwise[number], "messages"
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


def _told(plan: Plan, fault: Fault, verdicts: Any) -> int:
    if lie.CHANNEL not in plan.channels:
        return 0
    said: Mask = np.isin(plan.world.links.src, fault.agents)
    told = verdicts[:, plan.channels.index(lie.CHANNEL), said]
    return int(((told == Verdict.DELIVERED) | (told == Verdict.DELAYED)).sum())
