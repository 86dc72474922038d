"""The wire: every message survives the trip, and what is no such message is refused by name and field."""

import re
import struct
from dataclasses import asdict, replace

import msgpack
import numpy as np
import pytest
from airs import IMPAIRMENTS, mixture
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec import to_builtins
from msgspec.structs import replace as changed
from numpy.typing import NDArray

from agents.brief import Brief
from agents.node import AgentBrief, HostBrief
from agents.timer import Timer
from analysis.models.affine import Manoeuvre
from analysis.models.pursuit import Target
from analysis.models.sensor import Sensor
from netem.brief import MediumBrief
from netem.core.links import Links
from netem.core.pace import Pace
from netem.core.plain import PlainError, from_plain, to_plain
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.trigger import Trigger
from netem.impairments.delay import DelayLaw
from netem.loading.choice import Choice
from netem.wire import messages
from netem.wire.arrays import CODE, FLOAT, TRUTH, WHOLE, Form, channel_rows, numbers, packed
from netem.wire.intake import Trust
from netem.wire.session import Login
from netem.wire.wrong import WireError

SIGHTED = messages.Sighted(position=packed([1.5, 2.0]), done=True, by=0, method=1)


def name(message):
    return type(message).__name__


def plain(message):
    return msgpack.unpackb(messages.pack(message))


def same(one, other):
    """Whether two messages say the same, number by number."""
    assert type(one) is type(other)
    np.testing.assert_equal(plain(one), plain(other))


MESSAGES = [
    messages.Sense(
        k=7,
        src="world",
        seq=7,
        last=False,
        measured=packed([[0.5, -1.0]]),
        position=packed([[1.0, 2.0], [0.5, 3.0]]),
        motion=packed([[[0.25, 0.0], [1.0, 2.0]], [[0.0, -4.0], [3.0, 0.5]]]),
        sightings=[SIGHTED] * 2,
        fired=[1],
    ),
    messages.SenseInbox(
        k=7,
        src="netem",
        seq=14,
        clock=9,
        neighbours=[2],
        measured=packed([[0.5, 1.0]]),
        position=None,
        motion=packed([[0.25, 0.0], [1.0, 2.0]]),
        sighting=SIGHTED,
    ),
    messages.Broadcast(
        k=7, src=3, channel="theta", seq=7, payload={"local": [[1.0, 0.0], [0.0, 1.0]], "feasible": True}
    ),
    messages.ExchangeInbox(k=7, src="netem", seq=15, messages=[]),
    messages.EndInbox(k=7, src="netem", seq=16),
    messages.Act(
        k=7,
        src=3,
        seq=7,
        input=packed([1.0, 2.0]),
        estimate=packed([[1.0, 0.0]]),
        known=packed([True], TRUTH),
        covariance=packed([[0.5, 0.0, 0.5]]),
        psi=0.25,
        feasible=True,
        reports={"place": [1.0, 2.0]},
        heard=12,
    ),
    messages.Journal(
        k=7,
        src="netem",
        seq=7,
        verdicts=packed([[0, 1], [2, 7]], CODE),
        odd=packed([[1, 0, 9, 0, 8]], WHOLE),
        apart=packed([[4, 1, 1, 0]], WHOLE),
        late=1,
        dropped=packed([[3, 1, 1, 0, 5]], WHOLE),
        released=packed([[4, 1, 1, 1]], WHOLE),
        handed=[1, 0],
        injected=None,
    ),
    messages.Roster(k=7, src="netem", seq=7, awake=[1, 3], restarted=[3], remembering=[]),
]
FIELDS = [
    pytest.param(message, field, id=f"{name(message)}.{field}") for message in MESSAGES for field in plain(message)
]


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_a_message_survives_the_trip(message):
    same(messages.unpack(type(message), messages.pack(message)), message)


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_a_message_is_a_plain_map_for_any_messagepack_codec(message):
    np.testing.assert_equal(
        {name: value for name, value in plain(message).items() if name != "phase"}, plainly(message_fields(message))
    )
    assert {"k", "src", "seq"} <= plain(message).keys()


