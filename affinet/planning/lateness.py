"""What makes messages late, by how many ticks at the most, and where the scenario says it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from affinet.planning.link_classes import LinkClass, classes
from affinet.planning.script import Script
from affinet.scenario.sections import Scenario
from agents.swarm import Late
from netem.core.links import Links
from netem.faults.conditions import Conditions
from netem.faults.fault import Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.impairments import delay
from world.formation.nominal import Formation

_UNBOUNDED = ("normal", "exponential", "pareto")


class Lateness(NamedTuple):
    """All that makes messages late, and by how many ticks at the most together; those of the run where there is no bound."""

    causes: tuple[Late, ...]
    ticks: int


def of(given: Scenario, formation: Formation, links: Links, script: Script) -> Lateness:
    """How late messages of a scenario may be heard.

    Parameters
    ----------
    given, formation, links
        The scenario, who flies, and over which links.
    script
        What its timeline says.

    Raises
    ------
    ScenarioError
        When a profile cannot ever deliver, or selects nothing.
    """
    degraded = [given.network.model_copy(update={"profile": name, "links": []}) for name, _ in script.profiles]
    groups = chain.from_iterable(classes(network, formation, links) for network in (given.network, *degraded))
    air = _distinct(_of_class(one, given) for one in groups if one.comms)
    under_way = max((cause.ticks for cause in air), default=0.0)
    delayed = _delayed(script, links, given)
    held = _held(script, links, given, under_way + delayed.ticks)
    scripted = tuple(cause for cause in (delayed, held) if cause.ticks)
    # In real time agents wake apart: of what is said late in a tick some hear in the next, or the one after.
    apart = 2.0 if given.time.mode == "real" else 0.0
    ticks = under_way + delayed.ticks + held.ticks + apart
    return Lateness((*air, *scripted), int(min(ticks, given.time.ticks)))


def _distinct(causes: Iterable[Late]) -> tuple[Late, ...]:
    """Those that make anything late, and of several at one place the worst."""
    worst: dict[str, Late] = {}
    for cause in causes:
        if cause.ticks and cause.ticks > worst.get(cause.where, cause._replace(ticks=0.0)).ticks:
            worst[cause.where] = cause
    return tuple(worst.values())


def _of_class(one: LinkClass, given: Scenario) -> Late:
    dt, where = given.time.dt, []
    if least := int(given.time.exchange == "next-tick"):
        where.append("time.exchange")
    if one.delay_ticks:
        where.append("network.delay_ticks")
    waits = {
        "delay": _longest(one),
        "loss": sum(float(part.extra_delay[part.loss < 1.0].max(initial=0.0)) for part, _ in one.chains),
        "rate": _queued(one),
    }
    stale = any(corruption.kind == "stale" for corruption in one.profile.corrupt or [])
    parts = [*(name for name, seconds in waits.items() if seconds), *(["corrupt"] if stale else [])]
    if parts:
        where.append(f"profile {one.name!r} ({', '.join(parts)})")
    return Late(" and ".join(where), max(_ticks(sum(waits.values()) + one.delay_ticks * dt, dt), least) + stale)


def _queued(one: LinkClass) -> float:
    """The longest that a message waits in its queue, in seconds; where rates change, for as long as they may be 0."""
    limit = one.profile.rate
    if limit is None:
        return 0.0
    return np.inf if limit.rate is None else 8.0 * limit.queue / limit.rate


def _longest(one: LinkClass) -> float:
    """The longest delay that its profile draws, in seconds."""
    model = one.profile.delay
    if model is None:
        return 0.0
    if model.model in _UNBOUNDED and (model.model == "exponential" or model.jitter):
        return np.inf if model.mean or model.jitter else 0.0
    return max((model.mean or 0.0) + (model.jitter or 0.0), *one.measured, 0.0)


def _delayed(script: Script, links: Links, given: Scenario) -> Late:
    """Delays that hold at once on a link add up; those that wait for a condition may begin at any time."""
    delays = [fault for fault in script.faults if fault.verb is Verb.DELAY]
    waiting = Timeline(links, [_at_any_time(fault, given) for fault in delays if fault.trigger is not None])
    placed = Timeline(links, [fault for fault in delays if fault.trigger is None])
    seconds = sum(
        max(segment.delay_s.max(initial=0.0) for _, _, segment in _segments(some, given)) for some in (waiting, placed)
    )
    return Late("timeline: delay", _ticks(float(seconds), given.time.dt))


def _held(script: Script, links: Links, given: Scenario, under_way: float) -> Late:
    """How long a link may hold a message, which may come from one hold into the next while it is `under_way`, in ticks."""
    holding = [fault for fault in script.faults if fault.under_way is UnderWay.HOLD]
    waiting = sum(_lasts(fault, given) for fault in holding if fault.trigger is not None)
    timeline = Timeline(links, [fault for fault in holding if fault.trigger is None])
    longest, held, free = (np.zeros(len(links)) for _ in range(3))
    for start, end, segment in _segments(timeline, given):
        free = np.where(segment.holds, 0.0, free + (end - start))
        held = np.where(segment.holds, held + (end - start), np.where(free > under_way, 0.0, held))
        longest = np.maximum(longest, held)
    verbs = " and ".join(sorted({str(fault.verb) for fault in holding}))
    return Late(f"timeline: {verbs}, messages held", waiting + float(longest.max(initial=0.0)))


def _segments(timeline: Timeline, given: Scenario) -> Iterator[tuple[int, int, Conditions]]:
    """From which tick to which other the same conditions hold."""
    ends = {end for fault in timeline.faults for end in (fault.start, fault.end) if end is not None}
    bounds = sorted({0, given.time.ticks, *(end for end in ends if end < given.time.ticks)})
    return ((start, end, timeline.at(start)) for start, end in pairwise(bounds))


def _at_any_time(fault: Fault, given: Scenario) -> Fault:
    return replace(fault, trigger=None, start=0, end=given.time.ticks)


def _lasts(fault: Fault, given: Scenario) -> float:
    return float((given.time.ticks if fault.end is None else fault.end) - fault.start)


def _ticks(seconds: float, dt: float) -> float:
    return float(delay.ticks(np.array(seconds), dt)) if np.isfinite(seconds) else seconds
