"""The medium: every message offered is delivered, dropped for one reason, or in flight; layers and draws do not mix."""

from dataclasses import replace

import numpy as np
import pytest
from airs import BITS, DT, IMPAIRMENTS, constant, fly, losing, mixture, quiet_profile, roaming, taking, verdicts_of
from airs import everything as everything_on

from netem.core.links import Links
from netem.faults.fault import Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.faults.trigger import Trigger
from netem.impairments.jamming import Zone
from netem.impairments.rate import Rate
from netem.impairments.reach import Reach, ReachLaw
from netem.impairments.schedule import Schedule
from netem.impairments.trace import Trace
from netem.medium.ledger import Accounts, Ledger
from netem.medium.medium import Medium
from netem.medium.verdict import REASONS, Verdict

LINKS = Links.both_ways(5, [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1), (1, 3)])
CHANNELS = ("sense", "input", "theta")
SIZE = len(LINKS)
TICKS = 40


def profile(availability=1.0, delay_ticks=0, **changes):
    shares, waits = np.broadcast_to(availability, SIZE), np.broadcast_to(delay_ticks, SIZE)
    lossy = quiet_profile(LINKS, CHANNELS, chains=(losing(shares),), delays=taking(waits))
    return replace(lossy, **changes)


def everything():
    return everything_on(CHANNELS, LINKS)


def always(ticks):
    return [everything()] * ticks


def medium(standing, faults=(), seed=1, degraded=()):
    return Medium(seed, CHANNELS, [standing, *degraded], Timeline(LINKS, faults))


def judged(standing, faults=(), seed=1, offered=None, position=None):
    """What becomes of the messages of the first tick, shape (C, L)."""
    flying = medium(standing, faults, seed)
    _, verdicts = flying.judge(flying.begin(), 0, everything() if offered is None else offered, position)
    return verdicts.kind


def verdicts(standing, ticks, faults=(), seed=1):
    """What becomes of a message on every channel and link in every tick, shape (ticks, C, L)."""
    return verdicts_of(seed, CHANNELS, standing, Timeline(LINKS, faults), ticks)


# ---- verdicts


def test_a_perfect_link_delivers_all_that_is_offered_and_nothing_else():
    offered = everything()
    offered[1, 3] = False
    kinds = judged(quiet_profile(LINKS, CHANNELS), offered=offered)
    assert kinds[1, 3] == Verdict.SILENT
    assert (kinds[offered] == Verdict.DELIVERED).all()


def test_a_link_without_availability_loses_all():
    assert (verdicts(profile(availability=0.0), 100) == Verdict.LOST).all()


def test_silence_is_silence_even_on_a_cut_link():
    assert (
        judged(profile(), [Fault(Verb.CUT, 0, None, pairs=((1, 2),))], offered=~everything()) == Verdict.SILENT
    ).all()


ROW = LINKS.index[1, 2]
ON_1_2 = np.arange(SIZE) == ROW
STANDING = np.arange(10.0).reshape(5, 2)  # agents more than 2 m apart, and within 20 m


def with_closed(standing):
    closed = Schedule(np.full(SIZE, 2), np.ones(SIZE, dtype=int), np.ones(SIZE, dtype=int), True, True)
    return replace(standing, schedules=(closed,))


def with_nothing_in_range(standing):
    return replace(standing, reaches=(Reach(ReachLaw.RAMP, ON_1_2, 2.0, 2.0, 0.0, 0.0, 1, True, True),))


def with_all_jammed(standing):
    return replace(standing, zones=(Zone(np.zeros(2), 20.0, 1.0, ON_1_2, True, True),))


def with_all_listed(standing):
    return replace(standing, listed=np.array([[ROW, 0, 1, 1]]))


def with_all_lost(standing):
    return replace(standing, chains=(losing(np.zeros(SIZE)),))


def with_no_queue(standing):
    return replace(standing, rate=Rate(np.ones(SIZE), np.zeros(SIZE), np.zeros(SIZE)))


