"""What each jammed zone of a run took hold of: a zone that nobody entered has proved nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from affinet.planning.plan import Plan
from analysis.models.arrays import Array
from netem.core import channels as channel_names
from netem.impairments.jamming import Zone
from netem.medium.verdict import Verdict
from world.books.history import Arrays, by_span


@dataclass(frozen=True)
class Jam:
    """What a jammed zone took hold of.

    Parameters
    ----------
    zone
        Where it is.
    jammed
        How many messages to agents in it, on its links and channels, were dropped as jammed.
    why
        Why it jammed none, if it did not.
    """

    zone: str
    jammed: int
    why: str | None

    def __str__(self) -> str:
        return f"{self.zone} jammed {self.jammed} messages{f': {self.why}' if self.why else ''}"

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return asdict(self)


def jams(plan: Plan, arrays: Arrays) -> list[Jam]:
    """What every jammed zone of the scenario took hold of in the ticks flown.

    Parameters
    ----------
    plan
        What was flown.
    arrays
        What happened.
    """
    found = []
    for number, zone in enumerate(plan.profiles[0].zones, start=1):
        jammed = _jammed(plan, zone, arrays)
        where = ", ".join(f"{one:g}" for one in zone.centre)
        name = f"{number}, {zone.radius:g} m about ({where})"
        found.append(Jam(name, jammed, None if jammed else _why(plan, zone, arrays)))
    return found


def _jammed(plan: Plan, zone: Zone, arrays: Arrays) -> int:
    on = _on(zone, plan.channels)
    total = 0
    for span in by_span(arrays):
        verdicts = span["verdicts"]
        inside = zone.jammed(plan.world.links.dst - 1, span["position"][: len(verdicts)])
        total += int(((verdicts[:, on] == Verdict.JAMMED) & inside[:, None]).sum())
    return total


def _on(zone: Zone, channels: Sequence[str]) -> Array:
    """Which channels it acts on, shape (C,)."""
    return np.array([zone.sensing if name == channel_names.SENSE else zone.comms for name in channels])


def _why(plan: Plan, zone: Zone, arrays: Arrays) -> str:
    if zone.share == 0.0:
        return "its share of ticks is 0"
    if not len(arrays["error"]):
        return "no tick was flown"
    receivers = np.unique(plan.world.links.dst[zone.rows]) - 1
    tick, agent, nearest = _nearest(zone, receivers.tolist(), arrays)
    if nearest > zone.radius:
        came = f"agent {agent} came nearest, to {nearest:.3g} m of its centre at {tick * plan.world.dt:g} s"
        return f"nobody who hears on its links was ever in it; {came}"
    chance = f", and it is on in a share of {zone.share:g} of the ticks" if zone.share < 1.0 else ""
    return f"what it would have jammed was silent, or dropped for a stronger reason (docs/network.md){chance}"


def _nearest(zone: Zone, agents: Sequence[int], arrays: Arrays) -> tuple[int, int, float]:
    """When which agent, by its number, was how far from the centre, in metres, when one of these was nearest."""
    first, found = 0, (0, 0, np.inf)
    for span in by_span(arrays):
        apart = span["position"][: len(span["verdicts"]), agents] - zone.centre
        distance = np.sqrt(np.nan_to_num((apart * apart).sum(axis=-1), nan=np.inf))
        place = np.unravel_index(int(distance.argmin()), distance.shape)
        if distance[place] < found[2]:
            found = (first + int(place[0]), agents[int(place[1])] + 1, float(distance[place]))
        first += len(distance)
    return found
