"""The relay of a run in real time: the verdicts of lockstep, each message when it is due, and accounts that close."""

import random
from dataclasses import replace

import numpy as np
import pytest
from airs import DT, constant, losing, quiet_profile

from netem.core.links import Links
from netem.faults.fault import Fault, UnderWay, Verb
from netem.faults.timeline import Timeline
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.medium.in_flight import Verdicts
from netem.medium.ledger import Accounts, Ledger
from netem.medium.medium import Medium
from netem.medium.real_time import RealTimeRelay
from netem.medium.relay import Relay
from netem.medium.verdict import Verdict

LINKS = Links.both_ways(4, [(1, 2), (2, 3), (3, 4), (4, 1), (1, 3)])
CHANNELS = ("sense", "input", "theta")
SIZE = len(LINKS)
GRACE = 3
SOON = 1e-4


def profile(availability=1.0, delay_s=0.0, **changes):
    delays = (constant(delay_s, np.ones(SIZE, dtype=bool)),) if delay_s else ()
    lossy = quiet_profile(LINKS, CHANNELS, chains=(losing(np.full(SIZE, availability)),), delays=delays)
    return replace(lossy, **changes)


def air(standing=None, faults=(), seed=1):
    return Medium(seed, CHANNELS, [standing or profile()], Timeline(LINKS, faults))


def relay(*given, **named):
    return RealTimeRelay(air(*given, **named), LINKS, len(CHANNELS), DT, GRACE)


class Flight:
    """Ticks flown by a relay, in which agents say what they are to say; what was written down, and what arrived."""

    def __init__(self, standing=None, faults=(), seed=1):
        self.relay = relay(standing, faults, seed)
        self.entries, self.arrived, self.in_flight = [], [], []
        self.tick = -1

    def begin(self):
        self.tick += 1
        begun = self.relay.begin(self.tick, None)
        self.book()
        return begun

    def say(self, agent, at=0.0, channel=1, tick=None):
        tick = self.tick if tick is None else tick
        return self.relay.say(agent, channel, tick, (self.tick + at) * DT, (agent, channel, tick))

    def deliver(self, at):
        """All that is due at a time of this tick."""
        arrived = self.relay.arriving((self.tick + at) * DT)
        self.arrived += [(self.tick, parcel) for parcel in arrived]
        return arrived

    def book(self, **options):
        for entry in self.relay.closed(**options):
            self.entries.append(entry)
            self.in_flight.append(self.relay.in_flight)

    def punctual(self):
        """A tick in which everybody speaks at once, and what is due by its end is delivered."""
        begun = self.begin()
        for agent in begun.awake:
            for channel in (1, 2):
                self.say(agent, 0.0, channel)
        self.deliver(SOON)
        self.deliver(1.0 - SOON)

    def end(self):
        self.book(all_of_them=True)
        return self


def fly(ticks, *given, **named):
    flight = Flight(*given, **named)
    for _ in range(ticks):
        flight.punctual()
    return flight.end()


def lockstep(ticks, *given, **named):
    other = Relay(air(*given, **named))
    entries = []
    for tick in range(ticks):
        relayed = other.decide(tick, None)
        other.keep(tick, None)
        entries.append(relayed.entry)
        other.finish(tick)
    return entries


def closes(flight):
    entries = flight.entries
    ledger = Ledger.of(
        np.array([entry.verdicts for entry in entries]),
        np.array([entry.copies for entry in entries]),
        np.array([entry.late for entry in entries]),
        np.array([entry.dropped_by_verdict for entry in entries]),
    )
    return Accounts(len(entries), ledger, flight.in_flight[-1]).close


AIRS = {
    "perfect": (profile(), ()),
    "lossy": (profile(0.6), ()),
    "cut": (profile(), [Fault(Verb.CUT, 3, 9, pairs=((1, 2), (2, 1)))]),
    "killed": (profile(0.9), [Fault(Verb.KILL, 4, 10, agents=(3,))]),
    "paused": (profile(0.9), [Fault(Verb.PAUSE, 4, 10, agents=(3,), under_way=UnderWay.DROP)]),
    "two ticks late": (profile(0.8, 2.0 * DT), ()),
    "late and cut": (
        profile(1.0, 3.0 * DT),
        [Fault(Verb.CUT, 5, 9, pairs=((1, 2), (2, 1)), under_way=UnderWay.DROP)],
    ),
    "late and held": (
        profile(1.0, 3.0 * DT),
        [Fault(Verb.CUT, 5, 11, pairs=((1, 2), (2, 1)), under_way=UnderWay.HOLD)],
    ),
    "departed": (
        profile(1.0, 2.0 * DT),
        [Fault(Verb.DEPART, 5, None, agents=(2,))],
    ),
}