HOLDING_LINK_1_2 = [
    (Verdict.DEAD, Fault(Verb.KILL, 0, None, agents=(2,))),
    (Verdict.PAUSED, Fault(Verb.PAUSE, 0, None, agents=(2,))),
    (Verdict.DEPARTED, Fault(Verb.DEPART, 0, None, agents=(2,))),
    (Verdict.CUT, Fault(Verb.CUT, 0, None, pairs=((1, 2),))),
    (Verdict.PARTITION, Fault(Verb.PARTITION, 0, None, groups=((1,), (2,)))),
    (Verdict.SCRIPTED, Fault(Verb.LOSE, 0, None, pairs=((1, 2),), probability=1.0)),
    (Verdict.DROPOUT, Fault(Verb.DROPOUT, 0, None, pairs=((1, 2),), probability=1.0)),
    (Verdict.CLOSED, with_closed),
    (Verdict.RANGE, with_nothing_in_range),
    (Verdict.JAMMED, with_all_jammed),
    (Verdict.LISTED, with_all_listed),
    (Verdict.LOST, with_all_lost),
    (Verdict.OVERFLOW, with_no_queue),
]


def test_there_is_a_case_for_every_reason():
    in_lockstep = tuple(kind for kind in REASONS if kind != Verdict.UNSAID)
    assert tuple(kind for kind, _ in HOLDING_LINK_1_2) == in_lockstep


@pytest.mark.parametrize("hidden", range(len(HOLDING_LINK_1_2)))
@pytest.mark.parametrize("order", [1, -1])
def test_a_message_is_booked_under_the_strongest_layer_that_holds_it(hidden, order):
    standing, layers = quiet_profile(LINKS, CHANNELS), [layer for _, layer in HOLDING_LINK_1_2[hidden:]]
    faults = [layer for layer in layers if isinstance(layer, Fault)][::order]
    for impair in layers:
        standing = standing if isinstance(impair, Fault) else impair(standing)
    strongest, _ = HOLDING_LINK_1_2[hidden]
    kinds = judged(standing, faults, position=STANDING)[:, ROW]
    heard, _ = HOLDING_LINK_1_2[hidden + (strongest == Verdict.DROPOUT)]  # only sensors drop out
    assert (kinds[1:] == heard).all()
    assert kinds[0] == (Verdict.DELIVERED if strongest == Verdict.OVERFLOW else strongest)  # sensing has no queue


def test_a_dead_agent_is_neither_sensed_nor_heard_nor_reached():
    kinds = judged(profile(), [Fault(Verb.KILL, 0, None, agents=(4,))])
    touched = (LINKS.src == 4) | (LINKS.dst == 4)
    assert (kinds[:, touched] == Verdict.DEAD).all()
    assert (kinds[:, ~touched] == Verdict.DELIVERED).all()


def test_a_cut_one_way_leaves_the_way_back():
    kinds = judged(profile(), [Fault(Verb.CUT, 0, None, pairs=((1, 2),))])
    assert (kinds[:, LINKS.index[1, 2]] == Verdict.CUT).all()
    assert (kinds[:, LINKS.index[2, 1]] == Verdict.DELIVERED).all()


def test_layers_are_independent():
    faults = [
        Fault(Verb.CUT, 5, 25, pairs=((1, 2), (4, 3))),
        Fault(Verb.PARTITION, 10, 30, groups=((1, 2), (3, 4, 5))),
        Fault(Verb.DEPART, 15, 35, agents=(3,)),
        Fault(Verb.KILL, 20, 28, agents=(2,)),
        Fault(Verb.PAUSE, 18, 26, agents=(5,)),
        Fault(Verb.LOSE, 3, 37, pairs=((1, 2), (1, 3), (5, 1)), probability=0.5),
        Fault(Verb.DROPOUT, 3, 37, pairs=((1, 2), (5, 4)), probability=0.5),
    ]
    trace = Trace(np.array([0]), np.full((1, SIZE), 0.8), sensing=True, comms=True)
    duty = Schedule(np.full(SIZE, 7), np.arange(SIZE) % 7, np.full(SIZE, 5), sensing=True, comms=True)
    layers = {
        "chains": (losing(np.full(SIZE, 0.6)),),
        "traces": (trace,),
        "schedules": (duty,),
        "listed": np.array([[0, 3, 1, 1], [4, 17, 1, 1], [4, 18, 1, 1]]),
    }
    quiet = quiet_profile(LINKS, CHANNELS)
    alone = [verdicts(quiet, TICKS, [fault]) for fault in faults]
    alone += [verdicts(replace(quiet, **{name: layer}), TICKS) for name, layer in layers.items()]
    together = verdicts(replace(quiet, **layers), TICKS, faults)
    dropped = np.stack([np.where(kinds >= Verdict.DEAD, kinds, 255) for kinds in alone])
    strongest = dropped.min(axis=0)
    assert (together == np.where(strongest == 255, Verdict.DELIVERED, strongest)).all()
    assert set(np.unique(together)) == {Verdict.DELIVERED, *REASONS} - {
        Verdict.RANGE,
        Verdict.JAMMED,
        Verdict.OVERFLOW,
        Verdict.UNSAID,
    }


