"""What is under way: it arrives when it is due, or is dropped, or waits; as it is, late, twice, or corrupted."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from airs import (
    BITS,
    DT,
    IMPAIRMENTS,
    cases,
    chatter,
    everything,
    fly,
    fly_case,
    mixture,
    quiet_profile,
    roaming,
    taking,
)
from hypothesis import given, settings

from netem.core.links import Links
from netem.faults.fault import Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.impairments.chain import ChainLayer
from netem.impairments.corrupt import Mark
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.loss import gilbert_elliott
from netem.impairments.rate import Rate
from netem.medium.entry import out_of_the_ordinary
from netem.medium.in_flight import Verdicts, newest_of
from netem.medium.ledger import Accounts, Ledger
from netem.medium.medium import Medium
from netem.medium.verdict import REASONS, VERDICT_OF, Verdict

LINKS = Links.both_ways(4, [(1, 2), (2, 3), (3, 4), (4, 1)])
SIZE = len(LINKS)
CHANNELS = ("sense", "input", "theta")
SENSE, INPUT, THETA = range(3)
ROW = LINKS.index[1, 2]
ALL_ROWS = np.ones(SIZE, dtype=bool)


def quiet(**changes):
    return quiet_profile(LINKS, CHANNELS, **changes)


def medium(standing, *faults, seed=1):
    return Medium(seed, CHANNELS, [standing], Timeline(LINKS, faults))


def always(ticks):
    return [everything(CHANNELS, LINKS)] * ticks


def only(ticks, *sent, row=ROW):
    """A message on one link and channel in each of these ticks, and no other."""
    offered = np.zeros((ticks, len(CHANNELS), SIZE), dtype=bool)
    offered[list(sent), INPUT, row] = True
    return offered


def arrivals(flown, row=ROW, channel=INPUT):
    """(tick, content tick) of whatever arrives late, twice or corrupted, and of what arrives as it is."""
    return [
        (tick, int(content))
        for tick, (_, delivery, _) in enumerate(flown)
        for content in [
            *(here[0] for here in delivery.apart if tuple(here[1:3]) == (row, channel)),
            *([tick] if delivery.plain[channel, row] else []),
        ]
    ]


def drops(flown):
    """Tick -> rows of what is dropped under way."""
    return {tick: rows for tick, (_, delivery, _) in enumerate(flown) if (rows := delivery.dropped.tolist())}


def releases(flown):
    return {tick: rows for tick, (_, delivery, _) in enumerate(flown) if (rows := delivery.released.tolist())}


# ---- agents that go


@pytest.mark.parametrize(("verb", "kind"), [(Verb.KILL, Verdict.DEAD), (Verb.DEPART, Verdict.DEPARTED)])
def test_what_is_under_way_to_an_agent_that_goes_is_dropped_at_once_for_that(verb, kind):
    flown = fly(medium(quiet(delays=taking([3] * SIZE)), Fault(verb, 5, 6, agents=(2,))), always(12))
    toward_2 = np.flatnonzero(LINKS.dst == 2)
    expected = [
        [sent, channel, row, sent, kind] for sent in (2, 3, 4) for channel in (INPUT, THETA) for row in toward_2
    ]
    assert {tick: sorted(rows) for tick, rows in drops(flown).items()} == {5: sorted(expected)}
    for row in toward_2:
        assert [tick for tick, _ in arrivals(flown, row)] == [3, 4, 9, 10, 11]  # what it was sent when it is back


def test_what_a_dying_agent_said_before_still_arrives():
    flown = fly(medium(quiet(delays=taking([3] * SIZE)), Fault(Verb.KILL, 5, None, agents=(1,))), always(12))
    assert arrivals(flown) == [(tick, tick - 3) for tick in (3, 4, 5, 6, 7)]


# ---- cuts and partitions

SEVERING = [
    (Verb.CUT, {"pairs": ((1, 2),)}, Verdict.CUT),
    (Verb.PARTITION, {"groups": ((1, 4), (2, 3))}, Verdict.PARTITION),
]
SEVERED = pytest.mark.parametrize(("verb", "what", "kind"), SEVERING, ids=["cut", "partition"])


@SEVERED
def test_a_cut_or_partition_drops_what_is_under_way_unless_it_says_otherwise(verb, what, kind):
    fault = Fault(verb, 5, 7, **what)
    flown = fly(medium(quiet(delays=taking([3] * SIZE)), fault), always(12))
    held = np.flatnonzero(Timeline(LINKS, [fault]).held(0))
    expected = [[sent, channel, row, sent, kind] for sent in (2, 3, 4) for channel in (INPUT, THETA) for row in held]
    assert {tick: sorted(rows) for tick, rows in drops(flown).items()} == {5: sorted(expected)}
    assert arrivals(flown) == [(3, 0), (4, 1), (10, 7), (11, 8)]
    assert (fault.under_way, releases(flown)) == (UnderWay.DROP, {})


@SEVERED
def test_what_is_under_way_on_a_severed_link_is_delivered_when_it_is_due_where_that_is_wanted(verb, what, kind):
    fault = Fault(verb, 5, 7, **what, under_way=UnderWay.DELIVER)
    flown = fly(medium(quiet(delays=taking([3] * SIZE)), fault), always(12))
    assert drops(flown) == releases(flown) == {}
    assert arrivals(flown) == [(tick, tick - 3) for tick in (3, 4, 5, 6, 7, 10, 11)]
    assert (np.array([flown[tick].verdicts.kind[INPUT, ROW] for tick in (5, 6)]) == kind).all()


@SEVERED
def test_what_is_under_way_on_a_severed_link_is_held_until_it_heals_where_that_is_wanted(verb, what, kind):
    fault = Fault(verb, 5, 9, **what, under_way=UnderWay.HOLD)
    flown = fly(medium(quiet(delays=taking([3] * SIZE)), fault), always(14))
    assert drops(flown) == {}
    assert arrivals(flown) == [(3, 0), (4, 1), (9, 2), (9, 3), (9, 4), (12, 9), (13, 10)]
    held = np.flatnonzero(Timeline(LINKS, [fault]).held(0))
    expected = [[sent, channel, row, sent] for sent in (2, 3, 4) for channel in (INPUT, THETA) for row in held]
    assert {tick: sorted(rows) for tick, rows in releases(flown).items()} == {9: sorted(expected)}
    assert flown[9].delivery.newest[INPUT, ROW] == 4
    assert (np.array([flown[tick].verdicts.kind[INPUT, ROW] for tick in range(5, 9)]) == kind).all()
    assert all(flown[tick].air.in_flight > 0 for tick in range(5, 9))


def test_held_messages_are_released_in_the_order_in_which_they_were_sent():
    waits = np.where(np.arange(SIZE) == ROW, 2, 0)
    hold = Fault(Verb.CUT, 4, 8, pairs=((1, 2),), under_way=UnderWay.HOLD)
    rows = fly(medium(quiet(delays=taking(waits)), hold), always(9))[8].delivery.apart.tolist()
    expected = [[sent, ROW, channel, Mark.NONE] for sent in (2, 3) for channel in (INPUT, THETA)]
    assert rows == expected


def test_a_held_message_that_is_not_due_yet_when_the_link_heals_arrives_when_it_is_due_and_counts_as_no_release():
    hold = Fault(Verb.CUT, 4, 6, pairs=((1, 2),), under_way=UnderWay.HOLD)
    flown = fly(medium(quiet(delays=taking([5] * SIZE)), hold), only(12, 0, 1, 3))
    assert arrivals(flown) == [(6, 0), (6, 1), (8, 3)]  # due in 5, 6 and 8
    assert releases(flown) == {6: [[0, INPUT, ROW, 0]]}


def test_one_hold_that_ends_does_not_release_what_another_holds():
    holds = [Fault(Verb.CUT, 2, end, pairs=((1, 2),), under_way=UnderWay.HOLD) for end in (5, 9)]
    flown = fly(medium(quiet(delays=taking([2] * SIZE)), *holds), only(12, 1))
    assert arrivals(flown) == [(9, 1)]


def test_of_two_faults_on_a_link_the_one_that_drops_prevails():
    hold = Fault(Verb.CUT, 2, 9, pairs=((1, 2),), under_way=UnderWay.HOLD)
    drop = Fault(Verb.CUT, 5, 6, pairs=((1, 2),))
    flown = fly(medium(quiet(delays=taking([2] * SIZE)), hold, drop), only(12, 1))
    assert drops(flown) == {5: [[1, INPUT, ROW, 0, Verdict.CUT]]}
    assert arrivals(flown) == []


def test_a_message_held_for_a_receiver_that_dies_is_dropped_for_that():
    hold = Fault(Verb.CUT, 2, 9, pairs=((1, 2),), under_way=UnderWay.HOLD)
    flown = fly(medium(quiet(delays=taking([2] * SIZE)), hold, Fault(Verb.KILL, 6, 7, agents=(2,))), only(12, 1))
    assert drops(flown) == {6: [[1, INPUT, ROW, 0, Verdict.DEAD]]}
    assert arrivals(flown) == []


def test_scripted_loss_leaves_what_is_under_way():
    lose = Fault(Verb.LOSE, 2, 9, pairs=((1, 2),), probability=1.0)
    assert arrivals(fly(medium(quiet(delays=taking([2] * SIZE)), lose), only(12, 1))) == [(3, 1)]


def test_a_message_under_way_is_booked_under_the_fault_that_drops_it():
    cut = Fault(Verb.CUT, 2, 9, pairs=((1, 2),), under_way=UnderWay.DELIVER)
    split = Fault(Verb.PARTITION, 2, 9, groups=((1, 4), (2, 3)))
    flown = fly(medium(quiet(delays=taking([2] * SIZE)), cut, split), only(12, 1))
    assert drops(flown) == {2: [[1, INPUT, ROW, 0, Verdict.PARTITION]]}


# ---- copies


def test_a_copy_arrives_beside_its_message_and_is_counted():
    flown = fly(medium(quiet(duplicate=np.ones(SIZE))), only(3, 1))
    verdicts, delivery, _ = flown[1]
    assert verdicts.copy_due[INPUT, ROW] == 1
    assert delivery.plain[INPUT, ROW]
    assert delivery.apart.tolist() == [[1, ROW, INPUT, Mark.NONE]]
    assert delivery.late == 1
    assert out_of_the_ordinary(1, verdicts).tolist() == [[INPUT, ROW, 1, Mark.NONE, 1]]


def test_sensing_is_neither_doubled_nor_delayed_nor_corrupted():
    chances = np.tile([0.0, 0.5, 0.5, 0.0], (SIZE, 1))
    standing = quiet(duplicate=np.ones(SIZE), delays=taking([2] * SIZE), corrupt=chances, least_delay=1)
    for tick, (verdicts, _, _) in enumerate(fly(medium(standing), always(5))):
        assert (verdicts.copy_due[SENSE] == -1).all()
        assert (verdicts.due[SENSE] == tick).all()
        assert (verdicts.mark[SENSE] == Mark.NONE).all()
        assert (verdicts.copy_due[INPUT:] == tick + 2).all()
        assert (verdicts.mark[INPUT:] != Mark.NONE).all()


def test_a_message_that_is_lost_has_no_copy():
    cut = Fault(Verb.CUT, 0, None, pairs=((1, 2),))
    verdicts = fly(medium(quiet(duplicate=np.ones(SIZE)), cut), always(1))[0].verdicts
    assert (verdicts.copy_due[INPUT, :] == np.where(np.arange(SIZE) == ROW, -1, 0)).all()


def long_spread():
    """Each of 1 to 20 ticks as likely as the others."""
    return MessageDelay(DelayLaw.UNIFORM, ALL_ROWS, 1.0, 1.0, np.empty(0), 0.0, ordered=False)


def assert_spread(waits):
    assert set(np.unique(waits)) == set(range(1, 21))
    assert abs(waits.mean() - 10.5) < 3 * np.sqrt((20**2 - 1) / 12 / waits.size)


def test_a_copy_waits_for_itself():
    flown = fly(medium(quiet(duplicate=np.full(SIZE, 0.5), delays=(long_spread(),))), always(600))
    due = np.array([tick.verdicts.due[INPUT] - k for k, tick in enumerate(flown)])
    copy_due = np.array([tick.verdicts.copy_due[INPUT] - k for k, tick in enumerate(flown)])
    doubled = np.array([tick.verdicts.copy_due[INPUT] >= 0 for tick in flown])
    for waits in (due, due[doubled], copy_due[doubled]):
        assert_spread(waits)
    assert abs(np.corrcoef(due[doubled], copy_due[doubled])[0, 1]) < 3 / np.sqrt(doubled.sum())


def test_messages_are_doubled_at_the_rate_of_their_link():
    chances = np.linspace(0.1, 0.9, SIZE)
    flown = fly(medium(quiet(duplicate=chances, coupled=False)), always(1000))
    doubled = np.array([tick.verdicts.copy_due[INPUT:] >= 0 for tick in flown]).sum(axis=(0, 1))
    assert (abs(doubled - 2000 * chances) < 3 * np.sqrt(2000 * chances * (1 - chances))).all()


def bad(by_packet):
    """A chain that loses nothing, and adds 0.3 s to whatever passes."""
    chain = gilbert_elliott(1.0, 0.0, bad=0.0, extra_delay=0.3)
    return ChainLayer.of(0, [chain] * SIZE, np.full(SIZE, by_packet), sensing=True, comms=True)


@pytest.mark.parametrize(
    "by_packet",
    [False, True],
)
def test_what_a_chain_adds_to_the_delay_of_a_message_it_adds_to_that_of_its_copy(by_packet):
    verdicts = fly(medium(quiet(chains=(bad(by_packet),), duplicate=np.ones(SIZE))), always(1))[0].verdicts
    assert (verdicts.due[INPUT:] == 3).all()
    assert (verdicts.copy_due[INPUT:] == 3).all()


@pytest.mark.parametrize("by_packet", [False, True])
def test_what_a_chain_of_one_class_adds_to_the_delay_it_adds_to_the_channels_of_its_class(by_packet):
    comms = replace(bad(by_packet), sensing=False)
    verdicts = fly(medium(quiet(chains=(comms,), coupled=False)), always(1))[0].verdicts
    assert (verdicts.due == [[0], [3], [3]]).all()


@pytest.mark.parametrize("by_packet", [False, True])
def test_a_chain_of_sensing_adds_nothing_to_the_delay_of_communication(by_packet):
    sensing = replace(bad(by_packet), comms=False)
    verdicts = fly(medium(quiet(chains=(sensing,), coupled=False)), always(1))[0].verdicts
    assert (verdicts.due == 0).all()


# ---- order


def spread(*, ordered):
    return MessageDelay(DelayLaw.UNIFORM, ALL_ROWS, 0.5, 0.5, np.empty(0), 0.0, ordered=ordered)


def test_messages_on_an_ordered_link_wait_for_those_sent_before_them():
    free, kept = (fly(medium(quiet(delays=(spread(ordered=ordered),))), always(60)) for ordered in (False, True))
    due_free, due_kept = (np.array([tick.verdicts.due for tick in flown]) for flown in (free, kept))
    assert (np.diff(due_free[:, INPUT], axis=0) < 0).any()  # some would overtake
    assert (due_kept[:, INPUT:] == np.maximum.accumulate(due_free[:, INPUT:], axis=0)).all()
    assert (due_kept[:, SENSE] == due_free[:, SENSE]).all()


def test_only_the_links_of_an_ordered_delay_keep_their_order():
    half = np.arange(SIZE) % 2 == 0
    laws = (replace(spread(ordered=True), rows=half), replace(spread(ordered=False), rows=~half))
    due = np.array([tick.verdicts.due[INPUT] for tick in fly(medium(quiet(delays=laws)), always(60))])
    overtakes = (np.diff(due, axis=0) < 0).any(axis=0)
    assert (overtakes == ~half).all()


def test_a_message_that_overtakes_is_not_delayed_and_the_others_are_as_ever():
    late = quiet(delays=(long_spread(),), reorder=np.full(SIZE, 0.25), coupled=False)
    takes = np.array([tick.verdicts.due[INPUT:] - k for k, tick in enumerate(fly(medium(late), always(500)))])
    assert abs((takes == 0).sum() - takes.size / 4) < 3 * np.sqrt(takes.size * 3 / 16)
    assert_spread(takes[takes > 0])


def test_no_copy_overtakes_on_an_ordered_link():
    standing = quiet(delays=(spread(ordered=True),), duplicate=np.ones(SIZE))
    for verdicts, _, _ in fly(medium(standing), always(30)):
        assert (verdicts.copy_due[INPUT:] >= verdicts.due[INPUT:]).all()


def test_messages_on_an_ordered_link_do_not_wait_for_what_was_dropped():
    free, kept = (
        fly(
            medium(quiet(delays=(spread(ordered=ordered),)), Fault(Verb.CUT, 9, 10, pairs=tuple(LINKS.index))),
            always(11),
        )
        for ordered in (False, True)
    )
    assert (kept[10].verdicts.due == free[10].verdicts.due).all()


# ---- rate


def limited(messages_per_tick, queue, burst=0.0):
    """Links that carry so many messages a tick; queue and burst in messages."""
    every = np.ones(SIZE)
    return quiet(rate=Rate(every * messages_per_tick * BITS / DT, burst * BITS * every, queue * BITS * every))


def test_a_message_takes_the_time_its_bits_take():
    verdicts = fly(medium(limited(1 / 4, queue=10)), only(1, 0))[0].verdicts
    assert verdicts.due[INPUT, ROW] == 4


def test_messages_queue_and_overflow_as_computed_by_hand():
    # Half a message leaves in a tick; the n-th that is taken leaves after 2 (n + 1) ticks, all together from tick 0.
    # Before tick k the queue holds what was taken, less k / 2; a message is refused where it would make more than 3.
    flown = fly(medium(limited(1 / 2, queue=3)), only(12, *range(12)))
    due = {k: int(v.due[INPUT, ROW]) for k, (v, _, _) in enumerate(flown) if v.kind[INPUT, ROW] != Verdict.OVERFLOW}
    assert due == {0: 2, 1: 4, 2: 6, 3: 8, 4: 10, 6: 12, 8: 14, 10: 16}
    assert [k for k, (v, _, _) in enumerate(flown) if v.kind[INPUT, ROW] == Verdict.OVERFLOW] == [5, 7, 9, 11]


def test_an_idle_link_saves_up_its_burst_and_no_more():
    # The bucket holds two messages: two pass at once, the third waits; six idle ticks fill the bucket, not more.
    flown = fly(medium(limited(1 / 2, queue=9, burst=2)), only(13, 0, 1, 2, 3, 9, 10, 11, 12))
    waits = [int(v.due[INPUT, ROW]) - k for k, (v, _, _) in enumerate(flown) if v.kind[INPUT, ROW] != Verdict.SILENT]
    # Debt after each, in messages: -1, -1/2, 0, 1/2; full again: -1, -1/2, 0, 1/2.
    assert waits == [0, 0, 0, 1] * 2


def test_channels_of_a_link_share_its_queue_in_their_order_and_sensing_has_none():
    verdicts = fly(medium(limited(1, queue=1.5)), always(1))[0].verdicts
    assert (verdicts.kind == [[Verdict.DELIVERED], [Verdict.DELAYED], [Verdict.OVERFLOW]]).all()
    assert (verdicts.due[INPUT] == 1).all()


def test_a_message_that_is_lost_takes_no_room_in_the_queue():
    cut = Fault(Verb.CUT, 0, 3, pairs=((1, 2),))
    due = [tick.verdicts.due[INPUT] for tick in fly(medium(limited(1 / 2, queue=9), cut), always(4))]
    assert due[3][ROW] == 3 + 2
    assert (np.delete(due[3], ROW) > 3 + 2).all()


def test_a_link_without_a_limit_has_no_queue():
    some = limited(1 / 2, queue=1)
    rates, queues = (np.where(np.arange(SIZE) == ROW, np.inf, value) for value in (some.rate.rate, some.rate.queue))
    flown = fly(medium(replace(some, rate=replace(some.rate, rate=rates, queue=queues))), always(20))
    kinds = np.array([tick.verdicts.kind[INPUT:] for tick in flown])
    assert (kinds[..., ROW] == Verdict.DELIVERED).all()
    assert (np.delete(kinds, ROW, axis=-1) != Verdict.DELIVERED).all()


# ---- marks


def certain(kind):
    return quiet(corrupt=np.tile([float(kind == n) for n in (1, 2, 3, 4)], (SIZE, 1)))


def test_a_stale_message_says_what_its_sender_said_the_tick_before():
    flown = fly(medium(certain(Mark.STALE)), only(6, 1, 2, 4))
    told = {tick: d.apart.tolist() for tick, (_, d, _) in enumerate(flown) if len(d.apart)}
    assert told == {2: [[1, ROW, INPUT, Mark.STALE]]}
    assert [tick for tick, (_, d, _) in enumerate(flown) if d.plain[INPUT, ROW]] == [1, 4]  # nothing was said before
    assert (flown[2].delivery.newest[INPUT, ROW], flown[2].delivery.mark[INPUT, ROW]) == (1, Mark.STALE)


def test_a_stale_message_that_is_late_says_what_was_said_before_it_was_sent():
    standing = replace(certain(Mark.STALE), delays=taking([3] * SIZE))
    assert arrivals(fly(medium(standing), only(8, 1, 2))) == [(4, 1), (5, 1)]


@pytest.mark.parametrize("kind", [Mark.BIAS, Mark.NAN, Mark.BIT_FLIP])
@pytest.mark.parametrize("wait", [0, 2])
def test_a_corrupted_message_arrives_when_it_is_due_with_its_mark(kind, wait):
    standing = replace(certain(kind), delays=taking([wait] * SIZE))
    flown = fly(medium(standing), only(5, 1))
    _, delivery, _ = flown[1 + wait]
    assert delivery.apart.tolist() == [[1, ROW, INPUT, kind]]
    assert delivery.mark[INPUT, ROW] == kind
    assert delivery.late == (wait > 0)
    assert not any(tick.delivery.plain.any() for tick in flown)
    assert sum(len(tick.delivery.apart) for tick in flown) == 1


def test_a_copy_of_a_corrupted_message_is_whole():
    standing = replace(certain(Mark.NAN), duplicate=np.ones(SIZE))
    _, delivery, _ = fly(medium(standing), only(2, 1))[1]
    assert delivery.apart.tolist() == [[1, ROW, INPUT, Mark.NONE], [1, ROW, INPUT, Mark.NAN]]


def test_messages_are_corrupted_at_the_rates_of_their_link():
    chances = np.array([0.1, 0.2, 0.3, 0.15])
    flown = fly(medium(quiet(corrupt=np.tile(chances, (SIZE, 1)), coupled=False)), always(501))[1:]
    marks = np.array([tick.verdicts.mark[INPUT:] for tick in flown])
    for kind, share in zip(list(Mark), [1 - chances.sum(), *chances], strict=True):
        assert abs((marks == kind).sum() - marks.size * share) < 3 * np.sqrt(marks.size * share * (1 - share))


class Scripted:
    """Verdicts by hand on the messages of one channel and link: by tick, (due, mark, when the copy is due)."""

    def __init__(self, by_tick):
        self._by_tick = by_tick

    def verdicts(self, tick, offered):
        kind, due = np.where(offered, np.uint8(Verdict.LOST), np.uint8(Verdict.SILENT)), np.full(offered.shape, tick)
        mark, copy_due = np.zeros(offered.shape, dtype=np.uint8), np.full(offered.shape, -1)
        if tick in self._by_tick:
            due[INPUT, ROW], mark[INPUT, ROW], copy_due[INPUT, ROW] = self._by_tick[tick]
            kind[INPUT, ROW] = Verdict.DELIVERED if due[INPUT, ROW] == tick else Verdict.DELAYED
        return Verdicts(kind, due, mark, copy_due)


@pytest.mark.parametrize(
    ("sent", "newest", "mark"),
    [
        ({}, -1, Mark.NONE),
        ({7: (7, Mark.NONE, -1)}, 7, Mark.NONE),
        ({5: (7, Mark.NAN, -1)}, 5, Mark.NAN),
        ({5: (7, Mark.NAN, -1), 7: (7, Mark.NONE, -1)}, 7, Mark.NONE),  # what is older does not matter
        ({5: (7, Mark.NONE, -1), 7: (7, Mark.NAN, -1)}, 7, Mark.NAN),
        ({3: (7, Mark.BIT_FLIP, -1), 5: (7, Mark.NONE, -1)}, 5, Mark.NONE),
        ({3: (7, Mark.NONE, -1), 5: (7, Mark.BIAS, -1)}, 5, Mark.BIAS),
        ({5: (7, Mark.BIAS, 7)}, 5, Mark.BIAS),  # of those that are equally new the last, as in an inbox
        ({7: (7, Mark.BIT_FLIP, 7)}, 7, Mark.BIT_FLIP),
        ({5: (6, Mark.BIAS, 7)}, 5, Mark.NONE),
        ({7: (7, Mark.STALE, -1)}, 6, Mark.STALE),
        ({6: (7, Mark.NONE, -1), 7: (7, Mark.STALE, -1)}, 6, Mark.STALE),
        ({6: (7, Mark.NAN, -1), 7: (7, Mark.STALE, -1)}, 6, Mark.NAN),
        ({7: (7, Mark.STALE, 7)}, 7, Mark.NONE),
        ({0: (7, Mark.NONE, -1)}, 0, Mark.NONE),
    ],
)
def test_the_newest_content_that_arrives_decides_and_of_equally_new_the_last(sent, newest, mark):
    flying = Medium(1, CHANNELS, [quiet()], Timeline(LINKS, []), Scripted(sent))
    delivery = fly(flying, always(8))[7].delivery
    here = np.zeros((len(CHANNELS), SIZE), dtype=bool)
    here[INPUT, ROW] = True
    np.testing.assert_array_equal(delivery.newest, np.where(here, newest, -1))
    np.testing.assert_array_equal(delivery.mark, np.where(here, mark, Mark.NONE))


def test_newest_of_is_the_newest_of_each_channel_and_link():
    rng = np.random.default_rng(1)
    plain = np.where(rng.random((3, 5)) < 0.5, 20, -1)
    apart = np.stack([rng.integers(0, high, 40) for high in (22, 5, 3, 5)], axis=-1)
    apart = apart[np.lexsort(apart.T[::-1])]
    newest = newest_of(plain, apart)
    for channel, link in np.ndindex(3, 5):
        here = [content for content, row, ch, _ in apart.tolist() if (row, ch) == (link, channel)]
        assert newest[channel, link] == max([*here, plain[channel, link]])


# ---- all of it at once

TICKS = 30


@settings(max_examples=40, deadline=None)
@given(case=cases(TICKS))
def test_offered_and_copies_are_delivered_dropped_or_in_flight(case):
    _, offered, flown = fly_case(case, CHANNELS, TICKS)
    kinds = np.array([tick.verdicts.kind for tick in flown])
    late, released = (np.array([value(tick.delivery) for tick in flown]) for value in (lambda d: d.late, len_released))
    dropped = np.stack([np.bincount(tick.delivery.dropped[:, 4], minlength=len(Verdict)) for tick in flown])
    copies = np.array([(tick.verdicts.copy_due >= 0).sum() for tick in flown])
    in_flight = flown[-1].air.in_flight

    assert ((kinds == Verdict.SILENT) == ~offered).all()
    assert (kinds == Verdict.DELAYED).sum() + copies.sum() == late.sum() + dropped.sum() + in_flight
    assert (released <= late).all()

    ledger = Ledger.of(kinds, copies, late, dropped)
    assert (ledger.offered, ledger.copies) == (offered.sum(), copies.sum())
    assert ledger.delivered == (kinds == Verdict.DELIVERED).sum() + late.sum()
    assert sum(ledger.dropped.values()) == (kinds >= Verdict.DEAD).sum() + dropped.sum()
    assert ledger.offered + ledger.copies == ledger.delivered + sum(ledger.dropped.values()) + in_flight
    assert Accounts(len(flown), ledger, in_flight).close
    assert not Accounts(len(flown), ledger, in_flight + 1).close


def len_released(delivery):
    return len(delivery.released)


def under_way_of(tick, verdicts, number):
    """What a tick's verdicts put under way: (due, sent, channel, link, content, mark, number)."""
    rows = []
    for channel, link in np.argwhere(verdicts.kind == Verdict.DELAYED).tolist():
        mark = int(verdicts.mark[channel, link])
        content = tick - (mark == Mark.STALE)
        rows.append((int(verdicts.due[channel, link]), tick, channel, link, content, mark, int(number[channel, link])))
    for channel, link in np.argwhere(verdicts.copy_due >= 0).tolist():
        rows.append((int(verdicts.copy_due[channel, link]), tick, channel, link, tick, 0, int(number[channel, link])))
    return rows