def plainly(value):
    return to_builtins(value, builtin_types=(bytes,))


def message_fields(message):
    """All but those of runs in real time that are left as they are."""
    names, defaults = message.__struct_fields__, message.__struct_defaults__
    unsaid = dict(zip(names[len(names) - len(defaults) :], defaults, strict=True))
    said = {name: getattr(message, name) for name in names}
    return {name: value for name, value in said.items() if name not in unsaid or value != unsaid[name]}


@pytest.mark.parametrize("message", [m for m in MESSAGES if "phase" in plain(m)], ids=name)
def test_an_inbox_is_known_by_its_phase(message):
    same(messages.unpack_inbox(messages.pack(message)), message)


def test_arrays_travel_as_their_bytes_and_arrive_as_arrays():
    assert plain(MESSAGES[0])["measured"] == struct.pack("<2d", 0.5, -1.0)
    arrived = numbers(messages.unpack(messages.Sense, messages.pack(MESSAGES[0])).measured, "", (-1, 2))
    assert arrived.dtype == np.float64
    assert arrived.tolist() == [[0.5, -1.0]]


def test_numpy_scalars_travel_as_numbers():
    act = changed(MESSAGES[5], k=np.int64(7), psi=np.float64(0.25), heard=np.int32(12))
    same(messages.unpack(messages.Act, messages.pack(act)), MESSAGES[5])


def test_an_undefined_indicator_travels_as_nan():
    assert np.isnan(messages.unpack(messages.Act, messages.pack(changed(MESSAGES[5], psi=np.nan))).psi)


@pytest.mark.parametrize("way", [packed, np.ndarray.tolist], ids=["bytes", "a list"])
def test_numbers_arrive_bit_for_bit(way):
    said = np.array([0.1, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0, np.inf])
    arrived = messages.unpack(messages.Act, messages.pack(changed(MESSAGES[5], input=way(said)))).input
    assert numbers(arrived, "", (6,)).tobytes() == said.tobytes()


@pytest.mark.parametrize(
    ("said", "shape", "dtype"),
    [
        (np.arange(6.0).reshape(3, 2)[:, ::-1], (3, 2), FLOAT),
        (np.arange(6).reshape(3, 2).T, (-1, 3), WHOLE),
        (np.array([True, False]), (2,), TRUTH),
        (np.array(2.5), (), FLOAT),
        (np.empty((0, 2)), (-1, 2), FLOAT),
        (np.array([[7, 255]], np.uint8), (-1, 2), CODE),
    ],
)
def test_an_array_of_any_layout_travels_row_by_row(said, shape, dtype):
    arrived = numbers(packed(said, dtype), "", shape, dtype)
    np.testing.assert_array_equal(arrived, said)
    assert arrived.dtype == dtype
    assert not arrived.flags.writeable


FORMS = {"local": Form((2, 2), truths=False), "feasible": Form((), truths=True)}
THETA = {"local": [[1, 2], [3.5, 4]], "feasible": True}
THETA_BYTES = {"local": packed(THETA["local"]), "feasible": packed(True, TRUTH)}


@pytest.mark.parametrize("one", [THETA, THETA_BYTES], ids=["lists", "bytes"])
@pytest.mark.parametrize("other", [THETA, THETA_BYTES], ids=["lists", "bytes"])
def test_what_several_say_on_a_channel_is_gathered_however_each_says_it(one, other):
    rows = channel_rows(FORMS, [one, None, other], ["agent 1", "", "agent 3"])
    assert rows["local"].tolist() == [THETA["local"], [[0.0, 0.0]] * 2, THETA["local"]]
    assert rows["feasible"].tolist() == [True, False, True]
    assert (rows["local"].dtype, rows["feasible"].dtype) == (FLOAT, TRUTH)


