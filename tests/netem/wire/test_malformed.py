"""Whatever an agent sends over Zenoh is read as it should be, or is an error that names the agent and what was expected."""

import msgpack
import numpy as np
import pytest
from msgspec.structs import asdict

from agents.arrivals import Arrivals
from netem.core.links import Links
from netem.core.plain import shown
from netem.wire import messages
from netem.wire.arrays import Form
from netem.wire.broadcasts import Broadcasts
from netem.wire.keys import Keys
from netem.wire.payloads import Payloads
from netem.wire.sequence import UninstructedLoss
from netem.wire.wrong import WireError
from world.acts import Acts

KEYS = Keys("r1")
LINKS = Links.both_ways(3, [(1, 2), (2, 3)])  # agent 2 has two neighbours, the others one
TICK = 7
SAID = {"k": TICK, "src": 2, "channel": "input", "seq": 0, "payload": {"velocity": [1.0, 2.0]}}
ACT = {
    "k": TICK,
    "src": 2,
    "seq": 0,
    "input": [1.0, 2.0],
    "estimate": [[1.0, 0.0], [0.5, 0.5]],
    "known": [True, False],
    "covariance": [[0.5, 0.0, 0.5]] * 2,
    "psi": 0.25,
    "feasible": True,
    "reports": {"place": [1.0, 2.0]},
    "heard": 12,
}


def nested(depth):
    return b"\x91" * depth + b"\x90"


def with_field(plain, field, packed):
    """A packed map, one field of which is bytes of any kind."""
    head = msgpack.Packer().pack_map_header(len(plain))
    parts = (msgpack.packb(name) + (packed if name == field else msgpack.packb(value)) for name, value in plain.items())
    return head + b"".join(parts)


FORMS = {"input": {"velocity": Form((2,), truths=False)}}
NEIGHBOURS = {agent: frozenset(LINKS.neighbours_of(agent)) for agent in (1, 2, 3)}


def broadcast(data, key=None, tick=TICK, awaited=None):
    payloads = Payloads(FORMS, NEIGHBOURS, 2, foreign=frozenset())
    reader = Broadcasts(KEYS, range(1, 4), ("input", "measurement"), payloads)
    return reader.read(key or KEYS.broadcast(2, "input"), data, tick, awaited or {(2, "input"), (2, "measurement")})


def act(data):
    reader = Acts(KEYS, LINKS, 2, {"place": (2,)})
    reader.expect([0, 12, 0])
    read = reader.read(KEYS.act(2), data, TICK, {1, 2, 3})
    return reader.together({2: read})


EXTENSION, TIMESTAMP = msgpack.packb(msgpack.ExtType(5, b"abc")), msgpack.packb(msgpack.Timestamp(1, 2))
WRONG = [
    pytest.param(msgpack.packb("text"), id="text"),
    pytest.param(msgpack.packb(None), id="nil"),
    pytest.param(msgpack.packb({}), id="map"),
    pytest.param(msgpack.packb(b"bytes"), id="bytes"),
    pytest.param(msgpack.packb(["1", "2"]), id="numbers as texts"),
    pytest.param(msgpack.packb([1.0, None]), id="nil among numbers"),
    pytest.param(msgpack.packb([True, False]), id="truths"),
    pytest.param(msgpack.packb([1.0]), id="too short"),
    pytest.param(msgpack.packb([1.0, 2.0, 3.0]), id="too long"),
    pytest.param(msgpack.packb([[1.0, 2.0], [3.0]]), id="ragged"),
    pytest.param(msgpack.packb([[1.0, 2.0]]), id="a level too many"),
    pytest.param(msgpack.packb([[]]), id="an empty list in a list"),
    pytest.param(b"\x92" + EXTENSION * 2, id="extension types"),
    pytest.param(b"\x92" + TIMESTAMP * 2, id="timestamps"),
    pytest.param(nested(100), id="a hundred levels"),
    pytest.param(nested(900), id="nine hundred levels"),
]


