"""What an agent, a link, a channel or a fault more does to the others: nothing. Rate limits aside, for a queue is shared."""

from dataclasses import replace

import numpy as np
import pytest
from airs import (
    IMPAIRMENTS,
    OF_AGENTS,
    OF_SENSORS,
    Case,
    cases,
    edges_of,
    everything,
    faults_over,
    fly_case,
    mixture,
    quiet_profile,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.core import channels as channel_names
from netem.core.links import Links
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.impairments.chain import Chain, ChainLayer
from netem.impairments.corrupt import Mark
from netem.medium.by_tick import ImpairmentsByTick
from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

CHANNELS = ("sense", "input", "theta")
TICKS = 24
RATE = frozenset({"rate", "rate over time"})
CASES = cases(TICKS, without=RATE)
FIELDS = ("kind", "due", "mark", "copy_due")
KIND, DUE, MARK, _ = range(4)


def verdicts(case, channels=CHANNELS):
    """The whole verdict of every tick, channel and link, shape (T, C, L, 4)."""
    _, _, flown = fly_case(case, channels, TICKS)
    return whole(flown)


def whole(flown):
    found = np.stack([[getattr(tick.verdicts, name) for tick in flown] for name in FIELDS], axis=-1).astype(np.int64)
    found[~passed(found), DUE] = -1  # what is dropped is due in no tick
    return found


def passed(found):
    return (found[..., KIND] == Verdict.DELIVERED) | (found[..., KIND] == Verdict.DELAYED)


def assert_unchanged(case, more, channels=CHANNELS):
    """Everything there was before has the verdicts that it had."""
    before, after = verdicts(case), verdicts(more, channels)
    assert after[0].size > before[0].size
    rows = [channels.index(name) for name in CHANNELS]
    columns = [more.links.index[pair] for pair in case.links.index]
    np.testing.assert_array_equal(after[:, rows][:, :, columns], before)


# ---- more of anything


@settings(max_examples=12, deadline=None)
@given(case=CASES, data=st.data())
def test_an_agent_more_changes_no_verdict_of_the_others(case, data):
    newcomer = case.agents + 1
    known = data.draw(st.lists(st.integers(1, case.agents), min_size=1, max_size=3, unique=True))
    more = case._replace(agents=newcomer, edges=(*case.edges, *((agent, newcomer) for agent in known)))
    assert_unchanged(case, more)


@settings(max_examples=12, deadline=None)
@given(case=CASES.filter(lambda case: len(case.edges) < len(edges_of(case.agents))), data=st.data())
def test_a_link_more_changes_no_verdict_of_the_others(case, data):
    edge = data.draw(st.sampled_from(sorted({*edges_of(case.agents)} - {*case.edges})))
    assert_unchanged(case, case._replace(edges=(*case.edges, edge)))


@settings(max_examples=12, deadline=None)
@given(case=CASES, name=st.sampled_from(["a", "measurement", "z"]))
def test_a_channel_more_changes_no_verdict_of_the_others(case, name):
    assert_unchanged(case, case, ("sense", *sorted(["input", "theta", name])))


@settings(max_examples=25, deadline=None)
@given(case=CASES, data=st.data())
def test_a_fault_more_changes_nothing_on_other_links_and_nothing_while_it_does_not_hold(case, data):
    assert_elsewhere_unchanged(case, data.draw(faults_over(case.links, TICKS)))


CHAINS = {"chains", "chains of one class"}
RING = ((1, 2), (2, 3), (3, 4), (4, 1), (1, 3))
ONE_OF_EACH = [
    *(Fault(Verb.CUT, 9, 14, pairs=((1, 2), (4, 3)), under_way=policy) for policy in UnderWay),
    *(Fault(Verb.PARTITION, 9, 14, groups=((1, 2), (3, 4)), under_way=policy) for policy in UnderWay),
    Fault(Verb.LOSE, 9, 14, pairs=((1, 2), (4, 3)), probability=0.7),
    Fault(Verb.DELAY, 9, 14, pairs=((1, 2), (4, 3)), seconds=0.35),
    Fault(Verb.DEGRADE, 9, 14, pairs=((1, 2), (4, 3)), profile=1),
    Fault(Verb.DROPOUT, 9, 14, pairs=((1, 2), (4, 3)), probability=0.7),
    *(Fault(Verb.PAUSE, 9, 14, agents=(2,), under_way=policy) for policy in (UnderWay.DROP, UnderWay.HOLD)),
    Fault(Verb.KILL, 9, 14, agents=(2,)),
    *(Fault(Verb.DEPART, 9, 14, agents=(2,), body=body) for body in DepartedBody),
    *(replace(what, start=9, end=14, pairs=((1, 2), (4, 3))) for what in OF_SENSORS),
    *(replace(what, start=9, end=14, agents=(2,)) for what in OF_AGENTS),
]


def test_there_is_a_fault_of_every_verb():
    assert {fault.verb for fault in ONE_OF_EACH} == set(Verb)


@pytest.mark.parametrize("fault", ONE_OF_EACH, ids=lambda fault: f"{fault.verb}, {fault.under_way}, {fault.body}")
@pytest.mark.parametrize("mix", [0, 2])
def test_a_fault_changes_nothing_on_other_links_that_delay_double_and_corrupt_all_they_carry(fault, mix):
    has = frozenset({"delays", "ordered", "duplicate", "reorder", "corrupt"})
    assert_elsewhere_unchanged(Case(3, 4, RING, mix, has, mix < 2, least_delay=0, faults=(), talk=1.0), fault)


@pytest.mark.parametrize("fault", ONE_OF_EACH, ids=lambda fault: f"{fault.verb}, {fault.under_way}, {fault.body}")
def test_a_fault_changes_verdicts_where_it_holds_if_it_is_one_of_the_air(fault):
    case = Case(3, 4, RING, 0, frozenset({"delays"}), True, least_delay=0, faults=(), talk=1.0)
    held = Timeline(case.links, [fault]).held(0)
    before, after = verdicts(case), verdicts(case._replace(faults=(fault,)))
    changed = (after[9:14, :, held] != before[9:14, :, held]).any()
    assert changed == (fault.verb in OF_THE_MEDIUM)


def assert_elsewhere_unchanged(case, another):
    held = Timeline(case.links, [another]).held(0)
    flights = [fly_case(one, CHANNELS, TICKS)[2] for one in (case, case._replace(faults=(*case.faults, another)))]
    before, after = map(whole, flights)
    np.testing.assert_array_equal(after[:, :, ~held], before[:, :, ~held])
    np.testing.assert_array_equal(after[: another.start], before[: another.start])
    for tick in range(TICKS):
        here, there = (flown[tick].delivery.apart for flown in flights)
        np.testing.assert_array_equal(here[~held[here[:, 1]]], there[~held[there[:, 1]]])
        if tick >= another.start:
            old, new = before[tick][:, held], after[tick][:, held]
            toward = np.isin(case.links.dst[held], another.agents)
            while_it_holds(another, old, new, toward) if another.active(tick) else when_it_is_over(
                case, another, old, new
            )


SEVERING = {Verb.CUT, Verb.PARTITION, Verb.KILL, Verb.DEPART}
OF_THE_MEDIUM = SEVERING | {Verb.LOSE, Verb.DELAY, Verb.DEGRADE, Verb.DROPOUT, Verb.PAUSE}


def while_it_holds(fault, old, new, toward):
    """Old and new verdicts on the links it takes hold of, those `toward` its agents among them."""
    silent = old[..., KIND] == Verdict.SILENT
    assert (silent == (new[..., KIND] == Verdict.SILENT)).all()
    if fault.verb is Verb.DEGRADE:
        return
    struck = new[..., KIND] >= Verdict.DEAD
    assert not (passed(new) & ~passed(old)).any()
    assert (new[..., MARK][passed(new)] == old[..., MARK][passed(new)]).all()
    match fault.verb:
        case Verb.LOSE:
            assert (new[..., KIND][struck & passed(old)] == Verdict.SCRIPTED).all()
        case Verb.DROPOUT:
            np.testing.assert_array_equal(new[1:], old[1:])
            assert (new[..., KIND][struck & passed(old)] == Verdict.DROPOUT).all()
        case Verb.DELAY:
            assert (passed(new) == passed(old)).all()
            np.testing.assert_array_equal(new[0], old[0])
            np.testing.assert_array_equal(new[~passed(new)], old[~passed(old)])
            assert (new[..., DUE] >= old[..., DUE]).all()
        case Verb.PAUSE:
            np.testing.assert_array_equal(new[:, ~toward], old[:, ~toward])
            assert (new[0, toward, KIND] >= Verdict.DEAD).all()
            heard, before = new[1:, toward], old[1:, toward]
            if fault.under_way is UnderWay.DROP:
                assert not passed(heard).any()
            else:
                assert (heard[passed(before), KIND] == Verdict.DELAYED).all()
                np.testing.assert_array_equal(heard[~passed(before)], before[~passed(before)])
                np.testing.assert_array_equal(heard[..., DUE:], before[..., DUE:])
        case verb if verb in SEVERING:
            assert (struck | silent).all()
        case _:
            np.testing.assert_array_equal(new, old)


def when_it_is_over(case, fault, old, new):
    """All is as if it had not been, but that no message waits for those it held back on an ordered link."""
    if fault.verb is Verb.DEGRADE and CHAINS & case.has:
        return  # its own chains stood still where they step with messages
    if fault.verb not in OF_THE_MEDIUM or "ordered" not in case.has:
        np.testing.assert_array_equal(new, old)
    assert (passed(new) == passed(old)).all()
    np.testing.assert_array_equal(new[..., KIND][~passed(new)], old[..., KIND][~passed(old)])
    np.testing.assert_array_equal(new[..., MARK], old[..., MARK])


@pytest.mark.parametrize("coupled", [True, False])
def test_the_verdicts_compared_are_many_and_differ(coupled):
    case = Case(3, 4, RING, 3, frozenset(IMPAIRMENTS) - RATE, coupled, least_delay=0, faults=(), talk=0.7)
    found = verdicts(case)
    drops = {Verdict.CLOSED, Verdict.RANGE, Verdict.JAMMED, Verdict.LISTED, Verdict.LOST}
    assert set(np.unique(found[..., KIND])) == {Verdict.SILENT, Verdict.DELIVERED, Verdict.DELAYED} | drops
    assert set(np.unique(found[..., MARK])) == set(Mark)
    assert (found[..., -1] >= 0).sum() > 5


# ---- chains that step with time, or with messages


# Passes and loses in turn.
TOGGLE = Chain(np.array([[0.0, 1.0], [1.0, 0.0]]), np.array([0.0, 1.0]), np.zeros(2))

PAIR = Links.both_ways(2, [(1, 2)])
THERE = PAIR.index[1, 2]


def toggling(by_packet, *, coupled):
    layer = ChainLayer.of(0, [TOGGLE] * 2, np.full(2, by_packet), sensing=True, comms=True)
    return Medium(5, CHANNELS, [quiet_profile(PAIR, CHANNELS, chains=(layer,), coupled=coupled)], Timeline(PAIR, []))


def outcomes(medium, offered):
    """What becomes of the messages that are offered on one link and channel, tick by tick."""
    air, kinds = medium.begin(), []
    for tick, offer in enumerate(offered):
        air, verdicts = medium.judge(air, tick, offer, None)
        kinds.append(int(verdicts.kind[1, THERE]))
    return np.array(kinds)


def speaking_in(*ticks):
    offered = np.zeros((max(ticks) + 1, len(CHANNELS), len(PAIR)), dtype=bool)
    offered[list(ticks), 1, THERE] = True
    return offered


@pytest.mark.parametrize("coupled", [True, False])
@pytest.mark.parametrize("pause", [0, 1, 2, 99])
def test_a_chain_that_steps_with_messages_is_frozen_while_the_link_is_idle(coupled, pause):
    kinds = outcomes(toggling(True, coupled=coupled), speaking_in(3, 4, 5 + pause, 6 + pause))
    first, second, third, fourth = kinds[kinds != Verdict.SILENT]
    assert first == third != second == fourth


@pytest.mark.parametrize("coupled", [True, False])
@pytest.mark.parametrize("pause", [0, 1, 2, 99])
def test_a_chain_that_steps_with_time_moves_while_the_link_is_idle(coupled, pause):
    kinds = outcomes(toggling(False, coupled=coupled), speaking_in(3, 4, 5 + pause, 6 + pause))
    first, second, third, fourth = kinds[kinds != Verdict.SILENT]
    assert first != second
    assert third != fourth
    assert (third == first) == (pause % 2 == 0)


def test_an_uncoupled_channel_that_is_idle_is_frozen_whatever_the_others_say():
    offered = speaking_in(3, 4, 15, 16)
    alone = outcomes(toggling(True, coupled=False), offered)
    offered[5:14, [0, 2], THERE] = True
    assert (outcomes(toggling(True, coupled=False), offered) == alone).all()


def test_the_messages_of_a_tick_step_a_coupled_chain_once():
    medium, offered = toggling(True, coupled=True), everything(CHANNELS, PAIR)
    air, kinds = medium.begin(), []
    for tick in range(4):
        air, verdicts = medium.judge(air, tick, offered, None)
        kinds.append(verdicts.kind.copy())
    assert all((kind == kind[:1]).all() for kind in kinds)
    assert (kinds[0] != kinds[1]).all()
    assert (kinds[0] == kinds[2]).all()


def test_a_message_that_is_lost_steps_its_chain_too():
    kinds = outcomes(toggling(True, coupled=False), speaking_in(*range(8)))
    assert (kinds[:-1] != kinds[1:]).all()


def test_a_link_that_steps_with_messages_leaves_those_that_step_with_time():
    mixed = np.array([row == THERE for row in range(2)])
    layer = ChainLayer.of(0, [TOGGLE] * 2, mixed, sensing=True, comms=True)
    both = Medium(5, CHANNELS, [quiet_profile(PAIR, CHANNELS, chains=(layer,))], Timeline(PAIR, []))
    by_time = toggling(False, coupled=True)
    other = PAIR.index[2, 1]
    offered = np.zeros((20, len(CHANNELS), 2), dtype=bool)
    offered[::2, 1] = True
    kinds = []
    for medium in (both, by_time):
        air, flown = medium.begin(), []
        for tick, offer in enumerate(offered):
            air, verdicts = medium.judge(air, tick, offer, None)
            flown.append(verdicts.kind[1])
        kinds.append(np.array(flown))
    assert (kinds[0][:, other] == kinds[1][:, other]).all()
    assert (kinds[0][:, THERE] != kinds[1][:, THERE]).any()


# ---- any order of ticks


def by_tick(coupled):
    links = Links.both_ways(4, [(1, 2), (2, 3), (3, 4), (4, 1), (1, 3)])
    profile = mixture(3, frozenset(IMPAIRMENTS), links, CHANNELS, coupled=coupled)
    names = np.array([channel_names.code(name) for name in CHANNELS])
    codes = np.zeros(1, dtype=np.int64) if coupled else names
    return ImpairmentsByTick(7, links, profile, codes, np.array([True, False, False]))


LAST = 150  # more than two spans that are computed at once


@pytest.fixture(scope="module", params=[True, False], ids=["coupled", "uncoupled"])
def in_sequence(request):
    flying = by_tick(request.param)
    return request.param, [flying.at(tick) for tick in range(LAST)]


@settings(max_examples=8, deadline=None)
@given(ticks=st.lists(st.integers(0, LAST - 1), min_size=1, max_size=4))
def test_the_impairments_are_the_same_in_whatever_order_the_ticks_are_asked_for(in_sequence, ticks):
    coupled, expected = in_sequence
    flying = by_tick(coupled)
    for tick in ticks:
        for field, other in zip(flying.at(tick), expected[tick], strict=True):
            np.testing.assert_array_equal(field, other)


def test_the_weather_compared_changes_from_tick_to_tick(in_sequence):
    _, expected = in_sequence
    for field in zip(*expected, strict=True):
        assert len(np.unique(np.array(field, dtype=float).reshape(LAST, -1), axis=0)) > 1
