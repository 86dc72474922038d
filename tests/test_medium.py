"""The medium: every message offered is delivered, dropped for one reason, or in flight; layers and draws do not mix."""

from dataclasses import replace

import numpy as np
import pytest
from airs import DT, constant, fates_of, fly, losing, quiet_profile, taking
from airs import everything as everything_on

from netem.fate import REASONS, Fate, Ledger
from netem.fault import Fault, Verb
from netem.jamming import Zone
from netem.links import Links
from netem.medium import Medium
from netem.rate import Rate
from netem.reach import Law, Reach
from netem.schedule import Schedule
from netem.timeline import Timeline
from netem.trace import Trace

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


def medium(standing, faults=(), seed=1):
    return Medium(seed, CHANNELS, [standing], Timeline(LINKS, faults))


def judged(standing, faults=(), seed=1, offered=None, position=None):
    """What becomes of the messages of the first tick, shape (C, L)."""
    flying = medium(standing, faults, seed)
    _, verdicts = flying.judge(flying.begin(), 0, everything() if offered is None else offered, position)
    return verdicts.fate


def verdicts(standing, ticks, faults=(), seed=1):
    """What becomes of a message on every channel and link in every tick, shape (ticks, C, L)."""
    return fates_of(seed, CHANNELS, standing, Timeline(LINKS, faults), ticks)


# ---- verdicts


def test_a_perfect_link_delivers_all_that_is_offered_and_nothing_else():
    offered = everything()
    offered[1, 3] = False
    fates = judged(quiet_profile(LINKS, CHANNELS), offered=offered)
    assert fates[1, 3] == Fate.SILENT
    assert (fates[offered] == Fate.DELIVERED).all()


def test_a_link_without_availability_loses_all():
    assert (verdicts(profile(availability=0.0), 100) == Fate.LOST).all()


def test_silence_is_silence_even_on_a_cut_link():
    assert (judged(profile(), [Fault(Verb.CUT, 0, None, pairs=((1, 2),))], offered=~everything()) == Fate.SILENT).all()


ROW = LINKS.index[1, 2]
ON_1_2 = np.arange(SIZE) == ROW
STANDING = np.arange(10.0).reshape(5, 2)  # agents more than 2 m apart, and within 20 m


def with_closed(standing):
    closed = Schedule(np.full(SIZE, 2), np.ones(SIZE, dtype=int), np.ones(SIZE, dtype=int), True, True)
    return replace(standing, schedules=(closed,))


def with_nothing_in_range(standing):
    return replace(standing, reaches=(Reach(Law.RAMP, ON_1_2, 2.0, 2.0, 0.0, 0.0, 1, True, True),))


def with_all_jammed(standing):
    return replace(standing, zones=(Zone(np.zeros(2), 20.0, 1.0, ON_1_2, True, True),))


def with_all_listed(standing):
    return replace(standing, listed=np.array([[ROW, 0, 1, 1]]))


def with_all_lost(standing):
    return replace(standing, chains=(losing(np.zeros(SIZE)),))


def with_no_queue(standing):
    return replace(standing, rate=Rate(np.ones(SIZE), np.zeros(SIZE), np.zeros(SIZE)))


HOLDING_LINK_1_2 = [
    (Fate.DEAD, Fault(Verb.KILL, 0, None, agents=(2,))),
    (Fate.DEPARTED, Fault(Verb.DEPART, 0, None, agents=(2,))),
    (Fate.CUT, Fault(Verb.CUT, 0, None, pairs=((1, 2),))),
    (Fate.PARTITION, Fault(Verb.PARTITION, 0, None, groups=((1,), (2,)))),
    (Fate.SCRIPTED, Fault(Verb.LOSE, 0, None, pairs=((1, 2),), probability=1.0)),
    (Fate.CLOSED, with_closed),
    (Fate.RANGE, with_nothing_in_range),
    (Fate.JAMMED, with_all_jammed),
    (Fate.LISTED, with_all_listed),
    (Fate.LOST, with_all_lost),
    (Fate.OVERFLOW, with_no_queue),
]


def test_there_is_a_case_for_every_reason():
    assert tuple(fate for fate, _ in HOLDING_LINK_1_2) == REASONS


