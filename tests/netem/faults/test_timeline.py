"""Scripted faults: what holds in which tick; faults add up, and the end of one heals no other."""

import tracemalloc
from dataclasses import fields, replace

import numpy as np
import pytest

from netem.core.links import Links
from netem.faults.conditions import Conditions
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger

LINKS = Links.both_ways(4, [(1, 2), (2, 3), (3, 4), (4, 1)])


def held(mask):
    return {(int(src), int(dst)) for src, dst in zip(LINKS.src[mask], LINKS.dst[mask], strict=True)}


OF_LINKS = (
    *("cut", "partitioned", "cut_drops", "partition_drops", "pause_drops", "holds", "loss", "dropout", "delay_s"),
    *("profile", "frozen", "outlier", "deviation"),
)
OF_AGENTS = ("dead", "paused", "departed", "drifting", "vanished", "absent", "idle", "still", "coasting")


def test_without_faults_nothing_is_held():
    now = Timeline(LINKS, []).at(1000)
    assert {getattr(now, layer).shape for layer in OF_LINKS} == {(8,)}
    assert {getattr(now, layer).shape for layer in OF_AGENTS} == {(4,)}
    assert (now.bias.shape, now.push.shape, now.liars) == ((8, 1), (4, 1), ())
    assert not any(getattr(now, layer).any() for layer in (*OF_LINKS, *OF_AGENTS, "bias", "push"))


def test_every_condition_is_one_of_links_or_of_agents():
    derived = {"absent", "idle", "still", "coasting"}
    assert {*OF_LINKS, *OF_AGENTS, "bias", "push", "acting"} == {f.name for f in fields(Conditions)} | derived


WHAT_IT_IMPOSES = [
    (Fault(Verb.CUT, 3, 6, pairs=((1, 2),)), {"cut", "cut_drops"}),
    (Fault(Verb.CUT, 3, 6, pairs=((1, 2),), under_way=UnderWay.DELIVER), {"cut"}),
    (Fault(Verb.CUT, 3, 6, pairs=((1, 2),), under_way=UnderWay.HOLD), {"cut", "holds"}),
    (Fault(Verb.PARTITION, 3, 6, groups=((1,), (2,))), {"partitioned", "partition_drops"}),
    (Fault(Verb.PARTITION, 3, 6, groups=((1,), (2,)), under_way=UnderWay.HOLD), {"partitioned", "holds"}),
    (Fault(Verb.LOSE, 3, 6, pairs=((1, 2),), probability=0.5), {"loss"}),
    (Fault(Verb.DELAY, 3, 6, pairs=((1, 2),), seconds=0.5), {"delay_s"}),
    (Fault(Verb.DEGRADE, 3, 6, pairs=((1, 2),), profile=2), {"profile"}),
    (Fault(Verb.KILL, 3, 6, agents=(1,)), {"dead", "absent", "idle", "still"}),
    (Fault(Verb.PAUSE, 3, 6, agents=(1,)), {"paused", "idle", "coasting", "pause_drops"}),
    (Fault(Verb.PAUSE, 3, 6, agents=(1,), under_way=UnderWay.HOLD), {"paused", "idle", "coasting", "holds"}),
    (Fault(Verb.CLOCK, 3, 6, agents=(1,), rate=0.5), set()),
    (Fault(Verb.DEPART, 3, 6, agents=(1,)), {"departed", "absent", "still"}),
    (Fault(Verb.DEPART, 3, 6, agents=(1,), body=DepartedBody.DRIFT), {"departed", "absent", "drifting", "coasting"}),
    (Fault(Verb.DEPART, 3, 6, agents=(1,), body=DepartedBody.VANISH), {"departed", "absent", "vanished", "still"}),
    (Fault(Verb.GUST, 3, 6, agents=(1,), vector=(1.0, 0.0)), {"push"}),
    (Fault(Verb.BIAS, 3, 6, pairs=((1, 2),), vector=(1.0, 0.0)), {"bias"}),
    (Fault(Verb.OUTLIER, 3, 6, pairs=((1, 2),), probability=0.5, deviation=2.0), {"outlier", "deviation"}),
    (Fault(Verb.DROPOUT, 3, 6, pairs=((1, 2),), probability=0.5), {"dropout"}),
    (Fault(Verb.FREEZE, 3, 6, pairs=((1, 2),)), {"frozen"}),
    (Fault(Verb.LIE, 3, 6, agents=(1,), matrix=((2.0, 0.0), (0.0, 2.0))), {"liars"}),
]
OF_EVERY_VERB = pytest.mark.parametrize(
    ("fault", "layers"), WHAT_IT_IMPOSES, ids=[f"{f.verb}, {f.under_way}, {f.body}" for f, _ in WHAT_IT_IMPOSES]
)


def imposed(now):
    """The layers in which something holds."""
    layers = {layer for layer in (*OF_LINKS, *OF_AGENTS, "bias", "push") if getattr(now, layer).any()}
    return layers | ({"liars"} if now.liars else set())