@pytest.mark.parametrize(
    ("field", "wrong", "says"),
    [
        ("local", bytes(31), "'local': expected numbers of shape (2, 2), got 31 bytes"),
        ("local", bytes(40), "'local': expected numbers of shape (2, 2), got 40 bytes"),
        ("local", None, "'local': expected numbers of shape (2, 2), got None"),
        ("local", [1.0, 2.0, 3.0, 4.0], "'local': expected numbers of shape (2, 2), got [1.0, 2.0, 3.0, 4.0]"),
        ("feasible", b"\2", "'feasible': expected truths of shape (), got 1 bytes"),
        ("feasible", 1, "'feasible': expected truths of shape (), got 1"),
    ],
)
def test_who_says_something_else_on_a_channel_is_named(field, wrong, says):
    with pytest.raises(WireError, match=f"^{re.escape(f'agent 3: {says}')}"):
        channel_rows(FORMS, [THETA_BYTES, THETA_BYTES | {field: wrong}], ["agent 1", "agent 3"])


def test_two_wrong_lengths_do_not_make_up_for_each_other():
    short, long = THETA_BYTES | {"local": bytes(24)}, THETA_BYTES | {"local": bytes(40)}
    with pytest.raises(WireError, match=r"^agent 1: 'local': .* got 24 bytes"):
        channel_rows(FORMS, [short, long], ["agent 1", "agent 3"])


@pytest.mark.parametrize("message", MESSAGES[:2], ids=name)
def test_single_integrators_are_told_no_motion(message):
    assert messages.unpack(type(message), messages.pack(changed(message, motion=None))).motion is None


def test_a_whole_number_will_do_for_a_number():
    arrived = messages.unpack(messages.Act, msgpack.packb(plain(MESSAGES[5]) | {"psi": 1}))
    assert type(arrived.psi) is float


# ---- what is no such message


@pytest.mark.parametrize(("message", "field"), FIELDS)
def test_a_missing_field_is_named(message, field):
    rest = {name: value for name, value in plain(message).items() if name != field}
    if field == "phase":  # which one message has, and need not say
        return
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: .*missing required field `{field}`") as error:
        messages.unpack(type(message), msgpack.packb(rest))
    assert "docs/protocol.md" in str(error.value)


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_an_unknown_field_is_named(message):
    data = msgpack.packb(plain(message) | {"colour": "red"})
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: .*unknown field `colour`"):
        messages.unpack(type(message), data)


@pytest.mark.parametrize(("message", "field"), FIELDS)
def test_a_field_of_the_wrong_type_is_named(message, field):
    wrong = "lunch" if field in {"payload", "sighting", "reports"} else {"lunch": 1}
    data = msgpack.packb(plain(message) | {field: wrong})
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: {field}: "):
        messages.unpack(type(message), data)


@pytest.mark.parametrize(
    ("field", "wrong", "says"),
    [
        ("k", 7.0, "k: expected `int`, got `float`"),
        ("k", "7", "k: expected `int`, got `str`"),
        ("k", True, "k: expected `int`, got `bool`"),
        ("psi", None, "psi: expected `float`, got `None`"),
        ("psi", True, "psi: expected `float`, got `bool`"),
        ("input", {}, "input: expected `bytes | array`, got `object`"),
        ("known", True, "known: expected `bytes | array`, got `bool`"),
    ],
)
def test_no_type_is_taken_for_another(field, wrong, says):
    data = msgpack.packb(plain(MESSAGES[5]) | {field: wrong})
    with pytest.raises(WireError, match=re.escape(f"Act: {says}")):
        messages.unpack(messages.Act, data)