@settings(max_examples=40, deadline=None)
@given(case=cases(TICKS))
def test_every_message_under_way_arrives_once_when_it_is_due_or_meets_a_fault_that_drops_or_holds_it(case):
    timeline, offered, flown = fly_case(case, CHANNELS, TICKS)
    number, flying = np.zeros(offered.shape[1:], dtype=int), []
    for tick, (verdicts, delivery, air) in enumerate(flown):
        on = [severing(timeline, tick, link) for link in range(len(timeline.links))]
        policies = [
            {fault.under_way for fault in (*faults, *pausing(timeline, tick, int(agent)))}
            for faults, agent in zip(on, timeline.links.dst, strict=True)
        ]
        gone = [absent(timeline, tick, int(agent)) for agent in timeline.links.dst]
        flying += under_way_of(tick, verdicts, number)
        dropped = [m for m in flying if gone[m[3]] or UnderWay.DROP in policies[m[3]]]
        flying = [m for m in flying if m not in dropped]
        arriving = [m for m in flying if m[0] <= tick and UnderWay.HOLD not in policies[m[3]]]
        for message in arriving:
            flying.remove(message)
        corrupted = np.argwhere((verdicts.kind == Verdict.DELIVERED) & (verdicts.mark != Mark.NONE)).tolist()
        marks = [(c, link, int(verdicts.mark[c, link])) for c, link in corrupted]
        apart = [(content, link, c, mark) for _, _, c, link, content, mark, _ in arriving]
        apart += [(tick - (mark == Mark.STALE), link, c, mark) for c, link, mark in marks]

        assert [tuple(row) for row in delivery.apart.tolist()] == sorted(apart)
        assert (delivery.late, air.in_flight) == (len(arriving), len(flying))
        assert Counter(map(tuple, delivery.dropped[:, :4].tolist())) == Counter(m[1:4] + m[6:] for m in dropped)
        for *_, link, _, kind in delivery.dropped.tolist():
            assert kind == gone[link] if gone[link] else kind in {VERDICT_OF[fault.verb] for fault in on[link]}
        late = [m[1:4] + m[6:] for m in arriving if m[0] < tick]
        assert Counter(map(tuple, delivery.released.tolist())) == Counter(late)
        assert (delivery.plain == ((verdicts.kind == Verdict.DELIVERED) & (verdicts.mark == Mark.NONE))).all()
        assert_newest(tick, delivery)
        number += offered[tick]