def test_there_is_a_fault_of_every_verb():
    assert {fault.verb for fault, _ in WHAT_IT_IMPOSES} == set(Verb)


@OF_EVERY_VERB
def test_a_fault_imposes_its_own_and_no_other_from_its_start_until_before_its_end(fault, layers):
    timeline = Timeline(LINKS, [fault])
    assert [imposed(timeline.at(tick)) for tick in range(2, 8)] == [set(), layers, layers, layers, set(), set()]


@OF_EVERY_VERB
def test_a_fault_takes_hold_of_what_it_names_alone(fault, layers):
    now, touched = Timeline(LINKS, [fault]).at(3), {(4, 1), (2, 1)} if fault.verb is Verb.PAUSE else {(1, 2)}
    touched |= {(2, 1)} if fault.verb is Verb.PARTITION else set()
    for layer in layers - {"liars"}:
        value = getattr(now, layer)
        nonzero = value.any(axis=1) if value.ndim == 2 else value.astype(bool)
        if layer in (*OF_AGENTS, "push"):
            assert nonzero.tolist() == [True, False, False, False]
        else:
            assert held(nonzero) == touched


def test_a_fault_holds_from_its_start_until_before_its_end():
    timeline = Timeline(LINKS, [Fault(Verb.CUT, 3, 6, pairs=((1, 2),))])
    assert [tick for tick in range(10) if timeline.at(tick).cut.any()] == [3, 4, 5]


def test_a_fault_without_end_holds_for_good():
    timeline = Timeline(LINKS, [Fault(Verb.KILL, 3, None, agents=(2,))])
    assert not timeline.at(2).dead.any()
    assert timeline.at(3).dead.tolist() == timeline.at(10**9).dead.tolist() == [False, True, False, False]


def test_a_fault_may_hold_from_the_first_tick():
    assert held(Timeline(LINKS, [Fault(Verb.CUT, 0, 1, pairs=((1, 2),))]).at(0).cut) == {(1, 2)}


def test_a_cut_one_way_leaves_the_way_back():
    assert held(Timeline(LINKS, [Fault(Verb.CUT, 0, None, pairs=((1, 2),))]).at(0).cut) == {(1, 2)}


def test_a_cut_both_ways_takes_both_links():
    both = Fault(Verb.CUT, 0, None, pairs=((1, 2), (2, 1)))
    assert held(Timeline(LINKS, [both]).at(0).cut) == {(1, 2), (2, 1)}


def test_a_partition_holds_what_crosses_between_its_groups():
    split = Fault(Verb.PARTITION, 0, None, groups=((1, 2), (3, 4)))
    now = Timeline(LINKS, [split]).at(0)
    assert held(now.partitioned) == {(2, 3), (3, 2), (4, 1), (1, 4)}
    assert not now.cut.any()


def test_dead_and_departed_agents_are_absent():
    faults = [Fault(Verb.KILL, 0, None, agents=(1,)), Fault(Verb.DEPART, 0, None, agents=(3, 4))]
    now = Timeline(LINKS, faults).at(0)
    assert now.dead.tolist() == [True, False, False, False]
    assert now.departed.tolist() == [False, False, True, True]
    assert now.absent.tolist() == [True, False, True, True]


@pytest.mark.parametrize(
    ("verb", "what", "layer"),
    [
        (Verb.CUT, {"pairs": ((1, 2),)}, "cut"),
        (Verb.CUT, {"pairs": ((1, 2),)}, "cut_drops"),
        (Verb.PARTITION, {"groups": ((1,), (2,)), "under_way": UnderWay.HOLD}, "holds"),
        (Verb.LOSE, {"pairs": ((1, 2),), "probability": 0.5}, "loss"),
        (Verb.PARTITION, {"groups": ((1,), (2,))}, "partitioned"),
        (Verb.KILL, {"agents": (1,)}, "dead"),
        (Verb.DEPART, {"agents": (1,)}, "departed"),
    ],
)
def test_the_end_of_one_fault_does_not_heal_another(verb, what, layer):
    timeline = Timeline(LINKS, [Fault(verb, 2, 6, **what), Fault(verb, 4, 9, **what)])
    assert [tick for tick in range(12) if getattr(timeline.at(tick), layer).any()] == [2, 3, 4, 5, 6, 7, 8]


def test_a_fault_inside_another_leaves_it_when_it_ends():
    link = {"pairs": ((1, 2),)}
    timeline = Timeline(LINKS, [Fault(Verb.CUT, 0, None, **link), Fault(Verb.CUT, 3, 5, **link)])
    assert all(timeline.at(tick).cut.any() for tick in range(20))


def test_faults_of_different_kinds_do_not_touch_each_other():
    faults = [
        Fault(Verb.CUT, 0, 9, pairs=((1, 2),)),
        Fault(Verb.PARTITION, 0, 5, groups=((1,), (2,))),
        Fault(Verb.KILL, 0, 3, agents=(1,)),
    ]
    now = Timeline(LINKS, faults).at(6)
    assert held(now.cut) == {(1, 2)}
    assert not now.partitioned.any()
    assert not now.dead.any()