def test_what_is_judged_first_does_not_matter():
    flying = medium(profile(availability=0.5), [Fault(Verb.CUT, 9, 12, pairs=((1, 2),))])
    forward = [flying.judge(flying.begin(), tick, everything(), None)[1].kind for tick in range(TICKS)]
    assert len(np.unique(forward, axis=0)) > TICKS / 2
    for tick in reversed(range(TICKS)):
        assert (flying.judge(flying.begin(), tick, everything(), None)[1].kind == forward[tick]).all()


@pytest.mark.parametrize("impair", [with_nothing_in_range, with_all_jammed])
def test_what_positions_decide_needs_them(impair):
    standing = impair(profile())
    assert not medium(standing).ahead
    assert medium(profile()).ahead
    with pytest.raises(ValueError, match="need the positions of the tick"):
        judged(standing)


def test_a_zone_jams_the_links_it_can_toward_agents_inside_in_its_share_of_ticks_all_at_once():
    rows = LINKS.src != 3
    zone = Zone(np.array([0.0, 1.0]), 3.0, 0.4, rows, sensing=False, comms=True)
    inside = rows & np.isin(LINKS.dst, [1, 2])  # agents 1 and 2 are 0 m and 2.8 m from its centre, agent 3 is 5.7 m
    flown = fly(medium(profile(zones=(zone,), coupled=False)), always(500), np.broadcast_to(STANDING, (500, 5, 2)))
    jammed = np.array([tick.verdicts.kind == Verdict.JAMMED for tick in flown])
    on = jammed.any(axis=(1, 2))
    assert (jammed[on][:, 1:] == inside).all()
    assert not jammed[:, 0].any()
    assert abs(on.sum() - 500 * 0.4) < 3 * np.sqrt(500 * 0.4 * 0.6)


def test_a_disk_holds_the_links_it_can_that_are_too_long():
    rows = LINKS.src != 3
    disk = Reach(ReachLaw.RAMP, rows, 3.0, 3.0, 0.0, 0.0, 1, sensing=True, comms=False)
    kinds = judged(profile(reaches=(disk,), coupled=False), position=STANDING)
    neighbours = abs(LINKS.src - LINKS.dst) == 1  # 2.8 m apart, the others more
    assert (kinds[0] == np.where(rows & ~neighbours, Verdict.RANGE, Verdict.DELIVERED)).all()
    assert (kinds[1:] == Verdict.DELIVERED).all()


# ---- loss


def test_messages_are_lost_at_the_rate_of_their_link():
    availability = np.linspace(0.05, 0.95, SIZE)
    ticks = 2000
    kinds = verdicts(profile(availability, coupled=False), ticks, seed=3)
    delivered = (kinds == Verdict.DELIVERED).sum(axis=(0, 1))
    offered = ticks * len(CHANNELS)
    sigma = np.sqrt(offered * availability * (1.0 - availability))
    assert (abs(delivered - offered * availability) < 3 * sigma).all()


def test_coupled_channels_share_one_verdict_per_link_and_tick():
    kinds = verdicts(profile(availability=0.5), 200, seed=3)
    assert (kinds == kinds[:, :1]).all()
    assert {Verdict.LOST, Verdict.DELIVERED} == set(np.unique(kinds))


def test_uncoupled_channels_are_lost_independently():
    kinds = verdicts(profile(availability=0.5, coupled=False), 2000, seed=3)
    heard = kinds == Verdict.DELIVERED
    all_three, offered = heard.all(axis=1).sum(), 2000 * SIZE
    assert abs(all_three - offered / 8) < 3 * np.sqrt(offered * 1 / 8 * 7 / 8)


@pytest.mark.parametrize("sensing", [True, False])
def test_uncoupled_losses_strike_the_channels_of_their_class_alone(sensing):
    layer = replace(losing(np.zeros(SIZE)), sensing=sensing, comms=not sensing)
    kinds = judged(quiet_profile(LINKS, CHANNELS, chains=(layer,), coupled=False))
    struck = np.array([sensing, not sensing, not sensing])
    assert (kinds[struck] == Verdict.LOST).all()
    assert (kinds[~struck] == Verdict.DELIVERED).all()