@pytest.mark.parametrize("wrong", [["x", {}], [[1.0], [1.0, 2.0]], [None, 1.0], [True, False], "ab", 1.0])
def test_no_list_of_anything_else_is_taken_for_numbers(wrong):
    with pytest.raises(
        WireError, match=rf"^agent 3: expected numbers of shape \(2\), got {re.escape(repr(wrong)[:5])}"
    ):
        numbers(wrong, "agent 3", (2,))


def test_an_overlong_value_is_shortened_in_the_message():
    with pytest.raises(WireError, match=r"expected numbers") as error:
        numbers(["x" * 10_000], "agent 3", (2,))
    assert len(str(error.value)) < 200


@pytest.mark.parametrize("other", [None, 3, "sense", [1, 2], []])
def test_what_is_no_map_is_refused(other):
    with pytest.raises(WireError, match="Act: expected `object`"):
        messages.unpack(messages.Act, msgpack.packb(other))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b"\x91" * 5000,
        b"\x81\x01\x02",
        b"\xa1\xff",
        messages.pack(MESSAGES[5])[:-1],
        messages.pack(MESSAGES[5]) * 2,
    ],
    ids=["empty", "reserved byte", "too deep", "number as key", "not UTF-8", "cut short", "two at once"],
)
@pytest.mark.parametrize(
    "read", [lambda data: messages.unpack(messages.Act, data), messages.unpack_inbox], ids=["unpack", "inbox"]
)
def test_malformed_bytes_are_refused(read, data):
    with pytest.raises(WireError, match=r"docs/protocol\.md"):
        read(data)


@pytest.mark.parametrize("phase", [None, "lunch", 3, True, [], {}, ["sense"]], ids=repr)
def test_an_inbox_of_no_phase_is_refused(phase):
    with pytest.raises(WireError, match=r"^an inbox: (phase: |.*`phase`)"):
        messages.unpack_inbox(msgpack.packb({"k": 1, "src": "netem", "seq": 0, "phase": phase}))


def test_an_inbox_with_the_fields_of_another_phase_is_refused():
    with pytest.raises(WireError, match=r"^an inbox: .*unknown field `clock`"):
        messages.unpack_inbox(msgpack.packb(plain(MESSAGES[1]) | {"phase": "exchange"}))


PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**64 - 1)
    | st.floats()
    | st.text(max_size=5)
    | st.binary(max_size=5),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=8,
)


@settings(max_examples=60, deadline=None)
@given(data=st.binary(max_size=60) | PLAIN.map(msgpack.packb))
def test_whatever_else_comes_is_refused_as_a_wire_error(data):
    for kind in map(type, MESSAGES):
        with pytest.raises(WireError):
            messages.unpack(kind, data)


@settings(max_examples=150, deadline=None)
@given(message=st.sampled_from(MESSAGES), value=PLAIN, number=st.integers(0, 7))
def test_any_value_of_any_field_is_read_as_it_came_or_refused_by_the_name_of_the_field(message, value, number):
    field = message.__struct_fields__[number % len(message.__struct_fields__)]
    said, refused = plain(message) | {field: value}, ""
    try:
        arrived = messages.unpack(type(message), msgpack.packb(said))
    except WireError as error:
        refused = str(error)
    if refused:
        assert re.match(rf"{name(message)}: {field}\b", refused)
    else:
        np.testing.assert_equal(plain(arrived), said)


# ---- relaying


def broadcast(src):
    return messages.Broadcast(
        k=7, src=src, channel="theta", seq=7, payload={"local": packed(np.eye(2) * src), "feasible": True}
    )


def test_an_exchange_inbox_holds_what_was_broadcast():
    inbox = messages.unpack_inbox(messages.pack_exchange(7, 15, [messages.pack(broadcast(src)) for src in (1, 2)]))
    same(inbox, messages.ExchangeInbox(k=7, src="netem", seq=15, messages=[broadcast(1), broadcast(2)]))