@pytest.mark.parametrize(
    ("under_way", "drops", "holds"),
    [
        (UnderWay.DROP, {(1, 2)}, set()),
        (UnderWay.DELIVER, set(), set()),
        (UnderWay.HOLD, set(), {(1, 2)}),
    ],
)
def test_a_cut_drops_delivers_or_holds_what_is_under_way(under_way, drops, holds):
    now = Timeline(LINKS, [Fault(Verb.CUT, 0, None, pairs=((1, 2),), under_way=under_way)]).at(0)
    assert (held(now.cut), held(now.cut_drops), held(now.holds)) == ({(1, 2)}, drops, holds)


def test_what_is_under_way_on_the_links_of_a_partition_is_dropped_unless_it_says_otherwise():
    now = Timeline(LINKS, [Fault(Verb.PARTITION, 0, None, groups=((1, 2), (3, 4)))]).at(0)
    assert held(now.partition_drops) == held(now.partitioned) == {(2, 3), (3, 2), (4, 1), (1, 4)}


@pytest.mark.parametrize(
    "fault",
    [
        Fault(Verb.KILL, 0, None, agents=(1,)),
        Fault(Verb.DEPART, 0, None, agents=(1,)),
        Fault(Verb.LOSE, 0, None, pairs=((1, 2),), probability=1.0),
    ],
    ids=lambda fault: fault.verb,
)
def test_only_cuts_and_partitions_say_what_becomes_of_what_is_under_way_on_links(fault):
    now = Timeline(LINKS, [fault]).at(0)
    assert not (now.cut_drops | now.partition_drops).any()
    assert not now.holds.any()


def test_scripted_losses_of_a_link_are_independent_of_each_other():
    faults = [
        Fault(Verb.LOSE, 0, 5, pairs=((1, 2), (2, 3)), probability=0.5),
        Fault(Verb.LOSE, 3, 9, pairs=((1, 2),), probability=0.2),
    ]
    timeline, row = Timeline(LINKS, faults), LINKS.index[1, 2]
    assert [float(timeline.at(tick).loss[row]) for tick in (2, 3, 5, 9)] == pytest.approx([0.5, 0.6, 0.2, 0.0])
    assert held(timeline.at(3).loss > 0.0) == {(1, 2), (2, 3)}


def on(layer, pair=(1, 2)):
    return lambda now: getattr(now, layer)[LINKS.index[pair]].tolist()


def course(faults, value, ticks):
    """A value of the conditions, tick by tick."""
    timeline = Timeline(LINKS, faults)
    return [value(timeline.at(tick)) for tick in range(ticks)]


def overlapping(first, **other):
    """A fault in ticks 1 to 4, and the same with another value in ticks 3 to 6."""
    return [replace(first, start=1, end=5), replace(first, start=3, end=7, **other)]


@pytest.mark.parametrize(
    ("faults", "value", "expected"),
    [
        (
            overlapping(Fault(Verb.DROPOUT, 0, 0, pairs=((1, 2),), probability=0.5), probability=0.2),
            on("dropout"),
            [0.0, 0.5, 0.5, 0.6, 0.6, 0.2, 0.2, 0.0],
        ),
        (
            overlapping(Fault(Verb.OUTLIER, 0, 0, pairs=((1, 2),), probability=0.5), probability=0.2),
            on("outlier"),
            [0.0, 0.5, 0.5, 0.6, 0.6, 0.2, 0.2, 0.0],
        ),
        (
            overlapping(Fault(Verb.OUTLIER, 0, 0, pairs=((1, 2),), deviation=3.0), deviation=2.0),
            on("deviation"),
            [0.0, 3.0, 3.0, 3.0, 3.0, 2.0, 2.0, 0.0],
        ),
        (
            overlapping(Fault(Verb.DELAY, 0, 0, pairs=((1, 2),), seconds=0.5), seconds=0.25),
            on("delay_s"),
            [0.0, 0.5, 0.5, 0.75, 0.75, 0.25, 0.25, 0.0],
        ),
        (
            overlapping(Fault(Verb.DEGRADE, 0, 0, pairs=((1, 2),), profile=1), profile=2),
            on("profile"),
            [0, 1, 1, 2, 2, 2, 2, 0],
        ),
        (
            overlapping(Fault(Verb.DEGRADE, 0, 0, pairs=((1, 2),), profile=2), profile=1),
            on("profile"),
            [0, 2, 2, 2, 2, 1, 1, 0],
        ),
        (
            overlapping(Fault(Verb.BIAS, 0, 0, pairs=((1, 2),), vector=(1.0, 0.0)), vector=(0.5, -2.0)),
            lambda now: np.broadcast_to(now.bias, (8, 2))[LINKS.index[1, 2]].sum(),
            [0.0, 1.0, 1.0, -0.5, -0.5, -1.5, -1.5, 0.0],
        ),
        (
            overlapping(Fault(Verb.GUST, 0, 0, agents=(3,), vector=(1.0, 0.0)), vector=(0.5, -2.0)),
            lambda now: np.broadcast_to(now.push, (4, 2))[2].sum(),
            [0.0, 1.0, 1.0, -0.5, -0.5, -1.5, -1.5, 0.0],
        ),
        (
            overlapping(Fault(Verb.FREEZE, 0, 0, pairs=((1, 2),))),
            on("frozen"),
            [False, *[True] * 6, False],
        ),
        (
            overlapping(Fault(Verb.PAUSE, 0, 0, agents=(3,))),
            lambda now: now.paused.tolist() == [False, False, True, False],
            [False, *[True] * 6, False],
        ),
        (
            overlapping(Fault(Verb.LIE, 0, 0, agents=(3,), matrix=((1.0,),)), matrix=((2.0,),)),
            lambda now: [fault.matrix[0][0] for fault in now.liars],
            [[], [1.0], [1.0], [1.0, 2.0], [1.0, 2.0], [2.0], [2.0], []],
        ),
        (
            overlapping(Fault(Verb.DEPART, 0, 0, agents=(3,)), body=DepartedBody.DRIFT),
            lambda now: (bool(now.still[2]), bool(now.coasting[2])),
            [(False, False), *[(True, False)] * 2, *[(False, True)] * 4, (False, False)],
        ),
    ],
    ids=lambda value: value[0].verb if isinstance(value, list) and isinstance(value[0], Fault) else "",
)
def test_faults_that_overlap_combine_and_the_end_of_one_leaves_the_other(faults, value, expected):
    found = course(faults, value, 8)
    assert found == (pytest.approx(expected) if isinstance(expected[0], float) else expected)


