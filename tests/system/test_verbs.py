"""Every verb takes hold of what it names, of nothing before its time, and a run says when it took hold of nothing."""

import json
from typing import NamedTuple

import numpy as np
import pytest
from flying import plan_of
from scripted import timeline

from affinet.planning.plan import Plan
from affinet.runtimes.run import fly
from affinet.scenario import verbs
from affinet.verdicts.compare import first_difference
from affinet.verdicts.outcome import Outcome
from netem.medium.verdict import Verdict
from world.books import history

DT = 0.05
BASE = (
    f"time.dt={DT}",
    "time.duration=2",
    "record.enabled=false",
    "network.availability=1",
    "formation.spread=0.5",
    'network.profiles.slow={delay={model="constant",mean=0.1}}',
)
RKF = ('agents.estimator="rkf"',)
LATE = ("network.delay_ticks=2",)
NEVER = {"tracking_error_above": 1e9}


class Flight(NamedTuple):
    """A run in this process."""

    plan: Plan
    outcome: Outcome
    arrays: history.Arrays

    @property
    def links(self):
        return self.plan.world.links

    def verdicts(self, src, dst):
        """Of a link, in every tick, shape (T, C)."""
        return self.arrays["verdicts"][:, :, self.links.index[src, dst]]

    def verdicts_around(self, agent):
        """Of all links from and to an agent, in every tick, shape (T, C, L')."""
        return self.arrays["verdicts"][:, :, self.links.touching(np.arange(1, self.links.agents + 1) == agent)]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Flies a timeline over the corridor, once."""
    flights = {}

    def fly_once(*entries, over=()):
        key = json.dumps([entries, over])
        if key not in flights:
            plan = plan_of("corridor", *BASE, *over, timeline(*entries))
            out = tmp_path_factory.mktemp("verbs") / "run"
            outcome = fly(plan, "inprocess", out, lambda *_: None)
            flights[key] = Flight(plan, outcome, history.load(out / history.ARRAYS))
        return flights[key]

    return fly_once


def part(one, other):
    """Where two runs part: tick, quantity, and of whom."""
    difference = first_difference(one.arrays, other.arrays, one.links, one.plan.channels)
    assert difference is not None
    return difference.tick, difference.quantity, difference.where


# ---- what bites

MIRROR = [[-1.0, 0.0], [0.0, 1.0]]
# How every verb is written: where, when, and how long is said by the tests.
WHAT = {
    "cut": {"links": ["2->4"]},
    "partition": {"groups": [[1, 2, 3], [4]]},
    "lose": {"links": ["2->4"], "loss": 1.0},
    "delay": {"links": ["2->4"], "delay": 0.1},
    "degrade": {"links": ["2->4"], "profile": "slow"},
    "heal": {},
    "kill": {"agents": [5]},
    "restart": {"agents": [5]},
    "pause": {"agents": [5]},
    "resume": {"agents": [5]},
    "clock": {"agents": [1], "rate": 1.0},
    "depart": {"agents": [5]},
    "rejoin": {"agents": [5]},
    "replace": {"agents": [5]},
    "gust": {"agents": [5], "velocity": [1.0, 0.0]},
    "bias": {"links": ["2->4"], "by": [0.3, 0.0]},
    "outlier": {"links": ["2->4"], "p": 1.0, "sigma": 1.0},
    "dropout": {"links": ["2->4"]},
    "freeze": {"links": ["2->4"]},
    "lie": {"agents": [4], "matrix": MIRROR},
}
ENDED_BY = {"heal": "cut", "restart": "kill", "resume": "pause", "rejoin": "depart", "replace": "depart"}
# What differs first from a run without the verb, when it comes in tick 20, and of whom.
FIRST = {
    "cut": (20, "verdicts", "sense on 2->4"),
    "partition": (20, "verdicts", "sense on 4->1"),
    "lose": (20, "verdicts", "sense on 2->4"),
    "delay": (20, "verdicts", "input on 2->4"),  # sensing is not delayed
    "degrade": (20, "verdicts", "input on 2->4"),
    "heal": (20, "verdicts", "sense on 2->4"),
    "kill": (20, "error", ""),  # of those who take part
    "restart": (20, "error", ""),
    "pause": (20, "verdicts", "sense on 1->5"),  # it takes part; its ears are closed
    "resume": (20, "verdicts", "sense on 1->5"),
    "clock": (21, "input", "agent 1"),  # one second per second: a tick ahead after a tick
    "depart": (20, "error", ""),
    "rejoin": (20, "error", ""),
    "replace": (19, "verdicts", "sense on 5->1"),  # its process is killed in the last tick of its absence
    "gust": (21, "position", "agent 5"),
    "bias": (20, "measured", "2->4"),
    "outlier": (20, "measured", "2->4"),
    "dropout": (20, "verdicts", "sense on 2->4"),
    "freeze": (20, "measured", "2->4"),
    "lie": (20, "psi", "agent 1"),  # the first neighbour who believes it
}


def lasting(verb):
    return issubclass(verbs.VERBS[verb], verbs.Lasting)


def scripted(verb, at, **more):
    """The entry of a verb at a time; one that ends something comes after what it ends, half a second earlier."""
    entry = {"verb": verb, "at": at, **({"lasts": 0.5} if lasting(verb) else {}), **WHAT[verb], **more}
    if verb not in ENDED_BY:
        return [entry]
    return [{"verb": ENDED_BY[verb], "at": at - 0.5, **WHAT[ENDED_BY[verb]]}, entry]


def test_no_verb_is_left_out():
    assert set(WHAT) == set(FIRST) == set(verbs.VERBS)


@pytest.mark.parametrize("verb", verbs.VERBS)
def test_a_verb_changes_what_it_says_and_nothing_before_its_time(verb, flown):
    entries = scripted(verb, 1.0)
    with_it, without = flown(*entries), flown(*entries[:-1])
    assert with_it.outcome.verdict == "pass", with_it.outcome.reasons
    bite, *death = with_it.outcome.faults
    assert all(one.touched > 0 for one in (bite, *death))
    assert len(death) == (verb == "replace")  # of the process whose place is taken
    assert bite.at == (0.5 if verb in ENDED_BY else 1.0)
    assert part(without, with_it) == FIRST[verb]


@pytest.mark.parametrize("verb", verbs.VERBS)
def test_a_verb_whose_condition_never_comes_makes_the_run_vacuous_and_changes_nothing(verb, flown):
    *before, last = scripted(verb, 1.0)
    waiting = [{**entry, "at": 0.0, "when": NEVER, "name": "never"} for entry in before]
    last = {**last, "after": "never"} if before else {**last, "when": NEVER}
    flight = flown(*waiting, last)
    assert flight.outcome.verdict == "vacuous"
    assert {(bite.at, bite.touched) for bite in flight.outcome.faults} == {(None, 0)}
    assert flight.outcome.digest == flown().outcome.digest


@pytest.mark.parametrize("verb", [verb for verb in verbs.VERBS if verb not in ENDED_BY])
def test_what_lies_beyond_the_end_of_the_run_is_noted_and_makes_it_vacuous(verb, flown):
    flight = flown(*scripted(verb, 2.0))
    assert any(f"'{verb}" in note.says and "the run will be vacuous" in note.says for note in flight.plan.findings)
    (bite,) = flight.outcome.faults
    assert (flight.outcome.verdict, bite.at, bite.touched) == ("vacuous", 2.0, 0)
    assert flight.outcome.digest == flown().outcome.digest


# ---- how much

TICKS, CHANNELS = 10, 4  # of half a second; sensing, input, measurement and theta


@pytest.mark.parametrize(
    ("verb", "touched", "what"),
    [
        ("cut", TICKS * CHANNELS, "messages"),
        ("partition", 2 * 2 * TICKS * CHANNELS, "messages"),  # 1-4 and 2-4, both ways
        ("lose", TICKS * CHANNELS, "messages"),
        ("delay", TICKS * (CHANNELS - 1), "messages"),
        ("degrade", TICKS * (CHANNELS - 1), "messages"),
        ("pause", 4 * TICKS, "messages"),  # four neighbours that it does not sense
        ("clock", TICKS - 1, "ticks of agents that fly by the clock"),
        ("gust", TICKS, "ticks of agents"),
        ("bias", TICKS, "measurements"),
        ("outlier", TICKS, "measurements"),
        ("dropout", TICKS, "messages"),
        ("freeze", TICKS, "measurements"),
        ("lie", 4 * TICKS, "messages"),
    ],
)
def test_a_bite_counts_what_was_touched(verb, touched, what, flown):
    (bite,) = flown(*scripted(verb, 1.0)).outcome.faults
    assert (bite.touched, bite.what) == (touched, what)


def test_departed_and_dead_agents_touch_everything_to_and_from_them(flown):
    (departed,), (dead,) = (flown(*scripted(verb, 1.5)).outcome.faults for verb in ("depart", "kill"))
    assert departed.touched == 8 * TICKS * CHANNELS
    assert dead.touched == 4 * TICKS * CHANNELS + 4 * TICKS  # what it would have said is not there to be lost


# ---- what touches nothing

KILLED = {"verb": "kill", "at": 0.5, "agents": [4, 5]}
SEVERED = {"verb": "cut", "at": 0.5, "links": ["2->4"]}
VACUOUS = {
    "cut of a dead agent": ([KILLED, *scripted("cut", 1.0)], ()),
    "partition of a dead agent": ([KILLED, *scripted("partition", 1.0)], ()),
    "partition of agents without a link": ([*scripted("partition", 1.0, groups=[[1], [7]])], ()),
    "lose under a cut": ([SEVERED, *scripted("lose", 1.0)], ()),
    "lose by no chance": (scripted("lose", 1.0, loss=0.0), ()),
    "delay under a cut": ([SEVERED, *scripted("delay", 1.0)], ()),
    "degrade to what is no worse": (scripted("degrade", 1.0, profile="perfect"), ()),
    "heal of a cut that cut nothing": (
        [KILLED, {"verb": "cut", "at": 1.0, "links": ["2->4"]}, {"verb": "heal", "at": 1.5}],
        (),
    ),
    "pause of a dead agent": ([KILLED, *scripted("pause", 1.0)], ()),
    "resume of a dead agent": (
        [KILLED, {"verb": "pause", "at": 1.0, "agents": [5]}, {"verb": "resume", "at": 1.5, "agents": [5]}],
        (),
    ),
    "clock of who does not know the mission": (scripted("clock", 1.0, agents=[5]), ()),
    "clock of a dead leader": ([{"verb": "kill", "at": 0.5, "agents": [1]}, *scripted("clock", 1.0)], ()),
    "clock that has not lost a tick yet": (scripted("clock", 1.0, lasts=0.2, rate=0.01), ()),
    "depart of a dead agent": ([KILLED, *scripted("depart", 1.0)], ()),
    "rejoin of a dead agent": (
        [KILLED, {"verb": "depart", "at": 1.0, "agents": [5]}, {"verb": "rejoin", "at": 1.5, "agents": [5]}],
        (),
    ),
    "gust on a dead agent": ([KILLED, *scripted("gust", 1.0)], ()),
    "gust on who holds, departed": ([{"verb": "depart", "at": 0.5, "agents": [5]}, *scripted("gust", 1.0)], ()),
    "bias under a cut": ([SEVERED, *scripted("bias", 1.0)], ()),
    "outlier of no chance": (scripted("outlier", 1.0, p=1e-9), ()),
    "outlier under a cut": ([SEVERED, *scripted("outlier", 1.0)], ()),
    "dropout of no chance": (scripted("dropout", 1.0, p=0.0), ()),
    "dropout under a cut": ([SEVERED, *scripted("dropout", 1.0)], ()),
    "freeze under a cut": ([SEVERED, *scripted("freeze", 1.0)], ()),
    "lie of who tells no map": (scripted("lie", 1.0), RKF),
    "lie of a dead agent": ([KILLED, *scripted("lie", 1.0)], ()),
    "lie of a paused agent": ([{"verb": "pause", "at": 0.5, "agents": [4]}, *scripted("lie", 1.0)], ()),
}
# A death takes the agent's messages whatever else holds, so only a condition that never comes makes it touch nothing.
ALWAYS_BITE = {"kill", "restart", "replace"}


def test_every_verb_that_can_touch_nothing_has_a_way_to():
    assert {name.split()[0] for name in VACUOUS} == set(verbs.VERBS) - ALWAYS_BITE


FROZEN = {"verb": "freeze", "at": 0.5, "links": ["2->4"]}
NEXT_TICK = ('time.exchange="next-tick"', "agents.parameters.varying-velocity.relaxation=0.3")
UNNOTICED = {
    "degrade under a cut": ([SEVERED, *scripted("degrade", 1.0)], ()),
    "degrade of a dead agent": ([KILLED, *scripted("degrade", 1.0)], ()),
    "bias of a frozen sensor": ([FROZEN, *scripted("bias", 1.0)], ()),
    "outlier of a frozen sensor": ([FROZEN, *scripted("outlier", 1.0)], ()),
    "delay no longer than a message takes anyway": (scripted("delay", 1.0, delay=DT), NEXT_TICK),
}


@pytest.mark.parametrize("name", UNNOTICED)
def test_what_is_hidden_by_another_fault_changes_nothing(name, flown):
    entries, over = UNNOTICED[name]
    assert flown(*entries, over=over).outcome.digest == flown(*entries[:-1], over=over).outcome.digest


@pytest.mark.parametrize("name", UNNOTICED)
def test_what_touches_nothing_beside_another_fault_makes_the_run_vacuous(name, flown):
    entries, over = UNNOTICED[name]
    assert flown(*entries, over=over).outcome.verdict == "vacuous"


@pytest.mark.parametrize("name", VACUOUS)
def test_what_touches_nothing_makes_the_run_vacuous(name, flown):
    entries, over = VACUOUS[name]
    outcome = flown(*entries, over=over).outcome
    assert outcome.verdict == "vacuous"
    assert outcome.faults[-1].touched == 0
    (reason,) = outcome.reasons  # whatever else is scripted bites
    assert reason.startswith(f"'{outcome.faults[-1].fault.describe()}' touched no ")


WHY = {
    "cut of a dead agent": "it changed nothing of the 40 messages on 2->4 meanwhile (40 dead)",
    "partition of agents without a link": "its links carried nothing while it lasted",
    "lose under a cut": "it changed nothing of the 40 messages on 2->4 meanwhile (40 cut)",
    "lose by no chance": "its probability is 0",
    "degrade to what is no worse": "it changed nothing of the 40 messages on 2->4 meanwhile (40 delivered)",
    "clock of who does not know the mission": "its agents do not fly by their clocks: leaders do, and followers that feed "
    "the manoeuvre forward",
    "clock of a dead leader": "its agents were dead or paused while it lasted",
    "clock that has not lost a tick yet": "its clocks gained less than a tick, 0.05 s, while it lasted",
    "gust on who holds, departed": "its agents held still, dead or departed, while it lasted",
    "outlier of no chance": "its probability, 1e-09, struck none of the 10 measurements on 2->4 meanwhile (10 delivered)",
    "lie of who tells no map": "nobody tells a Theta: the estimator 'rkf' has none to tell",
    "lie of a dead agent": "its links carried nothing while it lasted",
}
NEVER_BEGAN = {
    "it starts at 3 s, and the run ends at 2 s": scripted("cut", 3.0),
    "its condition never came: the tracking error was never above 1e+09 m², at the most 0.": scripted(
        "cut", 0.0, when=NEVER
    ),
    "its condition never came: the tracking error was never below 1e-09 m², at the least 0.": scripted(
        "cut", 0.0, when={"tracking_error_below": 1e-9}
    ),
    "its condition never came: the tracking error was never above 0 m² for 60 s in a row": scripted(
        "cut", 0.0, when={"tracking_error_above": 0.0, "lasting": 60.0}
    ),
}


@pytest.mark.parametrize(
    ("says", "given"),
    [
        *((says, VACUOUS[name]) for name, says in WHY.items()),
        *((says, (entries, ())) for says, entries in NEVER_BEGAN.items()),
    ],
    ids=[*WHY, *(says[:40] for says in NEVER_BEGAN)],
)
def test_what_touches_nothing_says_why(says, given, flown):
    entries, over = given
    outcome = flown(*entries, over=over).outcome
    bite, (reason,) = outcome.faults[-1], outcome.reasons
    assert says in reason
    assert reason == f"'{bite.fault.describe()}' touched no {bite.what} and proved nothing: {bite.why}"
    assert str(bite).endswith(f" touched 0 {bite.what}: {bite.why}")
    assert outcome.to_json()["faults"][-1]["why"] == bite.why


# ---- conditions


@pytest.mark.parametrize("lasting", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("side", ["below", "above"])
def test_a_condition_that_held_long_enough_sets_off_what_waits_for_it(side, lasting, flown):
    error, need = flown().arrays["error"], max(1, round(lasting / DT))
    level = float(np.sort(error)[25])
    held = error < level if side == "below" else error > level
    fires = next(tick for tick in range(need, len(held)) if held[tick - need : tick].all())
    when = {f"tracking_error_{side}": level, "lasting": lasting}
    flight = flown(*scripted("gust", 0.1, when=when, lasts=0.1))
    (bite,) = flight.outcome.faults
    assert bite.at == pytest.approx((fires + 2) * DT)
    assert part(flown(), flight) == (fires + 3, "position", "agent 5")


# ---- ends


@pytest.mark.parametrize(
    ("verb", "reason", "agent"),
    [
        ("heal", Verdict.CUT, 4),
        ("restart", Verdict.DEAD, 5),
        ("resume", Verdict.PAUSED, 5),
        ("rejoin", Verdict.DEPARTED, 5),
    ],
)
def test_what_is_ended_holds_until_then_and_no_longer(verb, reason, agent, flown):
    held = (flown(*scripted(verb, 1.0)).verdicts_around(agent) == reason).any(axis=(1, 2))
    assert np.flatnonzero(held).tolist() == list(range(10, 20))


def test_a_heal_by_name_leaves_what_it_does_not_name(flown):
    cuts = [{"verb": "cut", "at": 0.5, "links": [f"{src}->4"], "name": f"from {src}"} for src in (1, 2)]
    healed = flown(*cuts, {"verb": "heal", "at": 1.0, "names": ["from 2"]})
    all_healed = flown(*cuts, {"verb": "heal", "at": 1.0})
    ends = [
        [(flight.verdicts(src, 4) == Verdict.CUT).any(axis=1).sum() for src in (1, 2)]
        for flight in (healed, all_healed)
    ]
    assert ends == [[30, 10], [10, 10]]


def test_a_heal_ends_a_fault_that_would_have_lasted_longer(flown):
    lose = {"verb": "lose", "at": 0.5, "lasts": 1.2, "links": ["2->4"], "loss": 1.0}
    flight = flown(lose, {"verb": "heal", "at": 1.0})
    assert np.flatnonzero((flight.verdicts(2, 4) == Verdict.SCRIPTED).all(axis=1)).tolist() == list(range(10, 20))


def test_a_clock_is_right_again_at_its_end(flown):
    plan = flown(*scripted("clock", 1.0)).plan
    readings = [plan.timeline.clock(tick)[0] - tick for tick in range(40)]
    assert readings == [0] * 20 + list(range(10)) + [0] * 10


def test_clocks_drift_together_and_never_before_the_start(flown):
    slow = {"verb": "clock", "at": 0.0, "agents": [1], "rate": -0.9}
    timeline = flown(slow, {**slow, "rate": -0.5}).plan.timeline
    assert [timeline.clock(tick)[0] for tick in (0, 1, 10, 39)] == [0, 0, 0, 0]
    timeline = flown(slow, {**slow, "rate": 1.9}).plan.timeline
    assert [timeline.clock(tick)[0] for tick in (0, 10, 20)] == [0, 20, 40]


# ---- processes that come back

DEAF = {"verb": "cut", "at": 0.5, "until": 1.5, "links": ["all->5"]}


@pytest.mark.parametrize(("state", "knows"), [("warm", True), ("cold", False)])
def test_an_agent_that_comes_back_warm_knows_what_it_knew(state, knows, flown):
    flight = flown(DEAF, *scripted("restart", 1.0, state=state))
    known = flight.arrays["known"][:, 4].any(axis=1)
    assert known[9]  # before it was killed
    assert not known[10:20].any()  # dead
    assert known[20:30].all() == known[20:30].any() == knows  # deaf
    assert known[30]  # it hears again


def test_an_agent_that_comes_back_warm_goes_on_from_its_last_state(flown):
    """Paused and deaf, it hears no more than dead; its memory is that of an agent that slept."""
    warm = flown(DEAF, *scripted("restart", 1.0, state="warm"))
    slept = flown(DEAF, *scripted("resume", 1.0))
    assert np.array_equal(warm.arrays["estimate"][20, 4], slept.arrays["estimate"][20, 4])
    assert warm.arrays["estimate"][20, 4].any()


def test_a_warm_restart_from_the_first_tick_knows_nothing_either(flown):
    deaf = {**DEAF, "at": 0.0}
    runs = [
        flown(deaf, {"verb": "kill", "at": 0.0, "agents": [5]}, {**entry, "verb": "restart", "at": 1.0, "agents": [5]})
        for entry in ({"state": "warm"}, {"state": "cold"})
    ]
    assert runs[0].outcome.digest == runs[1].outcome.digest
    assert not runs[0].arrays["known"][:30, 4].any()


# ---- bodies


def moved(flight, agent):
    """How far it goes in every tick, shape (T, D), in metres."""
    return np.diff(flight.arrays["position"][:, agent - 1], axis=0)


@pytest.mark.parametrize("body", ["hold", "vanish"])
def test_the_body_of_a_departed_agent_holds_where_it_was(body, flown):
    way = moved(flown(*scripted("depart", 1.0, body=body)), 5)
    assert way[19].any()
    assert not way[20:30].any()
    assert way[30].any()


def test_who_takes_the_place_of_a_departed_agent_knows_nothing(flown):
    away = {"verb": "depart", "at": 0.5, "agents": [5]}
    same, other = (flown(away, {"verb": verb, "at": 1.0, "agents": [5]}, over=RKF) for verb in ("rejoin", "replace"))
    known = [flight.arrays["known"][19:22, 4].any(axis=-1).tolist() for flight in (same, other)]
    assert known == [
        [True, True, True],
        [False, True, True],
    ]  # it keeps its filters; it has not been yet, and begins anew
    alone = flown(
        away,
        {"verb": "kill", "at": 0.95, "agents": [5]},
        {"verb": "restart", "at": 1.0, "agents": [5]},
        {"verb": "rejoin", "at": 1.0, "agents": [5]},
        over=RKF,
    )
    assert alone.outcome.digest == other.outcome.digest
    assert (same.arrays["covariance"][20, 4, 0, 0] < other.arrays["covariance"][20, 4, 0, 0]).all()


def test_a_body_that_vanishes_is_gone_until_its_agent_rejoins(flown):
    flight = flown(*scripted("depart", 1.0, body="vanish"))
    gone = [flight.plan.timeline.at(tick).vanished.tolist() for tick in (19, 20, 29, 30)]
    there, away = [False] * 7, [agent == 5 for agent in range(1, 8)]
    assert gone == [there, away, away, there]


@pytest.mark.parametrize("entry", [("depart", {"body": "drift"}), ("pause", {})], ids=["depart", "pause"])
def test_a_body_that_nobody_steers_flies_on_with_its_last_input(entry, flown):
    verb, more = entry
    flight = flown(*scripted(verb, 1.0, **more))
    velocity, way = flight.arrays["input"][:, 4], moved(flight, 5)
    assert velocity[19].any()
    assert (velocity[20:30] == velocity[19]).all()
    assert way[20:30] == pytest.approx(np.tile(DT * velocity[19], (10, 1)))
    assert (velocity[30] != velocity[29]).all()


def test_a_gust_carries_a_body_along_and_is_no_input(flown):
    calm, windy = flown(), flown(*scripted("gust", 1.0))
    assert moved(windy, 5)[20] - moved(calm, 5)[20] == pytest.approx([DT, 0.0])
    assert np.array_equal(calm.arrays["input"][20], windy.arrays["input"][20])
    others = [0, 1, 2, 3, 5, 6]
    assert np.array_equal(calm.arrays["position"][21, others], windy.arrays["position"][21, others])


def test_gusts_add_up(flown):
    east, north = scripted("gust", 1.0), scripted("gust", 1.0, velocity=[0.0, 2.0])
    assert moved(flown(*east, *north), 5)[20] - moved(flown(), 5)[20] == pytest.approx([DT, 2 * DT])


@pytest.mark.parametrize(("verb", "more"), [("depart", {"body": "drift"}), ("pause", {})])
def test_a_gust_carries_a_body_that_flies_on(verb, more, flown):
    flying = scripted(verb, 0.8, lasts=1.0, **more)
    blown = flown(*flying, *scripted("gust", 1.0))
    assert blown.outcome.verdict == "pass"
    assert moved(blown, 5)[20] - moved(flown(*flying), 5)[20] == pytest.approx([DT, 0.0])


def test_a_body_that_is_dead_and_drifts_holds(flown):
    flight = flown(*scripted("depart", 0.5, lasts=1.0, body="drift"), {"verb": "kill", "at": 1.0, "agents": [5]})
    way = moved(flight, 5)
    assert way[10:20].any(axis=1).all()
    assert not way[20:].any()


# ---- pauses


def test_a_paused_agent_neither_hears_nor_speaks_nor_estimates(flown):
    flight = flown(*scripted("pause", 1.0))
    asleep = slice(20, 30)
    assert not flight.arrays["known"][asleep, 4].any()
    assert np.isnan(flight.arrays["psi"][asleep, 4]).all()
    assert (flight.verdicts(5, 1)[asleep, 1:] == Verdict.SILENT).all()
    assert (flight.verdicts(5, 1)[asleep, 0] == Verdict.DELIVERED).all()  # it can be seen
    assert (flight.verdicts(1, 5)[asleep, 0] == Verdict.PAUSED).all()


@pytest.mark.parametrize(
    ("policy", "verdict", "arrive"), [("hold", Verdict.DELAYED, 4 * 3 * 10), ("drop", Verdict.PAUSED, 0)]
)
def test_what_is_sent_to_a_paused_agent_waits_or_is_dropped(policy, verdict, arrive, flown):
    flight = flown(*scripted("pause", 1.0, in_flight=policy))
    assert (flight.verdicts(1, 5)[20:30, 1:] == verdict).all()
    assert flight.arrays["late"].sum() == flight.arrays["late"][30] == arrive


@pytest.mark.parametrize(("policy", "dropped"), [("hold", 0), ("drop", 4 * 3 * 2)])
def test_what_is_under_way_to_a_paused_agent_waits_or_is_dropped(policy, dropped, flown):
    flight = flown(*scripted("pause", 1.0, in_flight=policy), over=LATE)
    assert flight.arrays["dropped"][:, Verdict.PAUSED].sum() == dropped


def test_an_agent_that_slept_knows_what_it_knew(flown):
    flight = flown(DEAF, *scripted("pause", 1.0, lasts=0.2))
    known = flight.arrays["known"][:, 4].all(axis=1)
    assert (known[19], known[20], known[24]) == (True, False, True)


# ---- sensors and liars


def of_link(flight, src, dst):
    """The estimate of a link, shape (T, D)."""
    slots = flight.plan.world.links.slots
    agent, slot = np.argwhere((slots == flight.links.index[src, dst]) & flight.links.present)[0]
    assert agent == dst - 1
    return flight.arrays["estimate"][:, agent, slot]


BARE = ('agents.estimator="none"', 'agents.law="static"')


def test_a_bias_is_added_to_what_is_measured(flown):
    true, biased = (of_link(flown(*entries, over=BARE), 2, 4) for entries in ([], scripted("bias", 1.0)))
    assert biased[20] - true[20] == pytest.approx([0.3, 0.0])
    twice = scripted("bias", 1.0) + scripted("bias", 1.0, by=[0.0, 1.0])
    assert of_link(flown(*twice, over=BARE), 2, 4)[20] - true[20] == pytest.approx([0.3, 1.0])


def test_a_frozen_sensor_repeats_what_it_said_last(flown):
    said = of_link(flown(*scripted("freeze", 1.0), over=BARE), 2, 4)
    assert (said[20:30] == said[19]).all()
    assert len(np.unique(said[[18, 19, 30, 31]], axis=0)) == 4


def test_a_sensor_that_was_off_when_it_froze_stays_off(flown):
    off = scripted("bias", 0.5, lasts=0.5)
    said = of_link(flown(*off, *scripted("freeze", 1.0), over=BARE), 2, 4)
    assert (said[20:30] == said[19]).all()
    assert said[19] - of_link(flown(*off, over=BARE), 2, 4)[19] == pytest.approx([0.0, 0.0])


def test_outliers_strike_at_their_rate_with_their_deviation(flown):
    struck = {"verb": "outlier", "at": 0.0, "links": ["all"], "p": 0.25, "sigma": 50.0}
    lazy = (*BARE, "agents.parameters.static.alpha=1e-9")  # where a body is does not depend on what its agent sees
    flight, calm = flown(struck, over=lazy), flown(over=lazy)
    astray = (flight.arrays["estimate"] - calm.arrays["estimate"])[flight.arrays["known"]]
    hit = (np.abs(astray) > 1e-4).any(axis=1)
    (bite,) = flight.outcome.faults
    assert bite.touched == hit.sum()
    assert hit.mean() == pytest.approx(0.25, abs=4 * np.sqrt(0.25 * 0.75 / len(hit)))
    assert astray[hit].std() == pytest.approx(50.0, rel=4 / np.sqrt(2 * 2 * hit.sum()))


def test_dropouts_strike_at_their_rate(flown):
    flight = flown({"verb": "dropout", "at": 0.0, "links": ["all"], "p": 0.25})
    (bite,) = flight.outcome.faults
    offers = 40 * 24
    assert bite.touched / offers == pytest.approx(0.25, abs=4 * np.sqrt(0.25 * 0.75 / offers))
    assert not (flight.arrays["verdicts"][:, 1:] == Verdict.DROPOUT).any()  # messages pass


def test_a_liar_believes_itself(flown):
    honest, lying = flown(), flown(*scripted("lie", 1.0))
    tick, agents = 20, [agent != 4 for agent in range(1, 8)]
    assert np.array_equal(honest.arrays["estimate"][tick, 3], lying.arrays["estimate"][tick, 3])
    assert (honest.arrays["psi"][tick] != lying.arrays["psi"][tick])[agents].any()


def test_two_lies_are_told_on_top_of_each_other(flown):
    honest, twice = flown(), flown(*scripted("lie", 1.0), *scripted("lie", 1.0))
    assert twice.outcome.verdict == "pass"
    assert np.array_equal(honest.arrays["position"], twice.arrays["position"])  # a mirror in a mirror


# ---- links


def test_delays_add_up_and_sensing_is_not_delayed(flown):
    flight = flown(*scripted("delay", 1.0), *scripted("delay", 1.0), over=LATE)
    row = flight.links.index[2, 4]
    newest = flight.arrays["newest"][:, :, row]
    assert newest[29, 0] == 29
    assert newest[19, 1] == 17
    assert (newest[20:22, 1].tolist(), newest[22:26, 1].tolist(), newest[26, 1]) == ([18, 19], [-1] * 4, 20)


@pytest.mark.parametrize("profile", ["wifi_busy", "slow"])
def test_a_degraded_link_has_the_profile_in_place_of_its_own(profile, flown):
    """Ruled by a profile from the first tick on, a link does what it does where the profile is its own."""
    own = flown(over=(f'network.profile="{profile}"',))
    lent = flown({"verb": "degrade", "at": 0.0, "links": ["all"], "profile": profile})
    assert lent.outcome.verdict == "pass"
    assert lent.outcome.digest == own.outcome.digest != flown().outcome.digest


def test_of_two_profiles_the_one_named_last_rules(flown):
    first, second = ({"verb": "degrade", "at": 0.5, "links": ["2->4"], "profile": name} for name in ("jammed", "slow"))
    flight = flown(first, second)
    verdicts = flight.verdicts(2, 4)[10:]
    assert (verdicts[:, 1] == Verdict.DELAYED).all()
    assert not (verdicts[:, 0] > Verdict.DELIVERED).any()