@pytest.mark.parametrize("name", AIRS)
def test_who_speaks_when_a_tick_begins_is_judged_delivered_and_written_down_as_in_lockstep(name):
    standing, faults = AIRS[name]
    flown, wanted = fly(16, standing, faults), lockstep(16, standing, faults)
    for tick, (entry, other) in enumerate(zip(flown.entries, wanted, strict=True)):
        np.testing.assert_array_equal(entry.verdicts, other.verdicts, f"tick {tick}")
        for field in ("odd", "apart", "dropped", "released"):
            assert sorted(getattr(entry, field).tolist()) == sorted(getattr(other, field).tolist()), (field, tick)
        assert entry.late == other.late
    assert closes(flown)


def test_a_message_arrives_when_it_is_due_and_not_in_whole_ticks():
    flight = Flight(profile(1.0, 0.3 * DT))
    flight.begin()
    flight.say(1, at=0.1)
    assert not flight.deliver(0.35)
    assert flight.relay.next_s == pytest.approx(0.4 * DT)
    assert {parcel.link for parcel in flight.deliver(0.45)} == set(np.flatnonzero(LINKS.src == 1).tolist())


def test_what_is_said_late_in_a_tick_is_delivered_in_the_next_and_booked_so():
    flight = Flight(profile(1.0, 0.3 * DT))
    flight.begin()
    flight.say(1, at=0.9)
    flight.deliver(1.0)
    flight.begin()
    assert flight.deliver(0.25)
    row = LINKS.index[1, 2]
    (first, *_) = flight.end().entries
    assert first.verdicts[1, row] == Verdict.DELAYED
    assert [1, row, 1] in first.odd[:, :3].tolist()
    assert flight.entries[1].late == (LINKS.src == 1).sum()


def test_what_nobody_said_is_booked_as_unsaid_and_blocks_nothing():
    flight = Flight()
    for _ in range(GRACE + 3):
        flight.begin()
        for agent in (1, 2, 3):
            for channel in (1, 2):
                flight.say(agent, 0.0, channel)
        flight.deliver(0.5)
    assert len(flight.entries) == 2  # those whose grace is over
    kinds = flight.entries[0].verdicts
    of_silent = LINKS.src == 4
    assert (kinds[1:, of_silent] == Verdict.UNSAID).all()
    assert (kinds[1:, ~of_silent] == Verdict.DELIVERED).all()
    assert (kinds[0] == Verdict.DELIVERED).all()
    assert closes(flight.end())


def test_what_is_said_within_the_grace_is_heard_and_later_is_not():
    flight = Flight()
    for _ in range(GRACE + 1):
        flight.begin()
    assert flight.say(2, tick=0)
    flight.deliver(0.5)
    flight.begin()
    assert not flight.say(2, channel=2, tick=0)
    assert flight.end().entries[0].verdicts[1, LINKS.index[2, 1]] == Verdict.DELAYED
    assert closes(flight)


def test_who_speaks_of_a_tick_has_nothing_more_to_say_of_those_before_and_holds_up_no_book():
    flight = Flight()
    for _ in range(3):
        flight.begin()
    for agent in (1, 2, 3, 4):
        for channel in (1, 2):
            assert flight.say(agent, 0.0, channel)
    assert not flight.say(1, tick=1)
    flight.begin()
    assert len(flight.entries) == 3
    assert [(entry.verdicts[1:] == Verdict.UNSAID).all() for entry in flight.entries] == [True, True, False]
    flight.deliver(0.5)
    assert closes(flight.end())


@pytest.mark.parametrize("again", [1, 2])
def test_nobody_says_a_thing_twice(again):
    flight = Flight()
    flight.begin()
    assert flight.say(1)
    for _ in range(again):
        assert not flight.say(1)
    assert len(flight.deliver(0.5)) == (LINKS.src == 1).sum()