def test_biases_and_gusts_point_where_they_are_told():
    faults = [
        Fault(Verb.BIAS, 0, None, pairs=((1, 2),), vector=(1.0, -2.0, 3.0)),
        Fault(Verb.GUST, 0, None, agents=(2, 4), vector=(0.5, 0.0, -1.0)),
    ]
    now = Timeline(LINKS, faults).at(0)
    assert now.bias[LINKS.index[1, 2]].tolist() == [1.0, -2.0, 3.0]
    assert now.push.tolist() == [[0, 0, 0], [0.5, 0, -1], [0, 0, 0], [0.5, 0, -1]]


def test_a_dead_agent_is_not_paused_and_a_departed_one_that_is_paused_holds():
    pause = Fault(Verb.PAUSE, 0, None, agents=(1, 2, 3, 4))
    faults = [pause, Fault(Verb.KILL, 0, None, agents=(1,)), Fault(Verb.DEPART, 0, None, agents=(2,))]
    now = Timeline(LINKS, [*faults, Fault(Verb.DEPART, 0, None, agents=(3,), body=DepartedBody.DRIFT)]).at(0)
    assert now.paused.tolist() == [False, True, True, True]
    assert now.idle.tolist() == [True, True, True, True]
    assert now.still.tolist() == [True, True, False, False]
    assert now.coasting.tolist() == [False, False, True, True]


def test_a_dead_body_holds_even_where_it_drifted():
    faults = [Fault(Verb.KILL, 0, None, agents=(1,)), Fault(Verb.DEPART, 0, None, agents=(1,), body=DepartedBody.DRIFT)]
    now = Timeline(LINKS, faults).at(0)
    assert (now.still[0], now.coasting[0]) == (True, False)


def test_what_is_sent_to_a_paused_agent_is_held_or_dropped_and_what_it_sends_is_not():
    faults = [Fault(Verb.PAUSE, 0, None, agents=(1,), under_way=UnderWay.HOLD), Fault(Verb.PAUSE, 0, None, agents=(3,))]
    now = Timeline(LINKS, faults).at(0)
    assert held(now.holds) == {(2, 1), (4, 1)}
    assert held(now.pause_drops) == {(2, 3), (4, 3)}


def test_the_conditions_are_the_union_of_the_faults_that_hold():
    rng = np.random.default_rng(1)
    pairs = list(LINKS.index)
    faults = [
        Fault(Verb.CUT, int(start), int(start + length), pairs=(pairs[row],))
        for start, length, row in zip(
            rng.integers(0, 30, 20), rng.integers(1, 10, 20), rng.integers(0, 8, 20), strict=True
        )
    ]
    timeline = Timeline(LINKS, faults)
    for tick in range(45):
        assert held(timeline.at(tick).cut) == {fault.pairs[0] for fault in faults if fault.active(tick)}


def test_conditions_are_the_same_object_for_as_long_as_nothing_changes():
    timeline = Timeline(LINKS, [Fault(Verb.CUT, 3, 6, pairs=((1, 2),))])
    assert timeline.at(0) is timeline.at(2)
    assert timeline.at(3) is timeline.at(5)
    assert timeline.at(2) is not timeline.at(3)


