"""What makes messages late, by how many ticks at the most, and where the scenario says it."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from typing import NamedTuple

import numpy as np

from affinet.planning.link_classes import LinkClass, classes
from affinet.planning.script import Script
from affinet.scenario.sections import Scenario
from agents.swarm import Late
from netem.core.links import Links
from netem.faults.fault import Fault, UnderWay, Verb
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
    scripted = _distinct(_of_fault(fault, given) for fault in script.faults)
    ticks = sum(max((cause.ticks for cause in some), default=0.0) for some in (air, scripted))
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
        "rate": 8.0 * one.profile.rate.queue / one.profile.rate.rate if one.profile.rate else 0.0,
    }
    stale = any(corruption.kind == "stale" for corruption in one.profile.corrupt or [])
    parts = [*(name for name, seconds in waits.items() if seconds), *(["corrupt"] if stale else [])]
    if parts:
        where.append(f"profile {one.name!r} ({', '.join(parts)})")
    return Late(" and ".join(where), max(_ticks(sum(waits.values()) + one.delay_ticks * dt, dt), least) + stale)


def _longest(one: LinkClass) -> float:
    """The longest delay that its profile draws, in seconds."""
    model = one.profile.delay
    if model is None:
        return 0.0
    if model.model in _UNBOUNDED and (model.model == "exponential" or model.jitter):
        return np.inf if model.mean or model.jitter else 0.0
    return max((model.mean or 0.0) + (model.jitter or 0.0), *one.measured, 0.0)


def _of_fault(fault: Fault, given: Scenario) -> Late:
    lasts = np.inf if fault.end is None else float(fault.end - fault.start)
    match fault.verb, fault.under_way:
        case Verb.DELAY, _:
            return Late("timeline: delay", _ticks(fault.seconds, given.time.dt))
        case ((Verb.CUT | Verb.PARTITION | Verb.PAUSE), UnderWay.HOLD):
            return Late(f"timeline: {fault.verb}, messages held", lasts)
    return Late("", 0.0)


def _ticks(seconds: float, dt: float) -> float:
    return float(delay.ticks(np.array(seconds), dt)) if np.isfinite(seconds) else seconds
