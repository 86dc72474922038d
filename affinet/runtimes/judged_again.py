"""What faults that lose or delay by chance changed, in many runs at once: their messages judged again without one of each run.

Runs of a batch do not interact. So the first such fault of every run is left out at once, then the second of every run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from affinet.planning.plan import Plan
from affinet.runtimes.side_by_side import Flight, faults_of
from affinet.verdicts.bites import arriving, by_the_models
from analysis.models.arrays import Array
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.relay import Relay
from netem.medium.verdict import VerdictCodes


def changed(batch: Plan, plans: Sequence[Plan], verdicts: VerdictCodes, position: Array) -> list[dict[int, int]]:
    """Of each run, for each fault that is judged again, how many messages fared otherwise while it lasted.

    Parameters
    ----------
    batch, plans
        All runs as one, and each of them.
    verdicts, position
        Of all, shape (T, C, L) and (T + 1, N, D): what was decided of each message, and where the agents were.
    """
    found = [{number: 0 for number, fault in enumerate(plan.faults) if by_the_models(plan, fault)} for plan in plans]
    places = sorted({number for of_run in found for number in of_run})
    if not places:
        return found
    relay = Relay[None](Medium(batch.world.seed, batch.channels, batch.profiles, batch.timeline))
    others = {place: relay.under(_without(batch, plans, place)) for place in places}
    for tick, (offered, where) in enumerate(zip(verdicts, position, strict=False)):
        usual = arriving(relay, tick, offered, where)
        for place, other in others.items():
            differs = (arriving(other, tick, offered, where) != usual).reshape(len(usual), len(plans), -1)
            for run, number in enumerate(differs.sum(axis=(0, 2)).tolist()):
                if number and place in found[run] and plans[run].faults[place].active(tick):
                    found[run][place] += number
    return found


def _without(batch: Plan, plans: Sequence[Plan], place: int) -> Timeline:
    """The timeline of all runs without the fault in this place of each, where that is judged again."""

    def left(plan: Plan) -> Plan:
        if place >= len(plan.faults) or not by_the_models(plan, plan.faults[place]):
            return plan
        return replace(plan, faults=(*plan.faults[:place], *plan.faults[place + 1 :]))

    flights = [Flight(left(plan), [plan.scenario.seed]) for plan in plans]
    return Timeline(batch.world.links, tuple(faults_of(flights)), batch.triggers)