def test_an_agent_dies_at_its_kill_and_is_fresh_at_its_restart():
    timeline = Timeline(LINKS, [Fault(Verb.KILL, 3, 6, agents=(2, 4))])
    assert {tick: timeline.killed(tick) for tick in range(8) if timeline.killed(tick)} == {3: [2, 4]}
    assert {tick: timeline.restarted(tick) for tick in range(8) if timeline.restarted(tick)} == {6: [2, 4]}


def test_an_agent_may_be_dead_from_the_first_tick():
    assert Timeline(LINKS, [Fault(Verb.KILL, 0, 2, agents=(1,))]).killed(0) == [1]


def test_a_dead_agent_is_not_killed_again_and_stays_dead_until_the_last_kill_ends():
    faults = [Fault(Verb.KILL, 2, 6, agents=(1,)), Fault(Verb.KILL, 4, 9, agents=(1,))]
    timeline = Timeline(LINKS, faults)
    assert [tick for tick in range(12) if timeline.killed(tick)] == [2]
    assert [tick for tick in range(12) if timeline.restarted(tick)] == [9]


def steps(timeline, what, ticks=15):
    """What a timeline says of every tick, where it says anything."""
    return {tick: said for tick in range(ticks) if (said := getattr(timeline, what)(tick))}


def test_an_agent_is_stopped_at_its_pause_and_goes_on_at_its_end():
    timeline = Timeline(LINKS, [Fault(Verb.PAUSE, 3, 6, agents=(2, 4))])
    assert (steps(timeline, "paused"), steps(timeline, "resumed")) == ({3: [2, 4]}, {6: [2, 4]})


def test_an_agent_may_be_paused_from_the_first_tick():
    timeline = Timeline(LINKS, [Fault(Verb.PAUSE, 0, 2, agents=(1,))])
    assert (steps(timeline, "paused"), steps(timeline, "resumed")) == ({0: [1]}, {2: [1]})


def test_a_paused_agent_is_not_paused_again_and_rests_until_the_last_pause_ends():
    faults = [Fault(Verb.PAUSE, 2, 6, agents=(1,)), Fault(Verb.PAUSE, 4, 9, agents=(1,))]
    timeline = Timeline(LINKS, faults)
    assert (steps(timeline, "paused"), steps(timeline, "resumed")) == ({2: [1]}, {9: [1]})


def test_an_agent_that_dies_while_it_is_paused_is_not_resumed_and_one_that_comes_back_meanwhile_is_paused():
    pause, kill = Fault(Verb.PAUSE, 2, 12, agents=(1,)), Fault(Verb.KILL, 4, 6, agents=(1,))
    timeline = Timeline(LINKS, [pause, kill])
    assert (steps(timeline, "killed"), steps(timeline, "restarted")) == ({4: [1]}, {6: [1]})
    assert (steps(timeline, "paused"), steps(timeline, "resumed")) == ({2: [1], 6: [1]}, {12: [1]})


def test_an_agent_whose_pause_and_death_end_together_is_restarted_and_not_resumed():
    faults = [Fault(Verb.PAUSE, 2, 6, agents=(1,)), Fault(Verb.KILL, 4, 6, agents=(1,))]
    timeline = Timeline(LINKS, faults)
    assert (steps(timeline, "restarted"), steps(timeline, "resumed")) == ({6: [1]}, {})


def test_only_agents_that_come_back_warm_remember():
    faults = [Fault(Verb.KILL, 3, 6, agents=(2,), warm=True), Fault(Verb.KILL, 3, 6, agents=(4,))]
    timeline = Timeline(LINKS, [*faults, Fault(Verb.KILL, 8, 9, agents=(2,))])
    assert steps(timeline, "restarted") == {6: [2, 4], 9: [2]}
    assert steps(timeline, "remembering") == {6: [2]}
    assert timeline.warm == {2}


def test_an_agent_that_is_still_dead_when_a_warm_kill_ends_remembers_nothing_then():
    faults = [Fault(Verb.KILL, 2, 6, agents=(1,), warm=True), Fault(Verb.KILL, 4, 9, agents=(1,))]
    assert steps(Timeline(LINKS, faults), "remembering") == {}


# ---- clocks


def test_clocks_are_right_without_faults():
    timeline = Timeline(LINKS, [])
    assert all(timeline.clock(tick).tolist() == [tick] * 4 for tick in (0, 1, 77))


@pytest.mark.parametrize(
    ("rate", "reads"),
    [(1.0, [0, 1, 2, 4, 6, 8, 6]), (0.5, [0, 1, 2, 3, 5, 6, 6]), (-0.5, [0, 1, 2, 2, 3, 3, 6])],
)
def test_a_clock_gains_its_rate_from_its_start_and_is_right_again_at_its_end(rate, reads):
    timeline = Timeline(LINKS, [Fault(Verb.CLOCK, 2, 6, agents=(3,), rate=rate)])
    clocks = np.array([timeline.clock(tick) for tick in range(7)])
    assert clocks[:, 2].tolist() == reads
    assert (np.delete(clocks, 2, axis=1) == np.arange(7)[:, None]).all()