def test_the_two_directions_of_an_edge_are_lost_independently():
    kinds = verdicts(profile(availability=0.5), 4000, seed=3)[:, 0]
    there, back = (kinds[:, LINKS.index[pair]] == Verdict.DELIVERED for pair in ((1, 2), (2, 1)))
    assert abs((there & back).sum() - 1000) < 3 * np.sqrt(4000 * 1 / 4 * 3 / 4)


def test_another_seed_loses_other_messages():
    one, two = (verdicts(profile(availability=0.5), 50, seed=seed) for seed in (1, 2))
    assert (one != two).mean() == pytest.approx(0.5, abs=0.1)


def test_scripted_loss_comes_on_top_of_the_loss_of_the_air():
    lose = Fault(Verb.LOSE, 0, None, pairs=tuple(LINKS.index), probability=0.4)
    kinds = verdicts(profile(availability=0.7, coupled=False), 1000, [lose, lose], seed=3)
    messages = kinds.size
    for kind, share in (
        (Verdict.SCRIPTED, 1 - 0.6**2),
        (Verdict.LOST, 0.6**2 * 0.3),
        (Verdict.DELIVERED, 0.6**2 * 0.7),
    ):
        assert abs((kinds == kind).sum() - messages * share) < 3 * np.sqrt(messages * share * (1 - share))


# ---- delay


@pytest.mark.parametrize("least_delay", [0, 1], ids=["same-tick", "next-tick"])
@pytest.mark.parametrize("delay_ticks", [0, 1, 2, 5])
def test_a_message_arrives_exactly_its_delay_later(delay_ticks, least_delay):
    flown = fly(medium(profile(delay_ticks=delay_ticks, least_delay=least_delay)), always(TICKS))
    takes = max(delay_ticks, least_delay)
    for tick, (_, delivery, _) in enumerate(flown):
        assert (delivery.newest[0] == tick).all()  # sensing is not delayed
        assert (delivery.newest[1:] == (tick - takes if tick >= takes else -1)).all()


def test_a_delayed_message_arrives_once():
    offered = [everything() if tick == 3 else ~everything() for tick in range(TICKS)]
    flown = fly(medium(profile(delay_ticks=4)), offered)
    arrivals = {tick: delivery.late for tick, (_, delivery, _) in enumerate(flown) if delivery.late}
    assert arrivals == {7: 2 * SIZE}
    assert len(flown[7].delivery.apart) == 2 * SIZE
    assert flown[-1].air.in_flight == 0


def test_each_link_has_its_own_delay():
    delays = np.arange(SIZE) % 4
    flown = fly(medium(profile(delay_ticks=delays)), always(10))
    assert (flown[9].delivery.newest[1:] == 9 - delays).all()


def test_delays_of_a_link_add_up():
    rows = np.ones(SIZE, dtype=bool)
    standing = quiet_profile(LINKS, CHANNELS, delays=(constant(0.2, rows), constant(1.4 * DT, rows)))
    flown = fly(medium(standing), always(10))
    assert (flown[9].delivery.newest[1:] == 9 - 4).all()  # 2 and 1.4 ticks: the exchange at or after 3.4


def test_late_messages_come_in_the_order_of_tick_link_and_channel():
    delays = np.arange(SIZE) % 4
    late = fly(medium(profile(delay_ticks=delays)), always(10))[9].delivery.apart.tolist()
    expected = [[9 - delays[link], link, channel, 0] for link in range(12) if delays[link] for channel in (1, 2)]
    assert late == sorted(expected)


def test_what_is_under_way_when_the_run_ends_is_in_flight():
    flown = fly(medium(profile(delay_ticks=3)), [*always(10), *[~everything()] * 3])
    assert flown[9].air.in_flight == 3 * 2 * SIZE
    assert [tick.delivery.late for tick in flown[10:]] == [2 * SIZE] * 3
    assert flown[-1].air.in_flight == 0


# ---- scripted delay


def late(seconds, *pairs, start=0, end=None):
    return Fault(Verb.DELAY, start, end, pairs=pairs, seconds=seconds)