@pytest.mark.parametrize("number", [0, 1, 15, 16, 70_000])
def test_an_exchange_inbox_relays_any_number_of_broadcasts_byte_for_byte(number):
    said = msgpack.packb({"payload": {"x": 1.5}, "seq": 0, "k": 7, "src": 1, "channel": "x"}, use_single_float=True)
    data = messages.pack_exchange(7, 0, [said] * number)
    assert data.endswith(said * number)
    assert messages.unpack_inbox(data).messages == [messages.unpack_relayed(said)] * number


def test_an_exchange_inbox_equals_one_packed_at_once():
    at_once = messages.ExchangeInbox(k=7, src="netem", seq=15, messages=[broadcast(1)])
    assert messages.pack_exchange(7, 15, [messages.pack(broadcast(1))]) == messages.pack(at_once)


# ---- briefs

BRIEF = Brief(
    dt=0.01,
    number=np.array(2),
    nominal=np.array([1.0, 0.0]),
    relative=np.array([[1.0, -1.0], [0.5, 0.0], [0.0, 0.0]]),
    present=np.array([True, True, False]),
    back=np.array([1, 0, 0]),
    stress=np.array([0.3, -0.1, 0.0]),
    leads=np.array([True, False, False]),
    sensor=Sensor("coordinates", 0.01 * np.eye(2)),
    process=1e-6 * np.arange(36.0).reshape(6, 6),
    persistence=0.0,
    lateness=0,
    leader=np.array(False),
    target=Target(2, 1.0, np.array([100, 50]), np.array([0.01, 0.1])),
    mission=Manoeuvre(theta=np.eye(2)[None] * np.ones((4, 1, 1)), offset=np.zeros((4, 2))),
)
LINKS = Links.both_ways(3, [(1, 2), (2, 3)])
PROFILE = mixture(3, frozenset(IMPAIRMENTS), LINKS, ("sense", "theta"), coupled=False, least_delay=1)
DEGRADED = mixture(4, frozenset({"delays", "listed"}), LINKS, ("sense", "theta"), coupled=False, least_delay=1)
MEDIUM = MediumBrief(
    run="r1",
    login=Login("tcp/127.0.0.1:7447", "netem", "secret"),
    passwords={"netem": "secret"},
    seed=2**64 - 1,
    links=LINKS,
    channels=("sense", "theta"),
    dimension=2,
    forms={"theta": {"local": Form((2, 2), truths=False)}},
    profiles=(PROFILE, DEGRADED),
    faults=(
        Fault(Verb.CUT, 3, 6, pairs=((1, 2), (2, 1)), under_way=UnderWay.HOLD),
        Fault(Verb.LOSE, 3, 6, pairs=((1, 2),), probability=0.25),
        Fault(Verb.PARTITION, 3, None, groups=((1,), (2, 3))),
        Fault(Verb.KILL, 9, None, agents=(3,), warm=True),
        Fault(Verb.DELAY, 3, 6, trigger=1, pairs=((1, 2),), seconds=0.3),
        Fault(Verb.DEGRADE, 3, 6, pairs=((1, 2),), profile=1),
        Fault(Verb.PAUSE, 3, 6, agents=(2,), under_way=UnderWay.HOLD),
        Fault(Verb.CLOCK, 3, 6, agents=(2,), rate=-0.5),
        Fault(Verb.DEPART, 3, 6, agents=(2,), body=DepartedBody.DRIFT),
        Fault(Verb.GUST, 3, 6, agents=(2,), vector=(1.0, -0.5)),
        Fault(Verb.BIAS, 3, 6, pairs=((1, 2),), vector=(1.0, -0.5)),
        Fault(Verb.OUTLIER, 3, 6, pairs=((1, 2),), probability=0.1, deviation=3.0),
        Fault(Verb.DROPOUT, 3, 6, pairs=((1, 2),), probability=0.5),
        Fault(Verb.FREEZE, 3, 6, pairs=((1, 2),)),
        Fault(Verb.LIE, 3, 6, agents=(2,), matrix=((0.0, 1.0), (-1.0, 0.5))),
    ),
    triggers=(Trigger(level=2.0, above=True, ticks=4), Trigger(level=0.1, above=False, ticks=1)),
    injected=(Fault(Verb.CUT, 5, None, pairs=((2, 3),)),),
    recorded="/tmp/journal.arrows",
    positioned=np.array([True, False, False]),
    hosts={1: (1, 3)},
    trust=Trust("drop", 1 << 20, 100, foreign=frozenset({2})),
    journal="/tmp/run/journal.arrows",
    batch=50,
    gaps=True,
    pace=Pace(dt=0.05, factor=0.5, late=1.0),
    clock_s=-0.25,
)