@pytest.mark.parametrize("hidden", range(len(HOLDING_LINK_1_2)))
@pytest.mark.parametrize("order", [1, -1])
def test_a_message_is_booked_under_the_strongest_layer_that_holds_it(hidden, order):
    standing, layers = quiet_profile(LINKS, CHANNELS), [layer for _, layer in HOLDING_LINK_1_2[hidden:]]
    faults = [layer for layer in layers if isinstance(layer, Fault)][::order]
    for impair in layers:
        standing = standing if isinstance(impair, Fault) else impair(standing)
    strongest, _ = HOLDING_LINK_1_2[hidden]
    fates = judged(standing, faults, position=STANDING)[:, ROW]
    assert (fates[1:] == strongest).all()
    assert fates[0] == (Fate.DELIVERED if strongest == Fate.OVERFLOW else strongest)  # sensing has no queue


def test_a_dead_agent_is_neither_sensed_nor_heard_nor_reached():
    fates = judged(profile(), [Fault(Verb.KILL, 0, None, agents=(4,))])
    touched = (LINKS.src == 4) | (LINKS.dst == 4)
    assert (fates[:, touched] == Fate.DEAD).all()
    assert (fates[:, ~touched] == Fate.DELIVERED).all()


def test_a_cut_one_way_leaves_the_way_back():
    fates = judged(profile(), [Fault(Verb.CUT, 0, None, pairs=((1, 2),))])
    assert (fates[:, LINKS.index[1, 2]] == Fate.CUT).all()
    assert (fates[:, LINKS.index[2, 1]] == Fate.DELIVERED).all()