def test_clocks_that_gain_twice_gain_both_rates():
    faults = [Fault(Verb.CLOCK, 2, None, agents=(3, 4), rate=1.0), Fault(Verb.CLOCK, 4, None, agents=(3,), rate=2.0)]
    timeline = Timeline(LINKS, faults)
    assert timeline.clock(6).tolist() == [6, 6, 6 + 4 + 4, 6 + 4]


def test_no_clock_reads_less_than_nothing():
    faults = [Fault(Verb.CLOCK, 0, None, agents=(3,), rate=-0.9)] * 2
    timeline = Timeline(LINKS, faults)
    assert timeline.clock(5).tolist() == [5, 5, 0, 5]


# ---- triggers


@pytest.mark.parametrize(
    ("trigger", "errors", "fires"),
    [
        (Trigger(2.0, above=True, ticks=1), [3.0], True),
        (Trigger(2.0, above=True, ticks=1), [2.0], False),
        (Trigger(2.0, above=True, ticks=1), [3.0, 1.0], False),
        (Trigger(2.0, above=True, ticks=1), [1.0, 3.0], True),
        (Trigger(2.0, above=False, ticks=1), [1.0], True),
        (Trigger(2.0, above=False, ticks=1), [2.0], False),
        (Trigger(2.0, above=False, ticks=1), [3.0], False),
        (Trigger(2.0, above=True, ticks=3), [3.0, 3.0], False),
        (Trigger(2.0, above=True, ticks=3), [3.0, 3.0, 3.0], True),
        (Trigger(2.0, above=True, ticks=3), [3.0, 3.0, 1.0, 3.0, 3.0], False),
        (Trigger(2.0, above=True, ticks=3), [1.0, 3.0, 3.0, 3.0], True),
        (Trigger(2.0, above=False, ticks=2), [9.0, 1.0, 1.0], True),
        (Trigger(2.0, above=True, ticks=1), [], False),
        (Trigger(2.0, above=True, ticks=1), [np.nan], False),
        (Trigger(2.0, above=False, ticks=1), [np.nan], False),
        (Trigger(2.0, above=False, ticks=2), [1.0, np.nan, 1.0], False),
        (Trigger(2.0, above=True, ticks=1), [np.inf], True),
    ],
)
def test_a_trigger_fires_when_the_error_was_beyond_its_level_for_its_ticks_in_a_row(trigger, errors, fires):
    assert trigger.fires(np.array(errors)) is fires


TRIGGERS = [Trigger(2.0, above=True, ticks=1), Trigger(0.5, above=False, ticks=2), Trigger(1.0, above=True, ticks=1)]
WAITING = [
    Fault(Verb.CUT, 0, 3, trigger=0, pairs=((1, 2),)),
    Fault(Verb.KILL, 2, None, trigger=0, agents=(3,)),
    Fault(Verb.DEPART, 1, 4, trigger=1, agents=(4,)),
    Fault(Verb.CUT, 5, 6, pairs=((3, 4),)),
]


@OF_EVERY_VERB
def test_a_fault_that_waits_is_not_active_and_imposes_nothing(fault, layers):
    waiting = replace(fault, trigger=0)
    timeline = Timeline(LINKS, [waiting], TRIGGERS)
    assert imposed(timeline.fired([0], 0).at(3)) == layers
    for tick in range(8):
        assert not waiting.active(tick)
        assert imposed(timeline.at(tick)) == set()
        assert timeline.starting(tick) == timeline.ending(tick) == []
        assert (
            timeline.killed(tick) == timeline.paused(tick) == timeline.restarted(tick) == timeline.resumed(tick) == []
        )
        assert timeline.clock(tick).tolist() == [tick] * 4


def test_triggers_wait_while_they_hold_a_fault_back():
    timeline = Timeline(LINKS, WAITING, TRIGGERS)
    assert timeline.pending == (0, 1)
    assert timeline.fired([0], 7).pending == (1,)
    assert timeline.fired([0], 7).fired([1], 9).pending == ()


def test_triggers_that_are_due_are_those_that_fire_and_have_not_fired():
    timeline = Timeline(LINKS, WAITING, TRIGGERS)
    assert timeline.due(np.array([3.0])) == [0]
    assert timeline.due(np.array([0.1, 0.1])) == [1]
    assert timeline.due(np.array([1.0, 1.0])) == []
    assert timeline.fired([0], 1).due(np.array([3.0])) == []


def test_the_times_of_a_fault_count_from_the_tick_in_which_its_trigger_fires():
    timeline = Timeline(LINKS, WAITING, TRIGGERS).fired([0], 7)
    assert [tick for tick in range(15) if timeline.at(tick).cut[LINKS.index[1, 2]]] == [7, 8, 9]
    assert [tick for tick in range(15) if timeline.at(tick).cut[LINKS.index[3, 4]]] == [5]
    assert steps(timeline, "killed") == {9: [3]}
    assert not any(timeline.at(tick).departed.any() for tick in range(15))
    assert timeline.starting(7) == [replace(WAITING[0], trigger=None, start=7, end=10)]


