"""Each thing that a rogue agent may say on its own keys is refused, counted by its kind, and named by its agent."""

from types import SimpleNamespace

import msgpack
import numpy as np
import pytest
from hostile import ACT, INPUT, MEASUREMENT, catalogue

from netem.core.links import Links
from netem.wire.arrays import Form
from netem.wire.broadcasts import Broadcasts
from netem.wire.intake import Intake, Trust
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.sequence import UninstructedLoss
from netem.wire.wrong import WireError, Wrong
from world.acts import Acts

KEYS, ROGUE, FIRST, TICK = Keys("r1"), 2, 3, 7
LINKS = Links.both_ways(3, [(1, 2), (2, 3), (1, 3)])
HANDED = 4  # broadcasts to each, a tick
CATALOGUE = catalogue()


def honest(on, tick=TICK, agent=ROGUE):
    """What it should say, from tick 3 on."""
    number = tick - FIRST
    envelope = {"k": tick, "src": agent, "seq": number}
    others = sorted({1, 2, 3} - {agent})
    if on == ACT:
        return envelope | {
            "input": [1.0, 2.0],
            "estimate": [[1.0, 0.0], [0.5, 0.5]],
            "known": [True, False],
            "covariance": [[0.5, 0.0, 0.5]] * 2,
            "psi": float("nan"),
            "feasible": True,
            "reports": {},
            "heard": HANDED * (number + 1),
        }
    payload = {"velocity": [1.0, 2.0]}
    if on == MEASUREMENT:
        payload = {"neighbours": others, "measured": np.ones((2, 2)).tobytes()}
    return envelope | {"channel": on, "payload": payload}


def key(on, agent=ROGUE):
    return KEYS.act(agent) if on == ACT else KEYS.broadcast(agent, on)


def arrived(on, data, agent=ROGUE):
    return SimpleNamespace(key=key(on, agent), size=len(data), data=data)


class Subscriber:
    """The world's end, or the medium's, in tick 7."""

    def __init__(self, on, policy="drop", foreign=(ROGUE,), **trust):
        trust = {"largest_message": 1 << 20, "messages_per_tick": 100} | trust
        self.intake = Intake(Trust(policy, **trust, foreign=frozenset(foreign)))
        if on == ACT:
            self.reader = Acts(KEYS, LINKS, 2, {"place": (2,)}, frozenset(foreign))
            self.reader.expect([HANDED] * 3)
        else:
            neighbours = {agent: frozenset(LINKS.neighbours_of(agent)) for agent in (1, 2, 3)}
            payloads = Payloads({INPUT: {"velocity": Form((2,), truths=False)}}, neighbours, 2, frozenset(foreign))
            self.reader = Broadcasts(KEYS, (1, 2, 3), (INPUT, MEASUREMENT), payloads)
        self.on = on
        for tick in range(FIRST, TICK):
            assert self.hears(msgpack.packb(honest(on, tick)), tick)

    def hears(self, data, tick=TICK, awaited=None):
        if awaited is None:
            awaited = {1, 2, 3} if self.on == ACT else {(agent, self.on) for agent in (1, 2, 3)}
        read = self.intake.take(arrived(self.on, data), tick, awaited, self.reader)
        if read is not None and self.on == ACT:
            assert self.reader.unheard(read) == 0
        return read

    def refused(self):
        return {(agent, wrong): number for agent, wrong, number in self.intake.refused}


def test_there_are_many_of_every_kind_on_every_key():
    assert len(CATALOGUE) >= 300
    each = {(one.on, one.wrong) for one in CATALOGUE}
    of_messages = set(Wrong) - {Wrong.FLOOD, Wrong.UNHEARD, Wrong.MISCOUNTED}
    assert each >= {(on, wrong) for on in (ACT, INPUT, MEASUREMENT) for wrong in of_messages}
    assert (ACT, Wrong.MISCOUNTED) in each


@pytest.mark.parametrize("hostile", CATALOGUE, ids=str)
def test_it_is_dropped_and_counted_and_the_right_one_is_taken_after_it(hostile):
    subscriber, said = Subscriber(hostile.on), honest(hostile.on)
    assert subscriber.hears(hostile.made(said)) is None
    assert subscriber.refused() == {(ROGUE, hostile.wrong): 1}
    assert subscriber.hears(msgpack.packb(said)).k == TICK
    assert subscriber.refused() == {(ROGUE, hostile.wrong): 1}


@pytest.mark.parametrize("hostile", CATALOGUE, ids=str)
def test_it_fails_the_run_by_the_name_of_its_agent(hostile):
    subscriber = Subscriber(hostile.on, policy="fail")
    with pytest.raises((WireError, UninstructedLoss), match=rf"^agent {ROGUE}\b") as error:
        subscriber.hears(hostile.made(honest(hostile.on)))
    assert len(str(error.value)) < 500
    assert "\n" not in str(error.value)
    assert subscriber.refused() == {(ROGUE, hostile.wrong): 1}