def test_a_scripted_delay_delays_what_is_said_on_its_links_while_it_lasts_and_no_sensing():
    flown = fly(medium(profile(), [late(0.25, (1, 2), start=5, end=8)]), always(12))
    waits = np.array([tick.verdicts.due - k for k, tick in enumerate(flown)])
    expected = np.zeros((12, len(CHANNELS), SIZE), dtype=int)
    expected[5:8, 1:, ROW] = 3  # 2.5 ticks: the exchange after
    np.testing.assert_array_equal(waits, expected)
    kinds = np.array([tick.verdicts.kind for tick in flown])
    np.testing.assert_array_equal(kinds, np.where(expected > 0, Verdict.DELAYED, Verdict.DELIVERED))


def test_scripted_delays_add_up_with_each_other_and_with_those_of_the_air():
    faults = [late(0.14, (1, 2)), late(0.14, (1, 2), (2, 1))]
    flown = fly(medium(profile(delay_ticks=1), faults), always(1))
    assert flown[0].verdicts.due[1:, ROW].tolist() == [4, 4]  # 1 + 1.4 + 1.4
    assert flown[0].verdicts.due[1:, LINKS.index[2, 1]].tolist() == [3, 3]
    assert flown[0].verdicts.due[1:, LINKS.index[3, 4]].tolist() == [1, 1]


def test_a_scripted_delay_is_counted_with_the_wait_in_the_queue():
    rate = Rate(np.full(SIZE, BITS / DT / 0.3), np.full(SIZE, 0.0), np.full(SIZE, 9e9))
    alone, together = (
        fly(medium(profile(rate=rate), faults), always(1))[0].verdicts.due[1:, ROW].tolist()
        for faults in ([], [late(0.05, (1, 2))])
    )
    assert alone == [1, 1]  # 0.3 and 0.6 ticks of sending
    assert together == [1, 2]  # 0.8 and 1.1


def test_a_copy_is_delayed_as_its_message_is():
    doubled = medium(profile(duplicate=np.ones(SIZE)), [late(0.25, (1, 2))])
    verdicts = fly(doubled, always(1))[0].verdicts
    assert verdicts.copy_due[1:, ROW].tolist() == verdicts.due[1:, ROW].tolist() == [3, 3]
    assert (verdicts.copy_due[0] == -1).all()


@pytest.mark.parametrize("ordered", [True, False])
def test_what_is_sent_when_a_scripted_delay_is_over_overtakes_only_where_order_is_not_kept(ordered):
    here = constant(0.0, np.ones(SIZE, dtype=bool), ordered=ordered)
    standing = quiet_profile(LINKS, CHANNELS, delays=(here,))
    flown = fly(medium(standing, [late(0.3, (1, 2), start=2, end=3)]), always(7))
    due = [int(tick.verdicts.due[1, ROW]) for tick in flown]
    assert due == ([0, 1, 5, 5, 5, 5, 6] if ordered else [0, 1, 5, 3, 4, 5, 6])


# ---- links that are degraded


MIXED = [mixture(mix, IMPAIRMENTS, LINKS, CHANNELS, coupled=False) for mix in (3, 4)]
DEGRADED = Fault(Verb.DEGRADE, 10, 25, pairs=((1, 2), (4, 3)), profile=1)
RULED = np.isin(np.arange(SIZE), [LINKS.index[pair] for pair in DEGRADED.pairs])


def whole(flown):
    """All of the verdicts, shape (ticks, 4, C, L)."""
    return np.array([[field.astype(np.int64) for field in tick.verdicts] for tick in flown])


@pytest.fixture(scope="module")
def flights():
    """A flight where two links are degraded for a while, and flights under either profile alone."""
    position = roaming(3, 5, TICKS)
    mixed = fly(medium(MIXED[0], [DEGRADED], degraded=MIXED[1:]), always(TICKS), position)
    return whole(mixed), *(whole(fly(medium(alone), always(TICKS), position)) for alone in MIXED)


def test_links_that_are_not_degraded_do_not_change_by_a_bit(flights):
    mixed, own, _ = flights
    np.testing.assert_array_equal(mixed[..., ~RULED], own[..., ~RULED])
    np.testing.assert_array_equal(mixed[:10], own[:10])
    assert (mixed[10:25][..., RULED] != own[10:25][..., RULED]).any()


