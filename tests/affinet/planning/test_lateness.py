"""What makes messages late is named with its bound: each impairment is flown, and how late messages were is held against it."""

import numpy as np
import pytest
from flying import plan_of

from affinet.runtimes.array_carrier import ArrayCarrier
from affinet.runtimes.inprocess import InProcessSwarm

SHORT = ("time.dt=0.05", "time.duration=3", "record.enabled=false", 'agents.estimator="edge-kf"', 'agents.law="static"')
RING = "agents.parameters.static.alpha=1"


def profile(**keys):
    """A profile on all links."""
    said = ", ".join(f"{key}={value}" for key, value in keys.items())
    return (f"network.profiles.x={{{said}}}", 'network.profile="x"')


def fault(*said):
    return (f"timeline=[{', '.join(f'{{{one}}}' for one in said)}]",)


def hold(verb, whom, at, until):
    return f'verb="{verb}",{whom},at={at},until={until},in_flight="hold"'


ALL, FOURTH = 'links=["all"]', "agents=[4]"
SOON = "{tracking_error_below=1e3, lasting=0.3}"


BAD = '[{model="gilbert-elliott",p=0.2,r=0.3,bad=LOST,extra_delay=0.12}]'
HOLDS = 'at=0.5,until=0.9,in_flight="hold"'
AIRS = {
    "nothing": ((), "", 0),
    "losses": (("network.availability=0.5",), "", 0),
    "ticks": (("network.delay_ticks=2",), "network.delay_ticks", 2),
    "exchange": (('time.exchange="next-tick"',), "time.exchange", 1),
    "both": (('time.exchange="next-tick"', "network.delay_ticks=2"), "time.exchange and network.delay_ticks", 2),
    "one link": (('network.links=[{links="6->4",delay_ticks=3}]',), "network.delay_ticks", 3),
    "sensing": (('network.links=[{links="all",channels="sensing",delay_ticks=3}]', "network.coupled=false"), "", 0),
    "constant": (profile(delay='{model="constant",mean=0.12}'), "profile 'x' (delay)", 3),
    "jitter": (profile(delay='{model="uniform",mean=0.1,jitter=0.08}'), "profile 'x' (delay)", 4),
    "normal": (profile(delay='{model="normal",mean=0.1,jitter=0.05}'), "profile 'x' (delay)", np.inf),
    "exponential": (profile(delay='{model="exponential",mean=0.1}'), "profile 'x' (delay)", np.inf),
    "pareto": (profile(delay='{model="pareto",mean=0.1,jitter=0.05}'), "profile 'x' (delay)", np.inf),
    "table": (profile(delay='{model="table",table=[0.01,0.2]}'), "profile 'x' (delay)", 4),
    "order": (profile(delay='{model="uniform",mean=0.1,jitter=0.08,order="kept"}'), "profile 'x' (delay)", 4),
    "bad spells": (profile(loss=BAD.replace("LOST", "0.5")), "profile 'x' (loss)", 3),
    "bad spells by packet": (profile(loss=BAD.replace("LOST", '0.5,step="packet"')), "profile 'x' (loss)", 3),
    "bad spells that let nothing pass": (profile(loss=BAD.replace("LOST", "1.0")), "", 0),
    "reordered": (profile(delay='{model="constant",mean=0.1}', reorder=0.5), "profile 'x' (delay)", 2),
    "reordered at once": (profile(reorder=0.5), "", 0),
    "doubled": (profile(delay='{model="uniform",mean=0.1,jitter=0.1}', duplicate=0.5), "profile 'x' (delay)", 4),
    "doubled at once": (profile(duplicate=0.5), "", 0),
    "stale": (profile(corrupt='[{kind="stale",p=0.3}]'), "profile 'x' (corrupt)", 1),
    "wrong": (profile(corrupt='[{kind="bias",p=0.3,by=0.1}]'), "", 0),
    "rate": (profile(rate="{rate=20000,queue=500}"), "profile 'x' (rate)", 4),
    "ticks and delay": (
        ("network.delay_ticks=2", *profile(delay='{model="constant",mean=0.06}')),
        "network.delay_ticks and profile 'x' (delay)",
        4,
    ),
    "delayed": (fault('verb="delay",at=0.5,links=["all"],delay=0.12'), "timeline: delay", 3),
    "degraded": (
        (*profile(delay='{model="constant",mean=0.12}')[:1], *fault('verb="degrade",at=1,links=["all"],profile="x"')),
        "profile 'x' (delay)",
        3,
    ),
    "held": (
        ("network.delay_ticks=2", *fault(f'verb="cut",links=["all"],{HOLDS}')),
        "timeline: cut, messages held",
        8,
    ),
    "delayed twice at once": (
        fault(*(f'verb="delay",at={at},lasts=1,{ALL},delay=0.12' for at in (0.5, 0.6))),
        "timeline: delay",
        5,
    ),
    "delayed twice, one after the other": (
        fault(*(f'verb="delay",at={at},lasts=0.5,{ALL},delay=0.12' for at in (0.5, 1.0))),
        "timeline: delay",
        3,
    ),
    "delayed once more on a condition": (
        fault(f'verb="delay",when={SOON},{ALL},delay=0.12', f'verb="delay",at=0.5,{ALL},delay=0.12'),
        "timeline: delay",
        5,
    ),
    "held, and held again at once": (
        ("network.delay_ticks=2", *fault(hold("cut", ALL, 0.5, 0.9), hold("cut", ALL, 0.9, 1.3))),
        "timeline: cut, messages held",
        16,
    ),
    "held twice at once": (
        ("network.delay_ticks=2", *fault(hold("cut", ALL, 0.5, 0.9), hold("cut", ALL, 0.8, 1.3))),
        "timeline: cut, messages held",
        16,
    ),
    "held again while under way": (
        ("network.delay_ticks=2", *fault(hold("cut", ALL, 0.5, 0.9), hold("cut", ALL, 0.95, 1.3))),
        "timeline: cut, messages held",
        15,
    ),
    "held by a cut, then by a pause": (
        ("network.delay_ticks=2", *fault(hold("cut", ALL, 0.5, 0.9), hold("pause", FOURTH, 0.9, 1.3))),
        "timeline: cut and pause, messages held",
        16,
    ),
    "held on this link, then on that": (
        (
            "network.delay_ticks=2",
            *fault(hold("cut", 'links=["6->4"]', 0.5, 0.9), hold("cut", 'links=["5->4"]', 0.9, 1.3)),
        ),
        "timeline: cut, messages held",
        8,
    ),
    "held, and delayed": (
        fault(f'verb="delay",at=0.2,{ALL},delay=0.12', hold("cut", ALL, 0.5, 0.9)),
        "timeline: cut, messages held",
        8,
    ),
    "paused": (
        ("network.availability=0.3", *fault(f'verb="pause",agents=[4],{HOLDS}')),
        "timeline: pause, messages held",
        8,
    ),
}