@pytest.mark.parametrize("on", [ACT, INPUT, MEASUREMENT])
def test_what_is_said_twice_or_by_the_dead_is_refused(on):
    subscriber, said = Subscriber(on), msgpack.packb(honest(on))
    assert subscriber.hears(said)
    assert subscriber.hears(said, awaited=set()) is None
    assert subscriber.refused() == {(ROGUE, Wrong.REPEATED): 1}


@pytest.mark.parametrize("on", [ACT, INPUT, MEASUREMENT])
def test_of_a_flood_no_more_is_looked_at(on):
    subscriber, said = Subscriber(on, messages_per_tick=10), honest(on)
    for _ in range(1000):
        assert subscriber.hears(b"\xc1") is None
    assert subscriber.hears(msgpack.packb(said)) is None
    assert subscriber.refused() == {(ROGUE, Wrong.MALFORMED): 10, (ROGUE, Wrong.FLOOD): 991}
    later = honest(on) | {"k": TICK + 1}
    assert subscriber.hears(msgpack.packb(later), tick=TICK + 1)


def test_one_agents_flood_is_not_anothers():
    subscriber = Subscriber(ACT, messages_per_tick=10)
    for _ in range(100):
        subscriber.hears(b"\xc1")
    said = msgpack.packb(honest(ACT, agent=1) | {"seq": 0, "heard": HANDED})
    assert subscriber.intake.take(arrived(ACT, said, agent=1), TICK, {1, 2, 3}, subscriber.reader).src == 1


def test_a_large_message_is_refused_before_it_is_copied():
    class Large:
        key, size = key(ACT), 1 << 30

        @property
        def data(self):
            raise AssertionError("it was copied")

    subscriber = Subscriber(ACT)
    assert subscriber.intake.take(Large(), TICK, {1, 2, 3}, subscriber.reader) is None
    assert subscriber.refused() == {(ROGUE, Wrong.OVERSIZED): 1}


VALUES = [one for one in CATALOGUE if one.wrong is Wrong.VALUE]


@pytest.mark.parametrize("hostile", VALUES, ids=str)
def test_an_estimator_of_ours_may_diverge(hostile):
    """It says what it computes, as without a network; the verdict is the run's."""
    subscriber = Subscriber(hostile.on, policy="fail", foreign=())
    assert subscriber.hears(hostile.made(honest(hostile.on))).k == TICK
    assert subscriber.refused() == {}


@pytest.mark.parametrize(("limit", "length", "taken"), [(3.0, 3.0, True), (3.0, 3.001, False), (1e9, 1e8, True)])
def test_an_input_is_as_long_as_the_scenario_lets_it_be(limit, length, taken):
    subscriber = Subscriber(ACT)
    subscriber.reader._limit = limit
    said = honest(ACT) | {"input": [0.6 * length, 0.8 * length]}
    assert (subscriber.hears(msgpack.packb(said)) is not None) == taken


def test_what_is_not_defined_may_be_nan():
    subscriber = Subscriber(ACT)
    said = honest(ACT) | {"psi": float("nan"), "reports": {"place": [float("nan")] * 2}}
    assert subscriber.hears(msgpack.packb(said))
    assert not subscriber.refused()


@pytest.mark.parametrize("on", [ACT, INPUT])
@pytest.mark.parametrize(("refused", "lost"), [(0, 2), (1, 1), (2, 0), (3, 0)])
def test_in_real_time_what_was_refused_is_not_lost_by_the_transport(on, refused, lost):
    """Before, a flood was booked as lost."""
    said = []
    intake = Intake(Trust("drop", 1 << 20, 100, foreign=frozenset()))
    given = {"in_real_time": True, "lost": lambda *what: said.append(what)}
    if on == ACT:
        reader = Acts(KEYS, LINKS, 2, {}, **given)
    else:
        neighbours = {agent: frozenset(LINKS.neighbours_of(agent)) for agent in (1, 2, 3)}
        payloads = Payloads({INPUT: {"velocity": Form((2,), truths=False)}}, neighbours, 2, frozenset())
        reader = Broadcasts(KEYS, (1, 2, 3), (INPUT,), payloads, **given)

    def hears(tick):
        right = msgpack.packb(honest(on, tick) | ({} if on == ACT else {"at": 0.1 * tick}))
        assert intake.take(arrived(on, right), tick, (), reader)

    hears(FIRST)
    for _ in range(refused):
        assert intake.take(arrived(on, b"\xc1"), FIRST, (), reader) is None
    hears(FIRST + 3)
    hears(FIRST + 5)
    assert said == [(key(on), number) for number in (lost, 1) if number]
