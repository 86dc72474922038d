"""Why a fault touched nothing, in words that say what to change."""

from __future__ import annotations

from collections import Counter

import numpy as np

from affinet.planning.plan import Plan
from analysis.models.arrays import Array, Mask
from netem.faults import lie
from netem.faults.fault import BY_CHANCE, OF_SENSORS, Fault, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.medium.verdict import VERDICT_OF, Verdict
from world.books.history import Arrays


def why(plan: Plan, timeline: Timeline, arrays: Arrays, number: int) -> str:
    """Why a fault touched nothing in the ticks flown.

    Parameters
    ----------
    plan
        What was flown.
    timeline
        Its faults, where they came to lie.
    arrays
        What happened.
    number
        Which of the faults.
    """
    fault, ticks, dt = timeline.faults[number], len(arrays["error"]), plan.world.dt
    if fault.trigger is not None:
        return _never_fired(timeline.triggers[fault.trigger], arrays["error"], dt)
    if fault.start >= ticks:
        return f"it starts at {fault.start * dt:g} s, and the run ends at {ticks * dt:g} s"
    if fault.verb in BY_CHANCE and fault.probability == 0.0:
        return "its probability is 0"
    span = range(fault.start, ticks if fault.end is None else min(ticks, fault.end))
    match fault.verb:
        case Verb.CLOCK:
            return _right_clocks(plan, timeline, fault, span)
        case Verb.LIE if lie.CHANNEL not in plan.channels:
            return f"nobody tells a Theta: the estimator {plan.scenario.agents.estimator!r} has none to tell"
    if fault.agents and fault.verb is not Verb.LIE and fault.verb not in VERDICT_OF:
        return "its agents held still, dead or departed, while it lasted"
    return _fared(plan, fault, timeline.held(number), arrays, span)


def _never_fired(trigger: Trigger, error: Array, dt: float) -> str:
    level = f"{'above' if trigger.above else 'below'} {trigger.level:g} m²"
    extreme = error.max() if trigger.above else error.min()
    if (extreme > trigger.level) if trigger.above else (extreme < trigger.level):
        return f"its condition never came: the tracking error was never {level} for {trigger.ticks * dt:g} s in a row"
    most = "most" if trigger.above else "least"
    return f"its condition never came: the tracking error was never {level}, at the {most} {extreme:.4g} m²"


def _right_clocks(plan: Plan, timeline: Timeline, fault: Fault, span: range) -> str:
    agents = np.array(fault.agents) - 1
    if not plan.told_mission[agents].any():
        return "its agents do not fly by their clocks: leaders do, and followers that feed the manoeuvre forward"
    if all(timeline.at(tick).idle[agents].all() for tick in span):
        return "its agents were dead or paused while it lasted"
    return f"its clocks gained less than a tick, {plan.world.dt:g} s, while it lasted"


def _fared(plan: Plan, fault: Fault, held: Mask, arrays: Arrays, span: range) -> str:
    """What became of the messages that it could have touched."""
    verdicts = arrays["verdicts"][span.start : span.stop]
    if fault.verb in OF_SENSORS:
        what, fared = "measurements", verdicts[:, :1, held]
    elif fault.verb is Verb.LIE:
        said = np.isin(plan.world.links.src, fault.agents)
        what, fared = "messages", verdicts[:, [plan.channels.index(lie.CHANNEL)]][:, :, said]
    else:
        what, fared = "messages", verdicts[:, :, held]
    offered = Counter(fared[fared != Verdict.SILENT].tolist())
    where = fault.links() if fault.pairs else "its links"
    if not offered:
        return f"{where} carried nothing while it lasted"
    became = ", ".join(f"{number} {Verdict(verdict).label}" for verdict, number in sorted(offered.items()))
    fared_alike = f"of the {offered.total()} {what} on {where} meanwhile ({became})"
    if fault.verb in BY_CHANCE and offered[Verdict.DELIVERED]:
        return f"its probability, {fault.probability:g}, struck none {fared_alike}"
    return f"it changed nothing {fared_alike}"