@pytest.mark.parametrize(
    ("plain", "says"),
    [
        ({"src": 1}, "it speaks as agent 1, on 'input', of tick 7; channels here are input, measurement"),
        ({"src": 2**63}, "it speaks as agent 9223372036854775808, on 'input', of tick 7"),
        ({"channel": "measurement"}, "it speaks as agent 2, on 'measurement', of tick 7"),
        ({"channel": "x" * 1000}, "it speaks as agent 2, on 'xxxx"),
        ({"k": 6}, "it speaks as agent 2, on 'input', of tick 6"),
        ({"k": 8}, "it speaks as agent 2, on 'input', of tick 8"),
        ({"k": -1}, "it speaks as agent 2, on 'input', of tick -1"),
        ({"k": float("nan")}, "Broadcast: k: expected `int`, got `float`"),
        ({"k": "7"}, "Broadcast: k: expected `int`, got `str`"),
        ({"k": None}, "Broadcast: k: expected `int`, got `None`"),
        ({"seq": True}, "Broadcast: seq: expected `int`, got `bool`"),
        ({"payload": [1, 2]}, "Broadcast: payload: expected `object`, got `array`"),
        ({"payload": None}, "Broadcast: payload: expected `object`, got `None`"),
        ({"colour": "red"}, "object contains unknown field `colour`"),
    ],
)
def test_a_broadcast_that_is_none_of_this_tick_names_its_agent(plain, says):
    with pytest.raises(WireError) as error:
        broadcast(msgpack.packb(SAID | plain))
    assert str(error.value).startswith("agent 2 on 'input'")
    assert says in str(error.value)
    assert len(str(error.value)) < 300


@pytest.mark.parametrize(
    "data",
    [
        pytest.param(b"", id="nothing"),
        pytest.param(b"\xc1", id="reserved byte"),
        pytest.param(msgpack.packb(3), id="a number"),
        pytest.param(msgpack.packb([SAID]), id="a list"),
        pytest.param(msgpack.packb(SAID) * 2, id="two at once"),
        pytest.param(EXTENSION, id="an extension type"),
        pytest.param(b"\x81\x01\x02", id="a key that is no text"),
        pytest.param(b"\x81\x91\x01\x02", id="a key that is a list"),
        pytest.param(with_field(SAID, "k", b"\xcf" + b"\xff" * 8), id="a tick of 64 bits"),
        pytest.param(with_field(SAID, "k", nested(900)), id="a tick that nests"),
        pytest.param(with_field(SAID, "channel", b"\xa3\xed\xa0\x80"), id="a surrogate"),
        pytest.param(with_field(SAID, "payload", nested(5000)), id="nested deeper than any codec reads"),
        # It could be read here, and by nobody to whom it would be passed on.
        pytest.param(with_field(SAID, "payload", b"\x81\xa1x" + nested(1021)), id="nested as deep as can be read here"),
    ],
)
def test_bytes_that_are_no_broadcast_name_their_agent(data):
    with pytest.raises(WireError, match=r"^agent 2 on 'input'"):
        broadcast(data)


def test_a_channel_that_is_not_flown_names_its_agent():
    with pytest.raises(WireError, match=r"^agent 2 on 'gossip' in tick 7: .*channels here are input, measurement"):
        broadcast(msgpack.packb(SAID | {"channel": "gossip"}), key=KEYS.broadcast(2, "gossip"))


def test_who_speaks_twice_is_named():
    with pytest.raises(WireError, match=r"^agent 2 on 'input': it speaks twice in tick 7"):
        broadcast(msgpack.packb(SAID), awaited={(1, "input")})


def test_who_skips_a_number_is_named():
    with pytest.raises(UninstructedLoss, match=r"^agent 2 input: message 3 came where 0 was due"):
        broadcast(msgpack.packb(SAID | {"seq": 3}))


def test_a_broadcast_that_fits_is_read_as_it_was_said():
    assert asdict(broadcast(msgpack.packb(SAID))) == {**SAID, "at": None}


# ---- acts


BYTES = {name: np.array(ACT[name]).tobytes() for name in ("input", "estimate", "known", "covariance")}


@pytest.mark.parametrize("own", [{}, BYTES], ids=["lists", "bytes"])
def test_an_act_that_fits_is_read_as_it_was_said(own):
    done = act(msgpack.packb(ACT | own))
    assert {name: getattr(done, name)[1].tolist() for name in BYTES} == {name: ACT[name] for name in BYTES}
    assert done.reports["place"][1].tolist() == [1.0, 2.0]
    assert np.isnan(done.reports["place"][[0, 2]]).all()


