"""Whatever bytes come in place of a message: every reader takes them as such a message, or refuses them; none ever fails."""

from random import Random

import msgpack
import mutations
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import to_builtins

from agents.arrivals import Arrivals
from agents.mailbox import Inboxes
from agents.node import Roster
from netem.core.links import Links
from netem.faults.control import Answer, Order, OrderAction, obey
from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from netem.wire import messages
from netem.wire.arrays import CODE, WHOLE, Form, numbers, packed
from netem.wire.broadcasts import Broadcasts
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.senses import Senses
from netem.wire.sequence import UninstructedLoss
from netem.wire.wrong import WireError
from world.acts import Acts

KEYS, TICK, D = Keys("r1"), 7, 2
LINKS = Links.both_ways(3, [(1, 2), (2, 3), (1, 3)])
NEIGHBOURS = {agent: frozenset(LINKS.neighbours_of(agent)) for agent in (1, 2, 3)}
FORMS = {
    "input": {"velocity": Form((2,), truths=False)},
    "theta": {"local": Form((2, 2), truths=False), "feasible": Form((), truths=True)},
}
ENVELOPE = {"k": TICK, "src": 2, "seq": 0}
SIGHTING = {"position": packed([1.5, 2.0]), "done": True, "by": 0, "method": 1}
PAYLOADS = {
    "input": {"velocity": packed([1.0, 2.0])},
    "theta": {"local": [[1.0, 0.0], [0.0, 1.0]], "feasible": b"\1"},
    "measurement": {"neighbours": [1, 3], "measured": packed(np.ones((2, 2)))},
}


def broadcast(channel, **said):
    return ENVELOPE | {"channel": channel, "payload": PAYLOADS[channel]} | said


ACT = ENVELOPE | {
    "input": packed([1.0, 2.0]),
    "estimate": [[1.0, 0.0], [0.5, 0.5]],
    "known": b"\1\0",
    "covariance": packed(np.ones((2, 3))),
    "psi": float("nan"),
    "feasible": True,
    "reports": {"place": [1.0, 2.0]},
    "heard": 4,
}
SENSE_INBOX = ENVELOPE | {
    "src": "netem",
    "phase": "sense",
    "clock": 7,
    "neighbours": [1, 3],
    "measured": packed(np.ones((2, 2))),
    "position": packed([1.0, 2.0]),
    "motion": packed([[0.5, 0.25]]),
    "sighting": SIGHTING,
}
EXCHANGE = ENVELOPE | {
    "src": "netem",
    "phase": "exchange",
    "messages": [broadcast("theta", src=1), broadcast("input", src=3)],
}
TOLD = ENVELOPE | {
    "src": "centre",
    "relative": packed(np.ones((2, 2))),
    "covariance": packed(np.ones((2, 2, 2))),
    "nis": packed(np.ones(2)),
}
ROSTER = ENVELOPE | {"src": "netem", "awake": [1, 2], "restarted": [2], "remembering": []}
SENSE = ENVELOPE | {
    "src": "world",
    "last": False,
    "measured": packed(np.ones((6, 2))),
    "position": packed(np.ones((3, 2))),
    "motion": packed(np.ones((3, 1, 2))),
    "sightings": [SIGHTING] * 3,
    "fired": [],
}
JOURNAL = ENVELOPE | {
    "src": "netem",
    "verdicts": packed(np.zeros((4, 6)), CODE),
    "odd": packed([[1, 0, 9, 0, 8]], WHOLE),
    "apart": b"",
    "late": 1,
    "dropped": b"",
    "released": b"",
    "handed": [4, 4, 4],
    "injected": None,
}
FAULT = Fault(Verb.CUT, 0, 30, pairs=((1, 2), (2, 1)))
ORDER = to_builtins(Order(OrderAction.INJECT, FAULT))


def reads_act(data):
    reader = Acts(KEYS, LINKS, D, {"place": (2,)}, foreign=frozenset({2}))
    reader.expect([4, 4, 4])
    act = reader.read(KEYS.act(2), data, TICK, {1, 2, 3})
    done = reader.together({2: act})
    assert reader.unheard(act) >= 0
    for array in (done.input, done.estimate, done.covariance):
        assert np.isfinite(array).all()
    assert (done.covariance[..., [0, 2]] >= 0.0).all()