def test_triggers_may_fire_together():
    timeline = Timeline(LINKS, WAITING, TRIGGERS).fired([0, 1], 7)
    assert [(fault.trigger, fault.start, fault.end) for fault in timeline.faults] == [
        (None, 7, 10),
        (None, 9, None),
        (None, 8, 11),
        (None, 5, 6),
    ]


def test_a_timeline_that_waits_faces_what_is_injected_and_still_waits():
    injected = Fault(Verb.CUT, 2, 4, pairs=((2, 3),))
    timeline = Timeline(LINKS, WAITING, TRIGGERS).facing([injected])
    assert timeline.faults == (*WAITING, injected)
    assert timeline.facing([]).faults == tuple(WAITING)
    assert timeline.fired([0], 7).injected == (injected,)
    assert timeline.pending == (0, 1)
    assert timeline.due(np.array([3.0])) == [0]


def test_a_departure_kills_no_process():
    timeline = Timeline(LINKS, [Fault(Verb.DEPART, 2, 5, agents=(1,))])
    assert timeline.killed(2) == timeline.restarted(5) == []


def test_faults_are_announced_in_their_first_tick_and_after_their_last():
    fault = Fault(Verb.CUT, 3, 6, pairs=((1, 2),))
    timeline = Timeline(LINKS, [fault, Fault(Verb.DEPART, 4, None, agents=(1,))])
    assert [tick for tick in range(10) if fault in timeline.starting(tick)] == [3]
    assert [tick for tick in range(10) if timeline.ending(tick)] == [6]


def test_a_fault_holds_its_links_and_all_links_of_its_agents():
    faults = [Fault(Verb.CUT, 0, 1, pairs=((1, 2),)), Fault(Verb.KILL, 0, 1, agents=(3,))]
    timeline = Timeline(LINKS, faults)
    assert held(timeline.held(0)) == {(1, 2)}
    assert held(timeline.held(1)) == {(3, 2), (2, 3), (3, 4), (4, 3)}


@pytest.mark.parametrize(
    ("fault", "says", "says_at_its_end"),
    [
        (Fault(Verb.CUT, 0, 1, pairs=((1, 2), (2, 1))), "cut 1->2, 2->1", "heal: cut 1->2, 2->1"),
        (Fault(Verb.LOSE, 0, 1, pairs=((1, 2),), probability=0.25), "lose 0.25 on 1->2", "heal: lose 0.25 on 1->2"),
        (Fault(Verb.PARTITION, 0, 1, groups=((1, 2), (3,))), "partition 1,2 | 3", "heal: partition 1,2 | 3"),
        (Fault(Verb.KILL, 0, 1, agents=(4,)), "kill 4", "restart 4"),
        (Fault(Verb.KILL, 0, 1, agents=(4,), warm=True), "kill 4", "restart 4 warm"),
        (Fault(Verb.DEPART, 0, 1, agents=(1, 2)), "depart 1,2", "rejoin 1,2"),
        (Fault(Verb.DEPART, 0, 1, agents=(1,), body=DepartedBody.DRIFT), "depart 1, bodies drift", "rejoin 1"),
        (Fault(Verb.PAUSE, 0, 1, agents=(1, 3)), "pause 1,3", "resume 1,3"),
        (Fault(Verb.DELAY, 0, 1, pairs=((1, 2),), seconds=0.3), "delay 0.3 s on 1->2", "heal: delay 0.3 s on 1->2"),
        (
            Fault(Verb.DEGRADE, 0, 1, pairs=((1, 2),), profile=2, profile_name="lora"),
            "degrade to 'lora' on 1->2",
            "heal: degrade to 'lora' on 1->2",
        ),
        (Fault(Verb.CLOCK, 0, 1, agents=(1,), rate=0.5), "clock +0.5 s/s of 1", "heal: clock +0.5 s/s of 1"),
        (
            Fault(Verb.GUST, 0, 1, agents=(1,), vector=(1.0, -0.5)),
            "gust (1, -0.5) m/s on 1",
            "heal: gust (1, -0.5) m/s on 1",
        ),
        (
            Fault(Verb.BIAS, 0, 1, pairs=((1, 2),), vector=(1.0, 0.0)),
            "bias (1, 0) m on 1->2",
            "heal: bias (1, 0) m on 1->2",
        ),
        (
            Fault(Verb.OUTLIER, 0, 1, pairs=((1, 2),), probability=0.1, deviation=5.0),
            "outlier 0.1 of 5 m on 1->2",
            "heal: outlier 0.1 of 5 m on 1->2",
        ),
        (
            Fault(Verb.DROPOUT, 0, 1, pairs=((1, 2),), probability=0.25),
            "dropout 0.25 on 1->2",
            "heal: dropout 0.25 on 1->2",
        ),
        (Fault(Verb.FREEZE, 0, 1, pairs=((1, 2),)), "freeze 1->2", "heal: freeze 1->2"),
        (Fault(Verb.LIE, 0, 1, agents=(1,)), "lie 1", "heal: lie 1"),
    ],
)
def test_a_fault_says_what_it_does(fault, says, says_at_its_end):
    assert (fault.describe(), fault.describe_end()) == (says, says_at_its_end)


