"""What faults took hold of that are told by comparison: as many messages as fare otherwise in a run without the fault."""

import numpy as np
import pytest
from flying import plan_of
from scripted import timeline

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts.bites import bites
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.relay import Relay
from netem.medium.verdict import Verdict
from world.books import history

WILD = (
    'network.profile="wild"',
    'network.profiles.wild={like="wifi_busy",duplicate=0.05,rate={rate=3e5,queue=4000}}',
)
OVERLAPPING = timeline(
    {"verb": "lose", "at": 0.2, "lasts": 0.4, "every": 0.5, "links": ["4-6"], "loss": 0.6},
    {"verb": "lose", "at": 0.3, "until": 1.2, "links": ["4-5", "5-7", "4-6"], "loss": 0.3},
    {"verb": "delay", "at": 0.4, "until": 0.9, "links": ["5-7"], "delay": 0.2},
    {"verb": "dropout", "at": 0.5, "links": ["4-5", "6-7"], "p": 0.5},
    {"verb": "cut", "at": 0.6, "until": 0.8, "links": ["4-6"]},
    {"verb": "kill", "at": 0.7, "agents": [7]},
)


def one_by_one(run, number):
    """Each fault's run judged from the first tick on without it."""
    plan, faults = run.plan, run.timeline.faults
    others = [other for place, other in enumerate(faults) if place != number]

    def arrivals(faults):
        timeline = Timeline(run.timeline.links, faults, run.timeline.triggers)
        relay = Relay(Medium(plan.scenario.seed, plan.channels, plan.profiles, timeline))
        for tick, verdicts in enumerate(run.arrays["verdicts"]):
            decided = relay.decide_on(tick, verdicts != Verdict.SILENT, run.arrays["position"][tick]).verdicts
            relay.finish(tick)
            yield np.where(decided.kind <= Verdict.DELAYED, decided.due, -1)

    changed = np.array(list(arrivals(faults))) != np.array(list(arrivals(others)))
    return int(changed[faults[number].start : faults[number].end].sum())


@pytest.mark.parametrize("span", [7, 512])
@pytest.mark.parametrize("air", [("network.availability=0.8",), WILD], ids=["losses", "wild"])
def test_all_are_told_in_one_go_as_they_are_one_by_one(air, span, monkeypatch):
    """Before: the run was judged again from its first tick for each of them."""
    monkeypatch.setattr(history, "_SPAN", span)
    run = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=1.5", *air, OVERLAPPING))
    told = {n: bite.touched for n, bite in enumerate(run.bites) if bite.fault.verb in ("lose", "delay", "dropout")}
    assert len(told) == 6
    assert told == {number: one_by_one(run, number) for number in told}
    assert all(told.values())


def test_the_run_is_gone_through_once_however_many_faults_there_are(monkeypatch):
    run = rehearse(plan_of("corridor", "time.dt=0.05", "time.duration=1.5", OVERLAPPING))
    decided = []
    decide_on = Relay.decide_on

    def counted(self, tick, *given):
        decided.append(tick)
        return decide_on(self, tick, *given)

    monkeypatch.setattr(Relay, "decide_on", counted)
    bites(run.plan, run.timeline, run.arrays)
    lasting = sum((bite.fault.end or 30) - bite.fault.start for bite in run.bites if bite.fault.verb != "cut")
    assert len(decided) <= 30 + lasting
