"""Changing the air of a run while it flies: orders to the medium, and what it answers.

A change holds from the first tick that is not decided yet, lands in the journal with that tick, and is a fault like those of
the timeline. Healing ends what was injected; what the scenario scripted stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum

from netem.core.links import Links
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline

INJECTABLE = (Verb.CUT, Verb.PARTITION, Verb.LOSE)


class OrderAction(StrEnum):
    """What is asked of the medium."""

    SHOW = "show"
    INJECT = "inject"
    HEAL = "heal"


@dataclass(frozen=True)
class Order:
    """A query to the medium.

    Parameters
    ----------
    action
        What to do.
    fault
        What to inject; its `start` is 0 and its `end` how many ticks it lasts.
    """

    action: OrderAction
    fault: Fault | None


@dataclass(frozen=True)
class Answer:
    """The medium's reply.

    Parameters
    ----------
    k
        The tick from which it holds.
    holds
        What is then imposed, in words, the scenario's faults among it.
    refused
        Why nothing was changed, if so.
    """

    k: int
    holds: tuple[str, ...]
    refused: str | None


def obey(order: Order, tick: int, timeline: Timeline) -> tuple[Timeline, Answer]:
    """The timeline after an order that holds from `tick` on, and the answer to it."""
    injected, refused = timeline.injected, None
    if order.action is OrderAction.HEAL:
        injected = tuple(replace(fault, end=tick) if fault.active(tick) else fault for fault in injected)
    if order.action is OrderAction.INJECT:
        refused = _why_not(order.fault, timeline.links)
        if refused is None and order.fault is not None:
            lasts = order.fault.end
            injected = (*injected, replace(order.fault, start=tick, end=None if lasts is None else tick + lasts))
    after = timeline if injected == timeline.injected else timeline.facing(injected)
    holds = tuple(fault.describe() for fault in after.faults if fault.active(tick))
    return after, Answer(tick, holds, refused)


def _why_not(fault: Fault | None, links: Links) -> str | None:
    if fault is None or fault.verb not in INJECTABLE:
        return f"only {', '.join(INJECTABLE)} can be injected into a run that flies"
    if not 0.0 <= fault.probability <= 1.0:
        return f"a probability of loss lies in [0, 1], got {fault.probability:g}"
    if fault.end is not None and fault.end <= 0:
        return f"a fault lasts at least one tick, got {fault.end}"
    try:
        timeline = Timeline(links, [fault])
    except ValueError as error:
        return str(error)
    return None if timeline.held(0).any() else "it takes hold of no link"