def latest(plan, monkeypatch):
    """How late a message was heard at the most."""
    ages, hear = [0], ArrayCarrier._hear

    def listening(self, *told):
        heard = hear(self, *told)
        ages.extend(int(np.max(np.where(one.fresh, one.age, 0))) for one in heard.values())
        return heard

    monkeypatch.setattr(ArrayCarrier, "_hear", listening)
    InProcessSwarm(plan).fly(lambda *_: None, plan.world.ticks)
    return max(ages)


@pytest.mark.parametrize(("air", "where", "most"), AIRS.values(), ids=AIRS)
def test_all_that_makes_messages_late_is_named_and_nothing_else(air, where, most, monkeypatch):
    plan = plan_of("corridor", *SHORT, RING, *air)
    flown = latest(plan, monkeypatch)
    causes = plan.swarm.late
    if where:
        assert {cause.where: cause.ticks for cause in causes}[where] == most
        assert flown > 0
    else:
        assert causes == ()
    assert (plan.swarm.lateness == 0) == (not causes)
    assert flown <= plan.swarm.lateness == plan.brief.lateness <= plan.world.ticks
    said = [finding.says for finding in plan.findings if finding.check == "inputs"]
    assert len(said) == bool(causes)
    assert all(str(cause) in says for says in said for cause in causes)


def says(*over):
    plan = plan_of("corridor", *SHORT, RING, *over)
    return [finding.says for finding in plan.findings if finding.check == "inputs"]


def test_what_comes_later_than_the_filter_remembers_is_said_to_be_lost():
    (said,) = says("network.delay_ticks=40")
    assert "inputs are heard late (network.delay_ticks: up to 40 ticks)" in said
    assert "those more than 32 ticks late (memory) count as lost, and with memory = 40 none do" in said
    (said,) = says("network.delay_ticks=40", "agents.parameters.edge-kf.memory=40")
    assert "count as lost" not in said
    (said,) = says(*profile(delay='{model="exponential",mean=0.1}'))
    assert "(profile 'x' (delay): without a bound)" in said
    assert "those more than 32 ticks late (memory) count as lost;" in said


def test_guesses_that_are_not_doubted_are_said_to_make_the_filter_too_sure():
    (said,) = says("network.delay_ticks=2")
    assert "with sigma_n 0 not doubted" in said
    (said,) = says("network.delay_ticks=2", "agents.parameters.edge-kf={ coefficients = [0.9], sigma_n = 0.1 }")
    assert "sigma_n" not in said


def test_of_several_causes_each_is_named_and_those_of_the_air_and_of_the_timeline_add_up():
    plan = plan_of(
        "corridor", *SHORT, RING, "network.delay_ticks=2", 'network.links=[{links="6->4",delay_ticks=5}]',
        *fault('verb="delay",at=0.5,links=["all"],delay=0.12'),
    )  # fmt: skip
    assert [str(cause) for cause in plan.swarm.late] == [
        "network.delay_ticks: up to 5 ticks",
        "timeline: delay: up to 3 ticks",
    ]
    assert plan.swarm.lateness == 8