def assert_newest(tick, delivery):
    """The newest, by a look at all that arrives in a cell."""
    newest = newest_of(np.where(delivery.plain, tick, -1), delivery.apart)
    np.testing.assert_array_equal(newest, delivery.newest)
    for channel, link in np.ndindex(delivery.plain.shape):
        here = [(content, mark) for content, row, ch, mark in delivery.apart.tolist() if (row, ch) == (link, channel)]
        here += [(tick, 0)] if delivery.plain[channel, link] else []
        best = max(here, default=(-1, 0))
        assert (delivery.newest[channel, link], delivery.mark[channel, link]) == best


def severing(timeline, tick, link):
    """The faults that sever a link."""
    severed = (Verb.CUT, Verb.PARTITION)
    return [f for n, f in enumerate(timeline.faults) if f.verb in severed and f.active(tick) and timeline.held(n)[link]]


def pausing(timeline, tick, agent):
    """The faults that pause an agent."""
    return [f for f in timeline.faults if f.verb is Verb.PAUSE and f.active(tick) and agent in f.agents]


def absent(timeline, tick, agent):
    """Why nothing more reaches an agent, if so."""
    verbs = {fault.verb for fault in timeline.faults if fault.active(tick) and agent in fault.agents}
    if Verb.KILL in verbs:
        return Verdict.DEAD
    if any(fault.under_way is UnderWay.DROP for fault in pausing(timeline, tick, agent)):
        return Verdict.PAUSED
    return Verdict.DEPARTED if Verb.DEPART in verbs else None