def links(**wrong):
    return {"links": {"agents": 2, "src": [1], "dst": [1], "swarm": 2} | wrong}


AGENT = AgentBrief(
    run="r1",
    login=Login("tcp/127.0.0.1:7447", "agent-2", "secret"),
    agent=2,
    neighbours=(1, 3),
    estimator=Choice("agents.estimators.none:NoEstimator", {}),
    law=Choice("agents.laws.single:Static", {"alpha": 2.0}),
    leaders="distances",
    leader_gain=1.0,
    limit=3.0,
    brief=BRIEF,
    hears_centre=True,
    reports={"place": (3,)},
    checkpoint="/tmp/agent-2.npz",
    remembers=True,
    timer=Timer(0.1, 0.02, 0.01, 1e-5, 0.04, 0.5, 2**64 - 1, 2),
    clock_s=0.125,
)


def plain_of(brief):
    return msgpack.unpackb(msgpack.packb(to_plain(brief)), strict_map_key=False)


@pytest.mark.parametrize(
    "brief",
    [
        *(BRIEF, replace(BRIEF, mission=None), AGENT, replace(AGENT, limit=None, checkpoint=None, remembers=False)),
        HostBrief(2, (AGENT, replace(AGENT, agent=3))),
        *(MEDIUM, *MEDIUM.faults, *MEDIUM.triggers),
    ],
    ids=[
        "place",
        "no mission",
        "agent",
        "no limit, no checkpoint",
        "host",
        "medium",
        *(f.verb for f in MEDIUM.faults),
        "above",
        "below",
    ],
)
def test_a_brief_survives_the_trip(brief):
    arrived = from_plain(type(brief), plain_of(brief))
    assert type(arrived) is type(brief)
    np.testing.assert_equal(asdict(arrived), asdict(brief))


def test_every_verb_travels():
    assert {fault.verb for fault in MEDIUM.faults} == set(Verb)


def test_arrays_of_a_brief_keep_their_types_and_shapes():
    arrived, medium = from_plain(Brief, plain_of(BRIEF)), from_plain(MediumBrief, plain_of(MEDIUM))
    assert arrived.relative.dtype == np.float64
    assert arrived.present.dtype == np.bool_
    assert arrived.leader.shape == ()
    assert medium.links.src.dtype == np.int64
    assert medium.profiles[0].listed.dtype == medium.profiles[0].schedules[0].period.dtype == np.int64
    assert medium.profiles[0].delays[0].rows.dtype == np.bool_
    assert medium.profiles[0].chains[0].cumulative.shape == PROFILE.chains[0].cumulative.shape
    assert arrived.mission.theta.shape == (4, 2, 2)