def test_the_dead_say_nothing():
    flight = Flight(faults=[Fault(Verb.KILL, 0, None, agents=(1,))])
    assert flight.begin().awake == [2, 3, 4]
    assert not flight.say(1)


def test_a_stale_message_says_what_was_said_the_tick_before():
    stale = np.zeros((SIZE, 4))
    stale[:, 0] = 1.0
    flight = Flight(profile(corrupt=stale))
    for _ in range(2):
        flight.begin()
        flight.say(1)
        arrived = flight.deliver(0.5)
    assert {parcel.said[2] for parcel in arrived} == {0}
    assert {parcel.content for parcel in arrived} == {0}
    assert closes(flight.end())


def test_the_first_message_has_nothing_stale_to_say():
    stale = np.zeros((SIZE, 4))
    stale[:, 0] = 1.0
    flight = Flight(profile(corrupt=stale))
    flight.begin()
    flight.say(1)
    assert {parcel.mark for parcel in flight.deliver(0.5)} == {0}


def test_a_message_that_waits_for_those_before_it_does_not_overtake_them():
    law = MessageDelay(DelayLaw.UNIFORM, np.ones(SIZE, dtype=bool), 3.0 * DT, 3.0 * DT, np.empty(0), 0.0, ordered=True)
    free = replace(law, ordered=False)

    def overtakes(law):
        flight = Flight(profile(delays=(law,)))
        for _ in range(60):
            flight.begin()
            flight.say(1)
            for at in np.linspace(0.1, 0.9, 5):
                flight.deliver(at)
        row = LINKS.index[1, 2]
        contents = [parcel.content for _, parcel in flight.arrived if parcel.link == row]
        return contents != sorted(contents)

    assert overtakes(free)
    assert not overtakes(law)


def test_a_fault_that_is_injected_is_told_once():
    flight = Flight()
    flight.begin()
    medium = flight.relay._medium
    medium.timeline = medium.timeline.facing([Fault(Verb.CUT, 1, 2, pairs=((1, 2),))])
    for _ in range(3):
        flight.begin()
    assert [entry.injected is not None for entry in flight.end().entries] == [False, True, False, False]


@pytest.mark.parametrize("seed", range(12))
def test_the_accounts_close_whatever_is_said_when(seed):
    dice = random.Random(seed)
    faults = [
        Fault(Verb.CUT, 4, 9, pairs=((1, 2), (2, 1)), under_way=dice.choice(list(UnderWay))),
        Fault(Verb.KILL, 6, 12, agents=(dice.randint(1, 4),)),
        Fault(Verb.PAUSE, 10, 15, agents=(dice.randint(1, 4),), under_way=dice.choice(list(UnderWay))),
        Fault(Verb.DELAY, 3, 14, pairs=((3, 4), (4, 3)), seconds=2.3 * DT),
    ]
    corrupt = np.tile([0.2, 0.1, 0.1, 0.1], (SIZE, 1))
    standing = profile(0.8, 1.7 * DT, duplicate=np.full(SIZE, 0.3), corrupt=corrupt)
    flight = Flight(standing, faults, seed)
    owed = []
    for _ in range(25):
        begun = flight.begin()
        owed += [(flight.tick, agent, channel) for agent in begun.awake for channel in (1, 2)]
        for number in range(1, 10):
            at = number / 10
            for said in [one for one in owed if dice.random() < 0.2]:
                owed.remove(said)
                tick, agent, channel = said
                flight.say(agent, at, channel, tick)
            flight.deliver(at)
    flight.end()
    assert len(flight.entries) == 25
    assert closes(flight)
    assert all(parcel.said_s < parcel.due_s <= (tick + 1) * DT for tick, parcel in flight.arrived)


def test_recorded_verdicts_stand():
    class Judge:
        def verdicts(self, tick, _):
            wanted = lockstep(tick + 1, profile(0.5), seed=9)[tick]
            shape = wanted.verdicts.shape
            return Verdicts(wanted.verdicts, np.full(shape, tick), np.zeros(shape, dtype=np.uint8), np.full(shape, -1))

    flight = Flight()
    flight.relay._medium._recorded = Judge()
    for _ in range(5):
        flight.punctual()
    wanted = lockstep(5, profile(0.5), seed=9)
    for entry, other in zip(flight.end().entries, wanted, strict=True):
        np.testing.assert_array_equal(entry.verdicts, other.verdicts)