def test_a_degraded_link_has_the_verdicts_of_the_other_profile_for_as_long_as_it_lasts():
    apart = [name for name in IMPAIRMENTS if name not in ("chains", "chains of one class", "ordered", "rate")]
    own, other = (mixture(mix, apart, LINKS, CHANNELS, coupled=False) for mix in (3, 4))
    position = roaming(3, 5, TICKS)
    mixed, before, during = (
        whole(fly(flying, always(TICKS), position))
        for flying in (medium(own, [DEGRADED], degraded=[other]), medium(own), medium(other))
    )
    np.testing.assert_array_equal(mixed[10:25][..., RULED], during[10:25][..., RULED])
    np.testing.assert_array_equal(mixed[25:], before[25:])
    assert (before[10:25][..., RULED] != during[10:25][..., RULED]).any()


def test_a_link_that_is_degraded_to_its_own_profile_does_not_change_by_a_bit_where_nothing_remembers():
    by_time = [name for name in IMPAIRMENTS if name not in ("chains", "chains of one class", "rate", "rate over time")]
    own, position = mixture(3, by_time, LINKS, CHANNELS, coupled=False), roaming(3, 5, TICKS)
    flights = [whole(fly(medium(own, faults, degraded=[own]), always(TICKS), position)) for faults in ([], [DEGRADED])]
    np.testing.assert_array_equal(*flights)


def test_the_queue_of_a_degraded_link_empties_while_another_profile_rules_it():
    queued = Rate(np.full(SIZE, BITS / DT), np.zeros(SIZE), np.full(SIZE, 9e9))  # a tick for a message, two are sent
    faults = [Fault(Verb.DEGRADE, 4, 7, pairs=((1, 2),), profile=1)]
    flown = fly(medium(profile(rate=queued), faults, degraded=[profile()]), always(9))
    wait = np.array([tick.verdicts.due[2] - k for k, tick in enumerate(flown)])
    assert wait[:, ROW].tolist() == [2, 3, 4, 5, 0, 0, 0, 3, 4]  # 5 owed in tick 3, 4 ticks later 1
    assert wait[:, LINKS.index[2, 1]].tolist() == [2, 3, 4, 5, 6, 7, 8, 9, 10]


def test_the_queue_of_a_profile_empties_while_it_rules_no_link():
    queued = Rate(np.full(SIZE, BITS / DT), np.zeros(SIZE), np.full(SIZE, 9e9))  # a tick for a message, two are sent
    faults = [Fault(Verb.DEGRADE, *span, pairs=((1, 2),), profile=1) for span in ((0, 4), (7, 9))]
    flown = fly(medium(profile(), faults, degraded=[profile(rate=queued)]), always(9))
    wait = np.array([tick.verdicts.due[2] - k for k, tick in enumerate(flown)])
    assert wait[:, ROW].tolist() == [2, 3, 4, 5, 0, 0, 0, 3, 4]  # 5 owed in tick 3, 4 ticks later 1


def test_the_profile_of_the_higher_number_rules_a_link_that_is_degraded_twice():
    degraded = [profile(delay_ticks=wait) for wait in (2, 4)]
    faults = [Fault(Verb.DEGRADE, 0, None, pairs=((1, 2),), profile=number) for number in (2, 1)]
    flown = fly(medium(profile(), [*faults, replace(faults[1], pairs=((2, 1),))], degraded=degraded), always(1))
    due = flown[0].verdicts.due[1]
    assert (due[ROW], due[LINKS.index[2, 1]], due[LINKS.index[3, 4]]) == (4, 2, 0)


def test_messages_keep_their_order_where_the_profile_that_rules_them_keeps_it():
    rows = np.ones(SIZE, dtype=bool)
    ordered = quiet_profile(LINKS, CHANNELS, delays=(constant(0.0, rows, ordered=True),))
    slow = quiet_profile(LINKS, CHANNELS, delays=(constant(0.4, rows),))
    back = fly(medium(ordered, [Fault(Verb.DEGRADE, 2, 3, pairs=((1, 2),), profile=1)], degraded=[slow]), always(7))
    assert [int(tick.verdicts.due[1, ROW]) for tick in back] == [0, 1, 6, 6, 6, 6, 6]


def test_a_bias_is_that_of_the_profile_that_ruled_the_link_when_the_message_was_sent():
    own, other = (profile(bias=np.full(SIZE, bias)) for bias in (1.0, 2.0))
    flying = medium(own, [DEGRADED], degraded=[other])
    content, link = np.array([9, 10, 24, 25, 12]), np.array([ROW, ROW, ROW, ROW, LINKS.index[2, 1]])
    assert flying.bias(content, link).tolist() == [1.0, 2.0, 2.0, 1.0, 1.0]