def reads_broadcast(channel, foreign):
    def read(data):
        payloads = Payloads(FORMS, NEIGHBOURS, D, frozenset({2} if foreign else ()))
        reader = Broadcasts(KEYS, (1, 2, 3), (*FORMS, "measurement"), payloads)
        said = reader.read(KEYS.broadcast(2, channel), data, TICK, {(2, channel)})
        relayed = messages.unpack_inbox(messages.pack_exchange(TICK, 0, [data])).messages
        np.testing.assert_equal(to_builtins(relayed), to_builtins([said]))
        arrivals = Arrivals({1: (2, 3)}, width=2, dimension=D, forms=FORMS)
        arrivals.heard(TICK, {1: relayed})

    return read


def reads_inbox(data):
    arrivals, inboxes = Arrivals({2: (1, 3)}, width=2, dimension=D, forms=FORMS), Inboxes(2, (1, 3))
    if data.find(b"exchange") > 0:
        inboxes.read(msgpack.packb(SENSE_INBOX))
        data = data.replace(b"\xa3seq\x00", b"\xa3seq\x01", 1)
    inbox = inboxes.read(data)
    if isinstance(inbox, messages.SenseInbox):
        arrivals.sensed({2: inbox})
    if isinstance(inbox, messages.ExchangeInbox):
        arrivals.heard(TICK, {2: inbox.messages})


def reads_told(data):
    arrivals = Arrivals({2: (1, 3)}, width=2, dimension=D, forms={})
    arrivals.told(TICK, {2: messages.unpack(messages.Told, data)}, np.ones((1, 2), dtype=bool))


def reads_sense(data):
    Senses(links=6, agents=3, dimension=D).read(data, TICK)


def reads_journal(data):
    journal = messages.unpack(messages.Journal, data)
    numbers(journal.verdicts, "the medium", (-1, 6), CODE)
    for name, columns in {"odd": 5, "apart": 4, "dropped": 5, "released": 4}.items():
        numbers(getattr(journal, name), "the medium", (-1, columns), WHOLE)


def reads_order(data):
    answer = obey(messages.unpack(Order, data), TICK, Timeline(LINKS, [], []))[1]
    assert messages.unpack(Answer, messages.pack(answer)) == answer


def reads_roster(data):
    Roster(ear=None, agents=(1, 2)).read(data)


READERS = {
    "act": (ACT, reads_act),
    **{
        f"{channel} of {'a foreign agent' if foreign else 'ours'}": (
            broadcast(channel),
            reads_broadcast(channel, foreign),
        )
        for channel in PAYLOADS
        for foreign in (True, False)
    },
    "sense inbox": (SENSE_INBOX, reads_inbox),
    "exchange inbox": (EXCHANGE, reads_inbox),
    "told": (TOLD, reads_told),
    "roster": (ROSTER, reads_roster),
    "sense": (SENSE, reads_sense),
    "journal": (JOURNAL, reads_journal),
    "order": (ORDER, reads_order),
}


@pytest.mark.parametrize("kind", READERS)
def test_what_is_right_is_taken(kind):
    plain, reads = READERS[kind]
    reads(msgpack.packb(plain))


def fuzz(examples, each):
    """So many examples of so many inputs."""
    taken = dict.fromkeys(READERS, 0)

    @settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck), database=None)
    @given(kind=st.sampled_from(sorted(READERS)), seed=st.integers(0, 2**32))
    def any_bytes(kind, seed):
        random, (plain, reads) = Random(seed), READERS[kind]
        for _ in range(each):
            data = mutations.packed(random, plain)
            try:
                reads(data)
            except (WireError, UninstructedLoss):
                continue
            except Exception as error:
                error.add_note(f"{kind}: {data[:200]!r}")
                raise
            taken[kind] += 1

    any_bytes()
    return taken


def test_ten_thousand_wrong_messages_fail_no_reader():
    taken = fuzz(1_000, 10)
    assert 0 < sum(taken.values()) < 4_000


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_a_million_wrong_messages_fail_no_reader():
    taken = fuzz(20_000, 50)
    assert min(taken.values()) > 0