def test_a_fault_of_many_links_names_the_first_and_counts_the_rest():
    pairs = tuple((1, agent) for agent in range(2, 22))
    assert Fault(Verb.CUT, 0, 1, pairs=pairs).describe().endswith("1->13 and 8 more")


@pytest.mark.parametrize(
    ("fault", "match"),
    [
        (Fault(Verb.CUT, 0, None, pairs=((1, 2), (1, 3))), "link 1->3 is not in the nominal graph"),
        (Fault(Verb.LOSE, 0, None, pairs=((1, 3),), probability=0.5), "link 1->3 is not in the nominal graph"),
        (Fault(Verb.PARTITION, 0, None, groups=((1,), (5,))), "agent 5 does not exist: agents are 1 to 4"),
        (Fault(Verb.PARTITION, 0, None, groups=((1, 2), (2,))), "agent 2 stands in two groups"),
        (Fault(Verb.KILL, 0, None, agents=(1, 0)), "agent 0 does not exist: agents are 1 to 4"),
        *(
            (Fault(verb, 0, None, pairs=((1, 3),)), "link 1->3 is not in the nominal graph")
            for verb in (Verb.DELAY, Verb.DEGRADE, Verb.BIAS, Verb.OUTLIER, Verb.DROPOUT, Verb.FREEZE)
        ),
        *(
            (Fault(verb, 0, None, agents=(5,)), "agent 5 does not exist: agents are 1 to 4")
            for verb in (Verb.PAUSE, Verb.CLOCK, Verb.GUST, Verb.LIE)
        ),
        (Fault(Verb.CUT, 0, None, trigger=0, pairs=((1, 3),)), "link 1->3 is not in the nominal graph"),
        (Fault(Verb.DEPART, 0, None, agents=(7,)), "agent 7 does not exist: agents are 1 to 4"),
    ],
)
def test_a_fault_on_what_does_not_exist_names_it(fault, match):
    with pytest.raises(ValueError, match=match):
        Timeline(LINKS, [fault])


# ---- long runs


MANY = [
    fault
    for second in range(0, 40_000, 4)
    for fault in (
        Fault(Verb.CUT, second, second + 2, pairs=((1, 2),)),
        Fault(Verb.KILL, second + 1, second + 3, agents=(3,)),
    )
]


def test_many_faults_take_no_conditions_but_those_that_are_looked_at():
    """Before: all were made at the first look, 1.7 kB for each of 20,000, in world, medium and launcher."""
    timeline = Timeline(LINKS, MANY)
    tracemalloc.start()
    for tick in range(2_000):
        timeline.at(tick)
    early, _ = tracemalloc.get_traced_memory()
    for tick in range(2_000, 4_000):
        timeline.at(tick)
    late, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert late - early < 100_000  # before: 1.7 kB for each of 1,000 faults and more
    assert timeline.at(7) is timeline.at(7)
    assert (held(timeline.at(1).cut), timeline.at(3).dead.any()) == ({(1, 2)}, False)


def test_who_takes_part_in_many_ticks_is_who_does_in_each():
    timeline = Timeline(LINKS, [*MANY[:6], Fault(Verb.DEPART, 3, None, agents=(1,))])
    ticks = [0, 1, 2, 3, 9, 5]
    each = np.array([~timeline.at(tick).absent for tick in ticks])
    np.testing.assert_array_equal(timeline.present(ticks), each, strict=True)
    np.testing.assert_array_equal(timeline.each(ticks, lambda now: now.dead), [timeline.at(t).dead for t in ticks])
    assert timeline.present([]).shape == (0, 4)


def test_without_one_fault_the_others_hold_as_they_did_for_as_long_as_it_lasts():
    faults = [
        Fault(Verb.CUT, 0, 5, pairs=((1, 2),)),
        Fault(Verb.LOSE, 3, 8, pairs=((2, 3),), probability=0.5),
        Fault(Verb.PAUSE, 4, 6, agents=(1,)),
        Fault(Verb.CUT, 7, None, pairs=((3, 4),)),
        Fault(Verb.KILL, 8, 9, agents=(2,)),
    ]
    whole = Timeline(LINKS, faults)
    for number, fault in enumerate(faults):
        without = Timeline(LINKS, [other for place, other in enumerate(faults) if place != number])
        alone = whole.without(number)
        for tick in range(fault.start, fault.end or 12):
            for field in fields(Conditions):
                if field.name != "acting":
                    np.testing.assert_array_equal(
                        getattr(alone.at(tick), field.name), getattr(without.at(tick), field.name)
                    )
    assert [fault.verb for fault in whole.without(1).faults] == [Verb.CUT, Verb.PAUSE, Verb.CUT]
