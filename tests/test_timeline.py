"""Scripted faults: what holds in which tick; faults add up, and the end of one heals no other."""

import numpy as np
import pytest

from netem.fault import Fault, UnderWay, Verb
from netem.links import Links
from netem.timeline import Timeline

LINKS = Links.both_ways(4, [(1, 2), (2, 3), (3, 4), (4, 1)])


def held(mask):
    return {(int(src), int(dst)) for src, dst in zip(LINKS.src[mask], LINKS.dst[mask], strict=True)}


def test_without_faults_nothing_is_held():
    now = Timeline(LINKS, []).at(1000)
    assert (
        now.cut.shape
        == now.partitioned.shape
        == now.cut_drops.shape
        == now.partition_drops.shape
        == now.holds.shape
        == now.loss.shape
        == (8,)
    )
    assert now.dead.shape == now.departed.shape == (4,)
    for mask in (
        now.cut,
        now.partitioned,
        now.cut_drops,
        now.partition_drops,
        now.holds,
        now.loss,
        now.dead,
        now.departed,
        now.absent,
    ):
        assert not mask.any()


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
        (Fault(Verb.DEPART, 0, 1, agents=(1, 2)), "depart 1,2", "rejoin 1,2"),
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
        (Fault(Verb.DEPART, 0, None, agents=(7,)), "agent 7 does not exist: agents are 1 to 4"),
    ],
)
def test_a_fault_on_what_does_not_exist_names_it(fault, match):
    with pytest.raises(ValueError, match=match):
        Timeline(LINKS, [fault])