@pytest.mark.parametrize("none", [[], b""], ids=["a list", "bytes"])
@pytest.mark.parametrize("bytes_", [True, False], ids=["bytes", "lists"])
def test_beliefs_are_padded_to_the_widest(none, bytes_):
    reader = Acts(KEYS, LINKS, 2, {})
    reader.expect([12, 0, 12])
    edges = {"estimate": [[4.0, 5.0]], "known": [True], "covariance": [[1.0, 0.0, 1.0]]}
    said = {name: np.array(value).tobytes() for name, value in edges.items()} if bytes_ else edges
    own = {**ACT, "src": 1, **said, "reports": {}}
    nothing = {**ACT, "src": 3, "estimate": none, "known": none, "covariance": none, "reports": {}}
    read = {
        src: reader.read(KEYS.act(src), msgpack.packb(plain), TICK, {1, 2, 3})
        for src, plain in ((1, own), (3, nothing))
    }
    done = reader.together(read)
    assert done.input.tolist() == [[1.0, 2.0], [0.0, 0.0], [1.0, 2.0]]
    assert done.estimate.tolist() == [[[4.0, 5.0], [0.0, 0.0]], [[0.0, 0.0]] * 2, [[0.0, 0.0]] * 2]
    assert done.known.tolist() == [[True, False], [False, False], [False, False]]
    assert done.covariance.shape == (3, 2, 3)


@pytest.mark.parametrize("packed", WRONG)
def test_an_input_of_anything_else_names_its_agent(packed):
    with pytest.raises(
        WireError, match=r"^agent 2: Act: input: expected (numbers of shape \(2\)|`bytes \| array`), got "
    ):
        act(with_field(ACT, "input", packed))


@pytest.mark.parametrize("field", ["estimate", "covariance", "known"])
@pytest.mark.parametrize("packed", [wrong for wrong in WRONG if wrong.id not in {"truths", "too short", "too long"}])
def test_beliefs_of_anything_else_name_their_agent(field, packed):
    with pytest.raises(WireError, match=rf"^agent 2: Act: {field}: expected "):
        act(with_field(ACT, field, packed))


@pytest.mark.parametrize("field", ["estimate", "known", "covariance"])
def test_beliefs_about_more_than_its_neighbours_name_their_agent(field):
    with pytest.raises(
        WireError, match=rf"^agent 2: Act: {field}: expected one for each of its 2 neighbours, or none, got 4"
    ):
        act(msgpack.packb(ACT | {field: ACT[field] * 2}))


@pytest.mark.parametrize("packed", WRONG)
def test_reports_of_anything_else_name_their_agent(packed):
    with pytest.raises(WireError, match=r"^agent 2: Act: reports: place: expected numbers of shape \(2\), got "):
        act(with_field(ACT, "reports", b"\x81\xa5place" + packed))


@pytest.mark.parametrize(
    ("plain", "says"),
    [
        ({"src": 1}, "agent 2 in tick 7: agent 1 acts in tick 7"),
        ({"k": 6}, "agent 2 in tick 7: agent 2 acts in tick 6"),
        ({"k": float("nan")}, "agent 2: Act: k: expected `int`, got `float`"),
        ({"heard": None}, "agent 2: Act: heard: expected `int`, got `None`"),
        ({"psi": "0.5"}, "agent 2: Act: psi: expected `float`, got `str`"),
        ({"feasible": 1}, "agent 2: Act: feasible: expected `bool"),
    ],
)
def test_an_act_that_is_none_of_this_tick_names_its_agent(plain, says):
    with pytest.raises(WireError) as error:
        act(msgpack.packb(ACT | plain))
    assert str(error.value).startswith(says)


# ---- an agent that hears them


def heard(payload):
    forms = {"input": {"velocity": Form((2,), truths=False)}}
    arrivals = Arrivals({1: (7,), 2: (5, 6)}, width=2, dimension=2, forms=forms)
    said = messages.Broadcast(k=TICK, src=6, channel="input", seq=0, payload=payload)
    return arrivals.heard(TICK, {2: [said]})["input"].fields["velocity"][1, 1].tolist()


def test_what_a_neighbour_says_is_heard_as_numbers():
    assert heard({"velocity": [1, 2.5]}) == [1.0, 2.5]
    assert heard({"velocity": np.array([1.0, 2.5]).tobytes()}) == [1.0, 2.5]


@pytest.mark.parametrize("packed", WRONG)
def test_what_a_neighbour_says_that_is_no_such_field_names_the_neighbour(packed):
    velocity = msgpack.unpackb(packed)
    with pytest.raises(WireError, match=r"^agent 6 on 'input': 'velocity': expected numbers of shape \(2\), got "):
        heard({"velocity": velocity})


def test_a_neighbour_that_leaves_a_field_out_is_named():
    with pytest.raises(WireError, match=r"^agent 6 on 'input': 'velocity': expected numbers of shape \(2\), got None"):
        heard({"speed": [1.0, 2.0]})


def test_what_is_shown_of_anything_is_short():
    deep = msgpack.unpackb(nested(1000))
    assert shown("x" * 1000) == "'" + "x" * 76 + "..."
    assert shown(deep) == "a list that nests too deep"