def test_a_run_that_may_be_degraded_to_a_profile_of_places_needs_positions():
    assert not medium(profile(), degraded=[with_all_jammed(profile())]).ahead
    assert medium(profile(), degraded=[profile()]).ahead


def test_a_run_that_waits_for_a_trigger_cannot_be_judged_ahead():
    waiting = Timeline(LINKS, [replace(DEGRADED, trigger=0)], [Trigger(1.0, above=True, ticks=1)])
    assert not Medium(1, CHANNELS, MIXED[:1], waiting).ahead
    flying = Medium(1, CHANNELS, [profile(), profile()], waiting)
    flying.timeline = waiting.fired([0], 3)
    assert flying.ahead


# ---- agents that are paused

TOWARD_2 = LINKS.dst == 2


def paused(policy):
    return [Fault(Verb.PAUSE, 5, 8, agents=(2,), under_way=policy)]


def arrivals(flown, row=ROW, channel=1):
    """(tick, content tick) of what arrives on a link and channel."""
    return [
        (tick, content)
        for tick, (_, delivery, _) in enumerate(flown)
        for content in [
            *(here[0] for here in delivery.apart.tolist() if here[1:3] == [row, channel]),
            *([tick] if delivery.plain[channel, row] else []),
        ]
    ]


def test_what_is_sent_to_a_paused_agent_waits_and_arrives_in_order_when_it_goes_on():
    flown = fly(medium(profile(), paused(UnderWay.HOLD)), always(10))
    assert arrivals(flown) == [*((k, k) for k in range(5)), (8, 5), (8, 6), (8, 7), (8, 8), (9, 9)]
    assert [tick.air.in_flight for tick in flown] == [0] * 5 + [2 * TOWARD_2.sum() * n for n in (1, 2, 3)] + [0, 0]
    released = flown[8].delivery.released
    assert {(sent, link) for sent, _, link, _ in released.tolist()} == {
        (sent, link) for sent in (5, 6, 7) for link in np.flatnonzero(TOWARD_2).tolist()
    }


@pytest.mark.parametrize("policy", [UnderWay.HOLD, UnderWay.DROP])
def test_a_paused_agent_measures_nothing_and_is_measured_and_heard_by_others(policy):
    kinds = np.array([tick.verdicts.kind for tick in fly(medium(profile(), paused(policy)), always(10))])
    heard = {UnderWay.HOLD: Verdict.DELAYED, UnderWay.DROP: Verdict.PAUSED}[policy]
    assert (kinds[5:8, 0][:, TOWARD_2] == Verdict.PAUSED).all()
    assert (kinds[5:8, 1:][..., TOWARD_2] == heard).all()
    assert (kinds[..., ~TOWARD_2] == Verdict.DELIVERED).all()
    assert (kinds[[0, 4, 8, 9]] == Verdict.DELIVERED).all()


@pytest.mark.parametrize("policy", [UnderWay.HOLD, UnderWay.DROP])
def test_what_is_under_way_to_an_agent_when_it_is_paused_waits_with_the_rest_or_is_dropped_with_it(policy):
    flown = fly(medium(profile(delay_ticks=2), paused(policy)), always(12))
    before, after = [(2, 0), (3, 1), (4, 2)], [(10, 8), (11, 9)]
    if policy is UnderWay.HOLD:
        assert arrivals(flown) == [*before, (8, 3), (8, 4), (8, 5), (8, 6), (9, 7), *after]
        assert not any(len(tick.delivery.dropped) for tick in flown)
    else:
        assert arrivals(flown) == [*before, *after]
        dropped = flown[5].delivery.dropped
        assert set(dropped[:, 4]) == {Verdict.PAUSED}
        assert len(dropped) == 2 * 2 * TOWARD_2.sum()
        assert set(dropped[:, 2]) == set(np.flatnonzero(TOWARD_2))


def test_what_waits_for_a_paused_agent_that_dies_is_dropped_for_its_death():
    faults = [*paused(UnderWay.HOLD), Fault(Verb.KILL, 7, None, agents=(2,))]
    flown = fly(medium(profile(), faults), always(10))
    assert set(flown[7].delivery.dropped[:, 4]) == {Verdict.DEAD}
    assert len(flown[7].delivery.dropped) == 2 * 2 * TOWARD_2.sum()
    assert flown[-1].air.in_flight == 0