def test_the_mixtures_have_everything_in_them():
    links = Links.both_ways(5, [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1), (1, 3)])
    faults = [
        Fault(Verb.CUT, 20, 30, pairs=tuple(links.index), under_way=UnderWay.HOLD),
        Fault(Verb.CUT, 50, 55, pairs=((1, 2), (2, 1), (3, 4))),
        Fault(Verb.PARTITION, 65, 70, groups=((1, 2), (3, 4, 5))),
        Fault(Verb.KILL, 75, 80, agents=(2,)),
        Fault(Verb.DEPART, 85, 90, agents=(3,)),
        Fault(Verb.PAUSE, 10, 14, agents=(4,), under_way=UnderWay.DROP),
        Fault(Verb.DELAY, 34, 38, pairs=((1, 2), (2, 3)), seconds=0.3),
        Fault(Verb.DROPOUT, 0, None, pairs=tuple(links.index), probability=0.05),
        Fault(Verb.LOSE, 0, None, pairs=tuple(links.index), probability=0.05),
    ]
    kinds, marks, under_way, released, copies = Counter(), Counter(), Counter(), 0, 0
    for coupled in (True, False):
        standing = mixture(3, IMPAIRMENTS, links, CHANNELS, coupled=coupled)
        offered = chatter(3, CHANNELS, links, 100, 0.7)
        for verdicts, delivery, _ in fly(
            Medium(3, CHANNELS, [standing], Timeline(links, faults)), offered, roaming(3, 5, 100)
        ):
            kinds.update(verdicts.kind.ravel().tolist())
            marks.update(verdicts.mark.ravel().tolist())
            under_way.update(delivery.dropped[:, 4].tolist())
            released += len(delivery.released)
            copies += int((verdicts.copy_due >= 0).sum())
    assert set(kinds) == set(Verdict) - {Verdict.UNSAID}
    assert set(marks) == set(Mark)
    assert set(under_way) == {Verdict.DEAD, Verdict.PAUSED, Verdict.DEPARTED, Verdict.CUT, Verdict.PARTITION}
    assert released > 0
    assert copies > 0
    assert set(REASONS) - {Verdict.UNSAID} <= set(kinds)


def test_a_copy_waits_in_the_queue_as_its_message_does():
    limited = quiet(duplicate=np.ones(SIZE), rate=Rate(np.full(SIZE, BITS), np.zeros(SIZE), np.full(SIZE, 9e9)))
    verdicts = fly(medium(limited), always(1))[0].verdicts
    assert (verdicts.copy_due[1:] == verdicts.due[1:]).all()
    assert (verdicts.due[1:] > 0).all()


def test_no_message_overtakes_a_copy_sent_before_it_on_an_ordered_link():
    standing = quiet(delays=(spread(ordered=True),), duplicate=np.full(SIZE, 0.5))
    latest = -1
    for verdicts, _, _ in fly(medium(standing), always(60)):
        assert (verdicts.due[1:] >= latest).all()
        latest = np.maximum(verdicts.due, verdicts.copy_due)[1:]