def test_layers_are_independent():
    faults = [
        Fault(Verb.CUT, 5, 25, pairs=((1, 2), (4, 3))),
        Fault(Verb.PARTITION, 10, 30, groups=((1, 2), (3, 4, 5))),
        Fault(Verb.DEPART, 15, 35, agents=(3,)),
        Fault(Verb.KILL, 20, 28, agents=(2,)),
        Fault(Verb.LOSE, 3, 37, pairs=((1, 2), (1, 3), (5, 1)), probability=0.5),
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
    dropped = np.stack([np.where(fates >= Fate.DEAD, fates, 255) for fates in alone])
    strongest = dropped.min(axis=0)
    assert (together == np.where(strongest == 255, Fate.DELIVERED, strongest)).all()
    assert set(np.unique(together)) == {Fate.DELIVERED, *REASONS} - {Fate.RANGE, Fate.JAMMED, Fate.OVERFLOW}


def test_what_is_judged_first_does_not_matter():
    flying = medium(profile(availability=0.5), [Fault(Verb.CUT, 9, 12, pairs=((1, 2),))])
    forward = [flying.judge(flying.begin(), tick, everything(), None)[1].fate for tick in range(TICKS)]
    assert len(np.unique(forward, axis=0)) > TICKS / 2
    for tick in reversed(range(TICKS)):
        assert (flying.judge(flying.begin(), tick, everything(), None)[1].fate == forward[tick]).all()


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
    jammed = np.array([tick.verdicts.fate == Fate.JAMMED for tick in flown])
    on = jammed.any(axis=(1, 2))
    assert (jammed[on][:, 1:] == inside).all()
    assert not jammed[:, 0].any()
    assert abs(on.sum() - 500 * 0.4) < 3 * np.sqrt(500 * 0.4 * 0.6)


def test_a_disk_holds_the_links_it_can_that_are_too_long():
    rows = LINKS.src != 3
    disk = Reach(Law.RAMP, rows, 3.0, 3.0, 0.0, 0.0, 1, sensing=True, comms=False)
    fates = judged(profile(reaches=(disk,), coupled=False), position=STANDING)
    neighbours = abs(LINKS.src - LINKS.dst) == 1  # 2.8 m apart, the others more
    assert (fates[0] == np.where(rows & ~neighbours, Fate.RANGE, Fate.DELIVERED)).all()
    assert (fates[1:] == Fate.DELIVERED).all()


# ---- loss


def test_messages_are_lost_at_the_rate_of_their_link():
    availability = np.linspace(0.05, 0.95, SIZE)
    ticks = 2000
    fates = verdicts(profile(availability, coupled=False), ticks, seed=3)
    delivered = (fates == Fate.DELIVERED).sum(axis=(0, 1))
    offered = ticks * len(CHANNELS)
    sigma = np.sqrt(offered * availability * (1.0 - availability))
    assert (abs(delivered - offered * availability) < 3 * sigma).all()


def test_coupled_channels_share_one_verdict_per_link_and_tick():
    fates = verdicts(profile(availability=0.5), 200, seed=3)
    assert (fates == fates[:, :1]).all()
    assert {Fate.LOST, Fate.DELIVERED} == set(np.unique(fates))


def test_uncoupled_channels_are_lost_independently():
    fates = verdicts(profile(availability=0.5, coupled=False), 2000, seed=3)
    heard = fates == Fate.DELIVERED
    all_three, offered = heard.all(axis=1).sum(), 2000 * SIZE
    assert abs(all_three - offered / 8) < 3 * np.sqrt(offered * 1 / 8 * 7 / 8)


@pytest.mark.parametrize("sensing", [True, False])
def test_uncoupled_losses_strike_the_channels_of_their_class_alone(sensing):
    layer = replace(losing(np.zeros(SIZE)), sensing=sensing, comms=not sensing)
    fates = judged(quiet_profile(LINKS, CHANNELS, chains=(layer,), coupled=False))
    struck = np.array([sensing, not sensing, not sensing])
    assert (fates[struck] == Fate.LOST).all()
    assert (fates[~struck] == Fate.DELIVERED).all()


def test_the_two_directions_of_an_edge_are_lost_independently():
    fates = verdicts(profile(availability=0.5), 4000, seed=3)[:, 0]
    there, back = (fates[:, LINKS.index[pair]] == Fate.DELIVERED for pair in ((1, 2), (2, 1)))
    assert abs((there & back).sum() - 1000) < 3 * np.sqrt(4000 * 1 / 4 * 3 / 4)


def test_another_seed_loses_other_messages():
    one, two = (verdicts(profile(availability=0.5), 50, seed=seed) for seed in (1, 2))
    assert (one != two).mean() == pytest.approx(0.5, abs=0.1)


def test_scripted_loss_comes_on_top_of_the_loss_of_the_air():
    lose = Fault(Verb.LOSE, 0, None, pairs=tuple(LINKS.index), probability=0.4)
    fates = verdicts(profile(availability=0.7, coupled=False), 1000, [lose, lose], seed=3)
    messages = fates.size
    for fate, share in ((Fate.SCRIPTED, 1 - 0.6**2), (Fate.LOST, 0.6**2 * 0.3), (Fate.DELIVERED, 0.6**2 * 0.7)):
        assert abs((fates == fate).sum() - messages * share) < 3 * np.sqrt(messages * share * (1 - share))


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


# ---- accounts


def test_the_ledger_names_each_reason_that_occurred():
    fates = np.array([[[Fate.DELIVERED, Fate.LOST, Fate.CUT, Fate.DELAYED, Fate.DELAYED, Fate.SILENT]]], dtype=np.uint8)
    dropped = np.zeros((1, len(Fate)), dtype=np.int64)
    dropped[0, Fate.DEAD] = 1
    ledger = Ledger.of(fates, copies=np.array([0]), late=np.array([0]), dropped=dropped)
    assert ledger == Ledger(offered=5, copies=0, delivered=1, dropped={"dead": 1, "cut": 1, "lost": 1})
    assert ledger.outstanding == 1


def test_the_ledger_counts_a_copy_as_a_message_of_its_own():
    fates = np.array([[[Fate.DELIVERED, Fate.DELAYED]], [[Fate.SILENT, Fate.SILENT]]], dtype=np.uint8)
    nothing = np.zeros((2, len(Fate)), dtype=np.int64)
    ledger = Ledger.of(fates, copies=np.array([2, 0]), late=np.array([1, 1]), dropped=nothing)
    assert ledger == Ledger(offered=2, copies=2, delivered=3, dropped={})
    assert ledger.outstanding == 1
