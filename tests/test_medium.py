"""The medium: every message offered is delivered, dropped for one reason, or in flight; layers and draws do not mix."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netem.links import Links
from netem.medium import REASONS, Fate, InFlight, Ledger, Medium
from netem.profile import Profile
from netem.timeline import Fault, Timeline, Verb

LINKS = Links.both_ways(5, [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1), (1, 3)])
PAIRS = list(LINKS.index)
CHANNELS = ("sense", "input", "theta")
TICKS = 40


def profile(links=LINKS, availability=1.0, delay_ticks=0, coupled=True, least_delay=0):
    size = len(links)
    return Profile(np.full(size, availability), np.full(size, delay_ticks), coupled, least_delay)


def everything(channels=CHANNELS, links=LINKS):
    return np.ones((len(channels), len(links)), dtype=bool)


def verdicts(medium, ticks):
    """What becomes of a message on every channel and link in every tick, shape (ticks, C, L)."""
    return np.stack([medium.judge(tick, everything(medium.channels, medium.links)) for tick in range(ticks)])


def fly(medium, ticks, offered):
    """Per tick, the verdicts and what arrives; and what is in flight in the end."""
    in_flight, flown = InFlight(), []
    for tick in range(ticks):
        fates = medium.judge(tick, offered[tick])
        in_flight, delivery = medium.deliver(tick, in_flight, fates)
        flown.append((fates, delivery))
    return flown, in_flight


# ---- verdicts


def test_a_perfect_link_delivers_all_that_is_offered_and_nothing_else():
    offered = everything()
    offered[1, 3] = False
    fates = Medium(1, CHANNELS, profile(), Timeline(LINKS, [])).judge(0, offered)
    assert fates[1, 3] == Fate.SILENT
    assert (fates[offered] == Fate.DELIVERED).all()


def test_a_link_without_availability_loses_all():
    assert (verdicts(Medium(1, CHANNELS, profile(availability=0.0), Timeline(LINKS, [])), 100) == Fate.LOST).all()


def test_silence_is_silence_even_on_a_cut_link():
    medium = Medium(1, CHANNELS, profile(), Timeline(LINKS, [Fault(Verb.CUT, 0, None, pairs=((1, 2),))]))
    assert (medium.judge(0, ~everything()) == Fate.SILENT).all()


HOLDING_LINK_1_2 = [
    Fault(Verb.KILL, 0, None, agents=(2,)),
    Fault(Verb.DEPART, 0, None, agents=(2,)),
    Fault(Verb.CUT, 0, None, pairs=((1, 2),)),
    Fault(Verb.PARTITION, 0, None, groups=((1,), (2,))),
]


@pytest.mark.parametrize("hidden", range(5))
@pytest.mark.parametrize("order", [1, -1])
def test_a_message_is_booked_under_the_strongest_layer_that_holds_it(hidden, order):
    faults = HOLDING_LINK_1_2[hidden:][::order]
    medium = Medium(1, CHANNELS, profile(availability=0.0), Timeline(LINKS, faults))
    strongest = [Fate.DEAD, Fate.DEPARTED, Fate.CUT, Fate.PARTITION, Fate.LOST][hidden]
    assert (medium.judge(0, everything())[:, LINKS.index[1, 2]] == strongest).all()


def test_a_dead_agent_is_neither_sensed_nor_heard_nor_reached():
    medium = Medium(1, CHANNELS, profile(), Timeline(LINKS, [Fault(Verb.KILL, 0, None, agents=(4,))]))
    touched = (LINKS.src == 4) | (LINKS.dst == 4)
    assert (medium.judge(0, everything())[:, touched] == Fate.DEAD).all()
    assert (medium.judge(0, everything())[:, ~touched] == Fate.DELIVERED).all()


def test_a_cut_one_way_leaves_the_way_back():
    medium = Medium(1, CHANNELS, profile(), Timeline(LINKS, [Fault(Verb.CUT, 0, None, pairs=((1, 2),))]))
    fates = medium.judge(0, everything())
    assert (fates[:, LINKS.index[1, 2]] == Fate.CUT).all()
    assert (fates[:, LINKS.index[2, 1]] == Fate.DELIVERED).all()


def test_layers_are_independent():
    faults = [
        Fault(Verb.CUT, 5, 25, pairs=((1, 2), (4, 3))),
        Fault(Verb.PARTITION, 10, 30, groups=((1, 2), (3, 4, 5))),
        Fault(Verb.DEPART, 15, 35, agents=(3,)),
        Fault(Verb.KILL, 20, 28, agents=(2,)),
    ]
    alone = [verdicts(Medium(1, CHANNELS, profile(), Timeline(LINKS, [fault])), TICKS) for fault in faults]
    alone.append(verdicts(Medium(1, CHANNELS, profile(availability=0.6), Timeline(LINKS, [])), TICKS))
    together = verdicts(Medium(1, CHANNELS, profile(availability=0.6), Timeline(LINKS, faults)), TICKS)
    dropped = np.stack([np.where(fates >= Fate.DEAD, fates, 255) for fates in alone])
    strongest = dropped.min(axis=0)
    assert (together == np.where(strongest == 255, Fate.DELIVERED, strongest)).all()
    assert set(np.unique(together)) == {Fate.DELIVERED, *REASONS}


def test_what_is_judged_first_does_not_matter():
    medium = Medium(1, CHANNELS, profile(availability=0.5), Timeline(LINKS, [Fault(Verb.CUT, 9, 12, pairs=((1, 2),))]))
    forward = verdicts(medium, TICKS)
    assert all((medium.judge(tick, everything()) == forward[tick]).all() for tick in reversed(range(TICKS)))


# ---- loss


def test_messages_are_lost_at_the_rate_of_their_link():
    availability = np.linspace(0.05, 0.95, len(LINKS))
    standing = replace(profile(coupled=False), availability=availability)
    ticks = 2000
    fates = verdicts(Medium(3, CHANNELS, standing, Timeline(LINKS, [])), ticks)
    delivered = (fates == Fate.DELIVERED).sum(axis=(0, 1))
    offered = ticks * len(CHANNELS)
    sigma = np.sqrt(offered * availability * (1.0 - availability))
    assert (abs(delivered - offered * availability) < 3 * sigma).all()


def test_coupled_channels_share_one_verdict_per_link_and_tick():
    fates = verdicts(Medium(3, CHANNELS, profile(availability=0.5), Timeline(LINKS, [])), 200)
    assert (fates == fates[:, :1]).all()


def test_uncoupled_channels_are_lost_independently():
    fates = verdicts(Medium(3, CHANNELS, profile(availability=0.5, coupled=False), Timeline(LINKS, [])), 2000)
    heard = fates == Fate.DELIVERED
    all_three, offered = heard.all(axis=1).sum(), 2000 * len(LINKS)
    assert abs(all_three - offered / 8) < 3 * np.sqrt(offered * 1 / 8 * 7 / 8)


def test_the_two_directions_of_an_edge_are_lost_independently():
    fates = verdicts(Medium(3, CHANNELS, profile(availability=0.5), Timeline(LINKS, [])), 4000)[:, 0]
    there, back = (fates[:, LINKS.index[pair]] == Fate.DELIVERED for pair in ((1, 2), (2, 1)))
    assert abs((there & back).sum() - 1000) < 3 * np.sqrt(4000 * 1 / 4 * 3 / 4)


def test_another_seed_loses_other_messages():
    one, two = (verdicts(Medium(seed, CHANNELS, profile(availability=0.5), Timeline(LINKS, [])), 50) for seed in (1, 2))
    assert (one != two).mean() == pytest.approx(0.5, abs=0.1)


# ---- delay


@pytest.mark.parametrize("least_delay", [0, 1], ids=["same-tick", "next-tick"])
@pytest.mark.parametrize("delay_ticks", [0, 1, 2, 5])
def test_a_message_arrives_exactly_its_delay_later(delay_ticks, least_delay):
    standing = profile(delay_ticks=delay_ticks, least_delay=least_delay)
    flown, _ = fly(Medium(1, CHANNELS, standing, Timeline(LINKS, [])), TICKS, [everything()] * TICKS)
    takes = max(delay_ticks, least_delay)
    for tick, (_, delivery) in enumerate(flown):
        assert (delivery.sent[0] == tick).all()  # sensing is not delayed
        assert (delivery.sent[1:] == (tick - takes if tick >= takes else -1)).all()


def test_a_delayed_message_arrives_once():
    offered = [everything() if tick == 3 else ~everything() for tick in range(TICKS)]
    flown, in_flight = fly(Medium(1, CHANNELS, profile(delay_ticks=4), Timeline(LINKS, [])), TICKS, offered)
    arrivals = {tick: len(delivery.late) for tick, (_, delivery) in enumerate(flown) if len(delivery.late)}
    assert arrivals == {7: 2 * len(LINKS)}
    assert len(in_flight) == 0


def test_each_link_has_its_own_delay():
    delays = np.arange(len(LINKS)) % 4
    flown, _ = fly(
        Medium(1, CHANNELS, replace(profile(), delay_ticks=delays), Timeline(LINKS, [])), 10, [everything()] * 10
    )
    assert (flown[9][1].sent[1:] == 9 - delays).all()


def test_late_messages_come_in_the_order_of_tick_link_and_channel():
    delays = np.arange(len(LINKS)) % 4
    flown, _ = fly(
        Medium(1, CHANNELS, replace(profile(), delay_ticks=delays), Timeline(LINKS, [])), 10, [everything()] * 10
    )
    late = flown[9][1].late.tolist()
    assert late == sorted([9 - delays[link], link, channel] for link in range(12) if delays[link] for channel in (1, 2))


def test_what_is_under_way_when_the_run_ends_is_in_flight():
    _, in_flight = fly(Medium(1, CHANNELS, profile(delay_ticks=3), Timeline(LINKS, [])), 10, [everything()] * 10)
    assert len(in_flight) == 3 * 2 * len(LINKS)
    assert sorted(set(in_flight.rows[:, 0].tolist())) == [10, 11, 12]


@pytest.mark.parametrize(("verb", "fate"), [(Verb.KILL, Fate.DEAD), (Verb.DEPART, Fate.DEPARTED)])
def test_what_is_under_way_to_an_agent_that_goes_is_dropped_for_that(verb, fate):
    gone = Timeline(LINKS, [Fault(verb, 5, None, agents=(2,))])
    flown, _ = fly(Medium(1, CHANNELS, profile(delay_ticks=3), gone), 12, [everything()] * 12)
    toward_2 = int((LINKS.dst == 2).sum())
    dropped = {tick: delivery.dropped.tolist() for tick, (_, delivery) in enumerate(flown) if len(delivery.dropped)}
    assert dropped == {tick: [fate] * 2 * toward_2 for tick in (5, 6, 7)}  # what was sent in ticks 2, 3 and 4
    assert all((delivery.sent[1:, LINKS.dst == 2] == -1).all() for _, delivery in flown[5:])


def test_what_a_dying_agent_said_before_still_arrives():
    dead = Timeline(LINKS, [Fault(Verb.KILL, 5, None, agents=(2,))])
    flown, _ = fly(Medium(1, CHANNELS, profile(delay_ticks=3), dead), 12, [everything()] * 12)
    heard_of_2 = [tick for tick, (_, delivery) in enumerate(flown) if (delivery.sent[1:, LINKS.index[2, 1]] >= 0).all()]
    assert heard_of_2 == [3, 4, 5, 6, 7]


def test_a_cut_leaves_what_is_under_way():
    cut = Timeline(LINKS, [Fault(Verb.CUT, 5, None, pairs=((1, 2),))])
    flown, _ = fly(Medium(1, CHANNELS, profile(delay_ticks=3), cut), 12, [everything()] * 12)
    arrived = [tick for tick, (_, delivery) in enumerate(flown) if (delivery.sent[1:, LINKS.index[1, 2]] >= 0).all()]
    assert arrived == [3, 4, 5, 6, 7]


# ---- accounts


def interval(start, length):
    return start, None if length is None else start + length


TIMES = st.builds(interval, st.integers(0, TICKS), st.none() | st.integers(1, 15))
AGENT = st.integers(1, 5)
FAULTS = st.one_of(
    st.builds(lambda t, pair: Fault(Verb.CUT, *t, pairs=(pair,)), TIMES, st.sampled_from(PAIRS)),
    st.builds(
        lambda t, group: Fault(
            Verb.PARTITION, *t, groups=(tuple(group), tuple(agent for agent in range(1, 6) if agent not in group))
        ),
        TIMES,
        st.sets(AGENT, min_size=1, max_size=4),
    ),
    st.builds(lambda t, agent: Fault(Verb.KILL, *t, agents=(agent,)), TIMES, AGENT),
    st.builds(lambda t, agent: Fault(Verb.DEPART, *t, agents=(agent,)), TIMES, AGENT),
)
PER_LINK = {"min_size": len(LINKS), "max_size": len(LINKS)}
PROFILES = st.builds(
    Profile,
    availability=st.lists(st.floats(0.0, 1.0), **PER_LINK).map(np.array),
    delay_ticks=st.lists(st.integers(0, 5), **PER_LINK).map(np.array),
    coupled=st.booleans(),
    least_delay=st.sampled_from([0, 1]),
)
SEEDS = st.integers(0, 2**64 - 1)


@settings(max_examples=60, deadline=None)
@given(seed=SEEDS, standing=PROFILES, faults=st.lists(FAULTS, max_size=6), talk=st.floats(0.0, 1.0))
def test_offered_is_delivered_plus_dropped_plus_in_flight(seed, standing, faults, talk):
    offered = np.random.default_rng(seed).random((TICKS, len(CHANNELS), len(LINKS))) < talk
    flown, in_flight = fly(Medium(seed, CHANNELS, standing, Timeline(LINKS, faults)), TICKS, offered)
    fates = np.stack([fates for fates, _ in flown])
    late = sum(len(delivery.late) for _, delivery in flown)
    dropped_late = sum(len(delivery.dropped) for _, delivery in flown)

    assert ((fates == Fate.SILENT) == ~offered).all()
    assert (fates == Fate.DELAYED).sum() == late + dropped_late + len(in_flight)

    ledger = Ledger.of(
        fates,
        np.array([len(delivery.late) for _, delivery in flown]),
        np.stack([np.bincount(delivery.dropped, minlength=len(Fate)) for _, delivery in flown]),
    )
    assert ledger.offered == offered.sum()
    assert ledger.delivered == (fates == Fate.DELIVERED).sum() + late
    assert sum(ledger.dropped.values()) == (fates >= Fate.DEAD).sum() + dropped_late
    assert ledger.offered == ledger.delivered + sum(ledger.dropped.values()) + len(in_flight)
    assert ledger.outstanding == len(in_flight)


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, standing=PROFILES, faults=st.lists(FAULTS, max_size=6))
def test_every_delayed_message_arrives_in_order_exactly_its_delay_later_or_meets_a_receiver_that_is_gone(
    seed, standing, faults
):
    timeline = Timeline(LINKS, faults)
    flown, _ = fly(Medium(seed, CHANNELS, standing, timeline), TICKS, [everything()] * TICKS)
    takes = np.maximum(standing.delay_ticks, standing.least_delay)
    for tick, (_, delivery) in enumerate(flown):
        expected = [
            (tick - int(takes[link]), link, channel)
            for link in range(len(LINKS))
            for channel in (1, 2)
            if 0 < takes[link] <= tick and flown[tick - takes[link]][0][channel, link] == Fate.DELAYED
        ]
        gone = timeline.at(tick).absent[LINKS.dst - 1]
        assert [tuple(row) for row in delivery.late.tolist()] == sorted(row for row in expected if not gone[row[1]])
        assert len(delivery.dropped) == sum(gone[link] for _, link, _ in expected)


def test_the_ledger_names_each_reason_that_occurred():
    fates = np.array([[[Fate.DELIVERED, Fate.LOST, Fate.CUT, Fate.DELAYED, Fate.DELAYED, Fate.SILENT]]], dtype=np.uint8)
    dropped = np.zeros((1, len(Fate)), dtype=np.int64)
    dropped[0, Fate.DEAD] = 1
    ledger = Ledger.of(fates, np.array([0]), dropped)
    assert ledger == Ledger(offered=5, delivered=1, dropped={"dead": 1, "cut": 1, "lost": 1})
    assert ledger.outstanding == 1


# ---- nothing moves another's verdict


def table(channels, links, faults, coupled, seed):
    """Verdict by (channel, src, dst, tick); availability differs from link to link."""
    availability = 0.3 + 0.6 * ((links.src * 7 + links.dst * 3) % 5) / 4
    standing = replace(profile(links, coupled=coupled), availability=availability)
    fates = verdicts(Medium(seed, channels, standing, Timeline(links, faults)), TICKS)
    return {
        (name, src, dst, tick): fates[tick, row, column]
        for tick in range(TICKS)
        for row, name in enumerate(channels)
        for (src, dst), column in links.index.items()
    }


EDGES = [(1, 2), (2, 3), (3, 4), (4, 5), (5, 1), (1, 3)]


@settings(max_examples=25, deadline=None)
@given(
    seed=SEEDS,
    coupled=st.booleans(),
    faults=st.lists(FAULTS, max_size=4),
    edge=st.sampled_from([(2, 4), (2, 5), (3, 5), (1, 4)]),
    neighbour=AGENT,
    name=st.sampled_from(["a", "measurement", "z"]),
)
def test_an_agent_a_link_or_a_channel_more_changes_no_other_verdict(seed, coupled, faults, edge, neighbour, name):
    before = table(CHANNELS, LINKS, faults, coupled, seed)
    more = [
        (CHANNELS, Links.both_ways(6, [*EDGES, (neighbour, 6)])),
        (CHANNELS, Links.both_ways(5, [*EDGES, edge])),
        (("sense", *sorted(["input", "theta", name])), LINKS),
    ]
    for channels, links in more:
        after = table(channels, links, faults, coupled, seed)
        assert len(after) > len(before)
        assert {key: after[key] for key in before} == before


@settings(max_examples=40, deadline=None)
@given(seed=SEEDS, coupled=st.booleans(), faults=st.lists(FAULTS, max_size=4), another=FAULTS)
def test_a_fault_more_changes_no_verdict_elsewhere(seed, coupled, faults, another):
    before = table(CHANNELS, LINKS, faults, coupled, seed)
    after = table(CHANNELS, LINKS, [*faults, another], coupled, seed)
    held = Timeline(LINKS, [another]).held(0)
    for channel, src, dst, tick in before:
        if not (another.active(tick) and held[LINKS.index[src, dst]]):
            assert after[channel, src, dst, tick] == before[channel, src, dst, tick]
        else:
            assert after[channel, src, dst, tick] >= Fate.DEAD