def test_nested_records_enums_and_tuples_of_a_brief_come_back_as_they_were():
    arrived = from_plain(MediumBrief, plain_of(MEDIUM))
    assert arrived.faults == MEDIUM.faults
    assert arrived.faults[0].verb is Verb.CUT
    assert arrived.faults[0].under_way is UnderWay.HOLD
    assert arrived.profiles[0].delays[0].law is DelayLaw.CONSTANT
    own = arrived.profiles[0]
    assert all(len(layers) > 0 for layers in (own.traces, own.reaches, own.zones))
    assert not arrived.profiles[1].traces
    assert arrived.triggers == MEDIUM.triggers
    assert arrived.faults[0].trigger is None
    assert arrived.faults[4].trigger == 1
    assert [fault.body for fault in arrived.faults[:1] + arrived.faults[8:9]] == [DepartedBody.HOLD, DepartedBody.DRIFT]
    assert arrived.faults[-1].matrix == ((0.0, 1.0), (-1.0, 0.5))
    assert arrived.login == MEDIUM.login
    assert arrived.channels == ("sense", "theta")


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"seed": "1"}, "seed: expected `int`, got `str`"),
        ({"login": 3}, "login: expected `object`, got `int`"),
        ({"login": {"endpoint": "tcp/x"}}, "login: object missing required field `name`"),
        ({"channels": ["sense", 3]}, "channels[1]: expected `str`, got `int`"),
        (links(src=[[1], [2, 3]]), "links.src: expected a rectangular list of int64, got [[1], [2, 3]]"),
        (links(src={}), "links.src: expected a nested list of int64, or one, got {}"),
        (links(src=[1.7]), "links.src: expected a nested list of int64, or one, got [1.7]"),
        (links(src=["2"]), "links.src: expected a nested list of int64, or one, got ['2']"),
        (links(src=[True]), "links.src: expected a nested list of int64, or one, got [True]"),
        (links(src=[2**64 - 1]), "links.src: expected a nested list of int64, or one, got [18446744073709551615]"),
        ({"positioned": [1, 0, 2]}, "positioned: expected a nested list of bool, or one, got [1, 0, 2]"),
        ({"positioned": ["no"]}, "positioned: expected a nested list of bool, or one, got ['no']"),
        (
            {"profiles": [PROFILE, asdict(PROFILE) | {"duplicate": [None]}]},
            "profiles[1].duplicate: expected a nested list of float64, or one, got [None]",
        ),
        (
            {"profiles": [asdict(PROFILE) | {"duplicate": ["1"]}]},
            "profiles[0].duplicate: expected a nested list of float64, or one, got ['1']",
        ),
        ({"profiles": asdict(PROFILE)}, "profiles: expected `array`, got `object`"),
        (
            {"triggers": [{"level": 1.0, "above": 1, "ticks": 2}]},
            "triggers[0].above: expected `bool`, got `int`",
        ),
        ({"triggers": [{"level": 1.0, "above": True}]}, "triggers[0]: object missing required field `ticks`"),
    ],
)
def test_what_does_not_fit_a_brief_is_named_by_its_path(wrong, match):
    with pytest.raises(PlainError, match=rf"^MediumBrief: {re.escape(match)}"):
        from_plain(MediumBrief, plain_of(MEDIUM) | plain_of(wrong))


def test_an_unknown_verb_of_a_fault_is_named():
    wrong = plain_of(MEDIUM)
    wrong["faults"][2]["verb"] = "explode"
    with pytest.raises(PlainError, match=re.escape("faults[2].verb: invalid enum value 'explode'")):
        from_plain(MediumBrief, wrong)


def test_an_unknown_word_in_a_brief_is_named():
    with pytest.raises(PlainError, match=re.escape("leaders: invalid enum value 'chase'")):
        from_plain(AgentBrief, plain_of(AGENT) | {"leaders": "chase"})


def test_what_has_no_plain_form_is_not_packed():
    with pytest.raises(TypeError, match="object has no plain form"):
        messages.pack(changed(MESSAGES[2], payload={"thing": object()}))


def test_a_record_of_what_has_no_plain_form_is_refused():
    with pytest.raises(PlainError, match=r"complex.* has no plain form: records are made of numbers, texts"):
        from_plain(complex, [1.0])
    assert from_plain(NDArray[np.float64], [1, 2]).dtype == np.float64