def test_of_two_pauses_one_that_drops_takes_what_the_other_holds():
    faults = [*paused(UnderWay.HOLD), Fault(Verb.PAUSE, 6, 7, agents=(2,))]
    flown = fly(medium(profile(), faults), always(10))
    assert arrivals(flown) == [*((k, k) for k in range(5)), (8, 7), (8, 8), (9, 9)]
    assert {(sent, kind) for sent, *_, kind in flown[6].delivery.dropped.tolist()} == {(5, Verdict.PAUSED)}


def test_what_is_lost_on_its_way_to_a_paused_agent_does_not_wait_for_it():
    flown = fly(medium(profile(availability=0.5), paused(UnderWay.HOLD)), always(10))
    alone = fly(medium(profile(availability=0.5)), always(10))
    assert arrivals(flown, ROW) == [(max(k, 8) if 5 <= k < 8 else k, k) for k, _ in arrivals(alone, ROW)]
    assert 0 < sum(5 <= k < 8 for k, _ in arrivals(alone, ROW)) < 3


# ---- sensors that drop out


def test_only_sensing_drops_out_on_its_links_as_often_as_asked_for():
    fault = Fault(Verb.DROPOUT, 0, None, pairs=((1, 2), (2, 3)), probability=0.3)
    kinds = verdicts(profile(coupled=False), 2000, [fault], seed=3)
    struck = np.isin(np.arange(SIZE), [ROW, LINKS.index[2, 3]])
    assert (kinds[:, 1:] == Verdict.DELIVERED).all()
    assert (kinds[:, 0, ~struck] == Verdict.DELIVERED).all()
    assert set(np.unique(kinds[:, 0, struck])) == {Verdict.DELIVERED, Verdict.DROPOUT}
    for row in np.flatnonzero(struck):
        assert abs((kinds[:, 0, row] == Verdict.DROPOUT).sum() - 600) < 3 * np.sqrt(2000 * 0.3 * 0.7)


@pytest.mark.parametrize("coupled", [True, False])
def test_a_sensor_that_drops_out_takes_no_word_with_it(coupled):
    everywhere = Fault(Verb.DROPOUT, 0, None, pairs=tuple(LINKS.index), probability=1.0)
    kinds = judged(profile(coupled=coupled), [everywhere])
    assert (kinds[0] == Verdict.DROPOUT).all()
    assert (kinds[1:] == Verdict.DELIVERED).all()


def test_dropouts_are_independent_of_scripted_losses_and_of_each_other():
    everywhere = {"pairs": tuple(LINKS.index), "probability": 0.5}
    drop, lose = (Fault(verb, 0, None, **everywhere) for verb in (Verb.DROPOUT, Verb.LOSE))
    missing = verdicts(profile(), 500, [drop, drop], seed=3)[:, 0] == Verdict.DROPOUT
    lost = verdicts(profile(), 500, [lose], seed=3)[:, 0] == Verdict.SCRIPTED
    assert missing.mean() == pytest.approx(0.75, abs=0.02)
    assert (missing & lost).mean() == pytest.approx(0.375, abs=0.02)


# ---- accounts


def test_the_ledger_names_each_reason_that_occurred():
    kinds = np.array(
        [[[Verdict.DELIVERED, Verdict.LOST, Verdict.CUT, Verdict.DELAYED, Verdict.DELAYED, Verdict.SILENT]]],
        dtype=np.uint8,
    )
    dropped = np.zeros((1, len(Verdict)), dtype=np.int64)
    dropped[0, Verdict.DEAD] = 1
    ledger = Ledger.of(kinds, copies=np.array([0]), late=np.array([0]), dropped=dropped)
    assert ledger == Ledger(offered=5, copies=0, delivered=1, dropped={"dead": 1, "cut": 1, "lost": 1})
    assert Accounts(1, ledger, in_flight=1).close


def test_the_ledger_counts_a_copy_as_a_message_of_its_own():
    kinds = np.array([[[Verdict.DELIVERED, Verdict.DELAYED]], [[Verdict.SILENT, Verdict.SILENT]]], dtype=np.uint8)
    nothing = np.zeros((2, len(Verdict)), dtype=np.int64)
    ledger = Ledger.of(kinds, copies=np.array([2, 0]), late=np.array([1, 1]), dropped=nothing)
    assert ledger == Ledger(offered=2, copies=2, delivered=3, dropped={})
    assert Accounts(1, ledger, in_flight=1).close
