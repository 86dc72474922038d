"""What the medium, the world and the centre say is looked at too: in its order, of its tick, of whom there is."""

import msgpack
import numpy as np
import pytest

from agents.mailbox import Inboxes
from agents.node import Roster
from netem.wire.arrays import packed
from netem.wire.senses import Senses
from netem.wire.sequence import UninstructedLoss
from netem.wire.wrong import WireError, Wrong

SENSED = {
    "k": 7,
    "src": "netem",
    "seq": 0,
    "phase": "sense",
    "clock": 7,
    "neighbours": [1, 3],
    "measured": packed(np.ones((2, 2))),
    "position": None,
    "motion": None,
    "sighting": None,
}
SAID = {"k": 7, "src": 3, "channel": "input", "seq": 0, "payload": {}}
EXCHANGED = {"k": 7, "src": "netem", "seq": 1, "phase": "exchange", "messages": [SAID]}
AGAIN = SENSED | {"k": 8, "seq": 2}


def read(*told):
    inboxes = Inboxes(2, (1, 3))
    return [inboxes.read(msgpack.packb(one)).k for one in told]


def test_inboxes_that_are_due_are_read():
    assert read(SENSED, EXCHANGED, AGAIN) == [7, 7, 8]
    assert read(SENSED, EXCHANGED, AGAIN | {"k": 20}) == [7, 7, 20]  # it was paused


@pytest.mark.parametrize(
    ("told", "wrong"),
    [
        ([EXCHANGED | {"seq": 0}], Wrong.FUTURE),
        ([SENSED, SENSED | {"seq": 1}], Wrong.REPEATED),
        ([SENSED, SENSED | {"seq": 1, "k": 8}], Wrong.FUTURE),
        ([SENSED, EXCHANGED | {"k": 6}], Wrong.PAST),
        ([SENSED, EXCHANGED | {"k": 8}], Wrong.FUTURE),
        ([SENSED, EXCHANGED, EXCHANGED | {"seq": 2}], Wrong.REPEATED),
        ([SENSED, EXCHANGED, AGAIN | {"k": 6}], Wrong.PAST),
        ([SENSED | {"neighbours": [1, 4]}], Wrong.SHAPE),
        ([SENSED, EXCHANGED | {"messages": [SAID | {"src": 9}]}], Wrong.SHAPE),
        ([SENSED, EXCHANGED | {"messages": [SAID | {"k": 8}]}], Wrong.FUTURE),
        ([SENSED, EXCHANGED | {"messages": [SAID | {"k": 2**64 - 1}]}], Wrong.FUTURE),
        ([SENSED | {"clock": 2**64 - 1}], Wrong.MALFORMED),
    ],
)
def test_an_inbox_that_is_not_due_is_refused(told, wrong):
    read(*told[:-1])
    with pytest.raises(WireError) as error:
        read(*told)
    assert error.value.wrong is wrong


def test_an_inbox_that_is_missing_is_noticed():
    with pytest.raises(UninstructedLoss, match="message 2 came where 1 was due"):
        read(SENSED, AGAIN)


ROSTER = {"k": 7, "src": "netem", "seq": 0, "awake": [1], "restarted": [], "remembering": []}


@pytest.mark.parametrize("field", ["awake", "restarted", "remembering"])
def test_a_roster_calls_nobody_of_another_host(field):
    assert Roster(None, (1, 2)).read(msgpack.packb(ROSTER)).awake == [1]
    with pytest.raises(WireError, match="none of this host's"):
        Roster(None, (1, 2)).read(msgpack.packb(ROSTER | {field: [1, 3]}))


SENSE = {
    "k": 7,
    "src": "world",
    "seq": 0,
    "last": False,
    "measured": packed(np.ones((4, 2))),
    "position": packed(np.ones((3, 2))),
    "motion": packed(np.ones((3, 1, 2))),
    "sightings": [{"position": packed([1.0, 2.0]), "done": True, "by": 0, "method": 1}] * 3,
    "fired": [],
}


@pytest.mark.parametrize(
    "change",
    [
        {"k": 6},
        {"k": 8},
        {"measured": packed(np.ones((3, 2)))},
        {"position": packed(np.ones((3, 3)))},
        {"motion": packed(np.ones(5))},
        {"sightings": SENSE["sightings"][:2]},
    ],
    ids=str,
)
def test_what_the_world_senses_is_whole_and_of_the_tick(change):
    assert Senses(4, 3, 2).read(msgpack.packb(SENSE), 7).k == 7
    with pytest.raises(WireError, match="the world"):
        Senses(4, 3, 2).read(msgpack.packb(SENSE | change), 7)


def test_at_the_end_nothing_is_sensed():
    end = SENSE | {"last": True, "measured": b"", "position": b"", "motion": None, "sightings": None}
    assert Senses(4, 3, 2).read(msgpack.packb(end), 7).last
