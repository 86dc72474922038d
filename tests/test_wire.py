"""The wire: every message survives the trip, and what is no such message is refused by name and field."""

from dataclasses import asdict, replace

import msgpack
import numpy as np
import pytest
from airs import IMPAIRMENTS, mixture
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from agents.brief import Brief
from agents.process import AgentBrief
from analysis.models.affine import Manoeuvre
from analysis.models.pursuit import Target
from analysis.models.sensor import Sensor
from netem.core.links import Links
from netem.core.plain import PlainError, from_plain, plainly
from netem.faults.fault import DepartedBody, Fault, UnderWay, Verb
from netem.faults.trigger import Trigger
from netem.impairments.delay import DelayLaw
from netem.loading.choice import Choice
from netem.process import MediumBrief
from netem.wire import messages
from netem.wire.messages import Phase, WireError
from netem.wire.session import Login


def name(message):
    return type(message).__name__


MESSAGES = [
    messages.Sense(
        k=7,
        src="world",
        seq=7,
        last=False,
        measured=[[0.5, -1.0]],
        position=[[1.0, 2.0], [0.5, 3.0]],
        motion=[[[0.25, 0.0], [1.0, 2.0]], [[0.0, -4.0], [3.0, 0.5]]],
        sightings=[{"position": [1.5, 2.0], "done": True, "by": 0, "method": 1}] * 2,
        fired=[1],
    ),
    messages.SenseInbox(
        k=7,
        src="netem",
        seq=14,
        phase=Phase.SENSE,
        clock=9,
        neighbours=[2],
        measured=[[0.5, 1.0]],
        position=None,
        motion=[[0.25, 0.0], [1.0, 2.0]],
        sighting={"position": [1.5, 2.0], "done": True, "by": 0, "method": 1},
    ),
    messages.Broadcast(
        k=7, src=3, channel="theta", seq=7, payload={"local": [[1.0, 0.0], [0.0, 1.0]], "feasible": True}
    ),
    messages.ExchangeInbox(k=7, src="netem", seq=15, phase=Phase.EXCHANGE, messages=[]),
    messages.EndInbox(k=7, src="netem", seq=16, phase=Phase.END),
    messages.Act(
        k=7,
        src=3,
        seq=7,
        input=[1.0, 2.0],
        estimate=[[1.0, 0.0]],
        known=[True],
        covariance=[[0.5, 0.0, 0.5]],
        psi=0.25,
        feasible=True,
        reports={"place": [1.0, 2.0]},
        heard=12,
    ),
    messages.Journal(
        k=7,
        src="netem",
        seq=7,
        fates=[[0, 1], [2, 7]],
        odd=[[1, 0, 9, 0, 8]],
        apart=[[4, 1, 1, 0]],
        late=1,
        dropped=[[3, 1, 1, 0, 5]],
        released=[[4, 1, 1, 1]],
        handed=[1, 0],
        injected=None,
    ),
]
FIELDS = [
    pytest.param(message, field, id=f"{name(message)}.{field}") for message in MESSAGES for field in message._fields
]


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_a_message_survives_the_trip(message):
    assert messages.unpack(type(message), messages.pack(message)) == message


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_a_message_is_a_plain_map_for_any_messagepack_codec(message):
    plain = msgpack.unpackb(messages.pack(message))
    assert plain == message._asdict()
    assert {"k", "src", "seq"} <= plain.keys()


@pytest.mark.parametrize("message", [m for m in MESSAGES if hasattr(m, "phase")], ids=name)
def test_an_inbox_is_known_by_its_phase(message):
    assert messages.unpack_inbox(messages.pack(message)) == message


def test_arrays_travel_as_nested_lists():
    sense = MESSAGES[0]._replace(measured=np.array([[0.1, 0.2]]), position=np.zeros((2, 2)))
    arrived = messages.unpack(messages.Sense, messages.pack(sense))
    assert arrived.measured == [[0.1, 0.2]]
    assert arrived.position == [[0.0, 0.0], [0.0, 0.0]]


def test_numpy_scalars_travel_as_numbers():
    act = MESSAGES[5]._replace(k=np.int64(7), psi=np.float64(0.25), heard=np.int32(12), known=np.array([True]))
    assert messages.unpack(messages.Act, messages.pack(act)) == MESSAGES[5]


def test_an_undefined_indicator_travels_as_nan():
    assert np.isnan(messages.unpack(messages.Act, messages.pack(MESSAGES[5]._replace(psi=np.nan))).psi)


def test_numbers_arrive_bit_for_bit():
    numbers = [0.1, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0, np.inf]
    arrived = messages.unpack(messages.Act, messages.pack(MESSAGES[5]._replace(input=np.array(numbers)))).input
    assert np.array(arrived).tobytes() == np.array(numbers).tobytes()


@pytest.mark.parametrize("message", MESSAGES[:2], ids=name)
def test_single_integrators_are_told_no_motion(message):
    assert messages.unpack(type(message), messages.pack(message._replace(motion=None))).motion is None


def test_a_whole_number_will_do_for_a_number():
    arrived = messages.unpack(messages.Act, msgpack.packb(MESSAGES[5]._asdict() | {"psi": 1}))
    assert type(arrived.psi) is float


# ---- what is no such message


@pytest.mark.parametrize(("message", "field"), FIELDS)
def test_a_missing_field_is_named(message, field):
    plain = {name: value for name, value in message._asdict().items() if name != field}
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: .*unknown \[\], missing \['{field}'\]") as error:
        messages.unpack(type(message), msgpack.packb(plain))
    assert "docs/protocol.md" in str(error.value)


@pytest.mark.parametrize("message", MESSAGES, ids=name)
def test_an_unknown_field_is_named(message):
    data = msgpack.packb(message._asdict() | {"colour": "red"})
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: .*unknown \['colour'\], missing \[\]"):
        messages.unpack(type(message), data)


@pytest.mark.parametrize(("message", "field"), FIELDS)
def test_a_field_of_the_wrong_type_is_named_with_what_came(message, field):
    wrong = "lunch" if field in {"payload", "sighting", "reports"} else {"lunch": 1}
    data = msgpack.packb(message._asdict() | {field: wrong})
    with pytest.raises(WireError, match=rf"^{type(message).__name__}: {field}: expected .*lunch"):
        messages.unpack(type(message), data)


@pytest.mark.parametrize(
    ("field", "wrong", "match"),
    [
        ("k", 7.0, "Act: k: expected an integer, got 7.0"),
        ("k", "7", "Act: k: expected an integer, got '7'"),
        ("k", True, "Act: k: expected an integer, got True"),
        ("psi", None, "Act: psi: expected a number, got None"),
        ("psi", True, "Act: psi: expected a number, got True"),
        ("input", 1.0, "Act: input: expected a list, got 1.0"),
    ],
)
def test_no_type_is_taken_for_another(field, wrong, match):
    with pytest.raises(WireError, match=match):
        messages.unpack(messages.Act, msgpack.packb(MESSAGES[5]._asdict() | {field: wrong}))


def test_an_overlong_value_is_shortened_in_the_message():
    with pytest.raises(WireError, match="Act: k") as error:
        messages.unpack(messages.Act, msgpack.packb(MESSAGES[5]._asdict() | {"k": "x" * 10_000}))
    assert len(str(error.value)) < 200


@pytest.mark.parametrize("plain", [None, 3, "sense", [1, 2], []])
def test_what_is_no_map_is_refused(plain):
    with pytest.raises(WireError, match=r"Act: expected a map \(Act\)"):
        messages.unpack(messages.Act, msgpack.packb(plain))


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
    with pytest.raises(WireError, match="not MessagePack"):
        read(data)


@pytest.mark.parametrize("phase", [None, "lunch", 3, True, [], {}, ["sense"]], ids=repr)
def test_an_inbox_of_no_phase_is_refused_with_the_phases_there_are(phase):
    with pytest.raises(WireError, match=r"phase among .*sense.*exchange.*end"):
        messages.unpack_inbox(msgpack.packb({"k": 1, "src": "netem", "seq": 0, "phase": phase}))


def test_an_inbox_with_the_fields_of_another_phase_is_refused():
    with pytest.raises(WireError, match=r"^ExchangeInbox: .*missing \['messages'\]"):
        messages.unpack_inbox(msgpack.packb(MESSAGES[1]._asdict() | {"phase": "exchange"}))


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
    field = message._fields[number % len(message._fields)]
    plain, refused = message._asdict() | {field: value}, ""
    try:
        arrived = messages.unpack(type(message), msgpack.packb(plain))
    except WireError as error:
        refused = str(error)
    if refused:
        assert refused.startswith(f"{name(message)}: {field}")
    else:
        np.testing.assert_equal(arrived._asdict(), plain)


# ---- relaying


def test_an_exchange_inbox_holds_the_maps_that_were_broadcast():
    said = [messages.Broadcast(7, src, "theta", 7, {"local": np.eye(2) * src, "feasible": True}) for src in (1, 2)]
    inbox = messages.unpack_inbox(messages.pack_exchange(7, 15, [messages.pack(broadcast) for broadcast in said]))
    assert inbox == messages.ExchangeInbox(
        k=7,
        src="netem",
        seq=15,
        phase=Phase.EXCHANGE,
        messages=[
            {"k": 7, "src": 1, "channel": "theta", "seq": 7, "payload": {"local": [[1, 0], [0, 1]], "feasible": True}},
            {"k": 7, "src": 2, "channel": "theta", "seq": 7, "payload": {"local": [[2, 0], [0, 2]], "feasible": True}},
        ],
    )


@pytest.mark.parametrize("number", [0, 1, 15, 16, 70_000])
def test_an_exchange_inbox_relays_any_number_of_broadcasts_byte_for_byte(number):
    said = msgpack.packb({"payload": {"x": 1.5}, "seq": 0, "k": 7, "src": 1, "channel": "x"}, use_single_float=True)
    data = messages.pack_exchange(7, 0, [said] * number)
    assert data.endswith(said * number)
    assert messages.unpack_inbox(data).messages == [msgpack.unpackb(said)] * number


def test_an_exchange_inbox_equals_one_packed_at_once():
    said = messages.pack(MESSAGES[2])
    at_once = messages.ExchangeInbox(7, "netem", 15, Phase.EXCHANGE, [MESSAGES[2]._asdict()])
    assert messages.pack_exchange(7, 15, [said]) == messages.pack(at_once)


# ---- briefs

BRIEF = Brief(
    dt=0.01,
    nominal=np.array([1.0, 0.0]),
    relative=np.array([[1.0, -1.0], [0.5, 0.0], [0.0, 0.0]]),
    present=np.array([True, True, False]),
    back=np.array([1, 0, 0]),
    stress=np.array([0.3, -0.1, 0.0]),
    leads=np.array([True, False, False]),
    sensor=Sensor("coordinates", 0.01 * np.eye(2)),
    process=1e-6 * np.arange(36.0).reshape(6, 6),
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
    dictionary_file="/tmp/users",
    seed=2**64 - 1,
    links=LINKS,
    channels=("sense", "theta"),
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
)


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
    reports={"place": (3,)},
    checkpoint="/tmp/agent-2.npz",
    remembers=True,
)


def plain_of(brief):
    return msgpack.unpackb(msgpack.packb(brief, default=plainly))


@pytest.mark.parametrize(
    "brief",
    [
        *(BRIEF, replace(BRIEF, mission=None), AGENT, replace(AGENT, limit=None, checkpoint=None, remembers=False)),
        *(MEDIUM, *MEDIUM.faults, *MEDIUM.triggers),
    ],
    ids=[
        "place",
        "no mission",
        "agent",
        "no limit, no checkpoint",
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
        ({"seed": "1"}, "^seed: expected an integer, got '1'"),
        ({"login": 3}, r"^login: expected a map \(Login\), got 3"),
        ({"login": {"endpoint": "tcp/x", "name": "netem"}}, r"^login: Login has .*missing \['password'\]"),
        ({"channels": ["sense", 3]}, r"^channels\[\]: expected a text, got 3"),
        (
            {"links": {"agents": 2, "src": [[1], [2, 3]], "dst": [1], "swarm": 2}},
            r"^links\.src: expected a rectangular list of int64",
        ),
        ({"links": {"agents": 2, "src": {}, "dst": [1], "swarm": 2}}, r"^links\.src: expected a nested list"),
        ({"links": {"agents": 2, "src": [1.7], "dst": [1], "swarm": 2}}, r"^links\.src: .*int64.*1\.7"),
        ({"links": {"agents": 2, "src": ["2"], "dst": [1], "swarm": 2}}, r"^links\.src: .*int64.*'2'"),
        ({"links": {"agents": 2, "src": [True], "dst": [1], "swarm": 2}}, r"^links\.src: .*int64.*True"),
        (
            {"links": {"agents": 2, "src": [2**64 - 1], "dst": [1], "swarm": 2}},
            r"^links\.src: .*int64.*18446744073709551615",
        ),
        ({"positioned": [1, 0, 2]}, r"^positioned: .*bool.*2"),
        ({"positioned": ["no"]}, r"^positioned: .*bool.*'no'"),
        (
            {"profiles": [asdict(PROFILE), asdict(PROFILE) | {"duplicate": [None]}]},
            r"^profiles\[\]\.duplicate: .*float64.*None",
        ),
        (
            {"profiles": [asdict(PROFILE) | {"duplicate": ["1"]}]},
            r"^profiles\[\]\.duplicate: .*float64.*'1'",
        ),
        ({"profiles": asdict(PROFILE)}, r"^profiles: expected a list"),
        (
            {"triggers": [{"level": 1.0, "above": 1, "ticks": 2}]},
            r"^triggers\[\]\.above: expected true or false, got 1",
        ),
        ({"triggers": [{"level": 1.0, "above": True}]}, r"^triggers\[\]: Trigger has .*missing \['ticks'\]"),
    ],
)
def test_what_does_not_fit_a_brief_is_named_by_its_path(wrong, match):
    with pytest.raises(PlainError, match=match):
        from_plain(MediumBrief, plain_of(MEDIUM) | plain_of(wrong))


def test_an_unknown_verb_of_a_fault_is_named_with_those_there_are():
    plain = plain_of(MEDIUM)
    plain["faults"][2]["verb"] = "explode"
    with pytest.raises(PlainError, match=r"^faults\[\]\.verb: expected one of .*cut.*depart.* got 'explode'"):
        from_plain(MediumBrief, plain)


def test_an_unknown_word_in_a_brief_is_named_with_those_there_are():
    with pytest.raises(PlainError, match=r"^leaders: expected one of \['pilot', 'distances'\], got 'chase'"):
        from_plain(AgentBrief, plain_of(AGENT) | {"leaders": "chase"})


def test_what_has_no_plain_form_is_not_packed():
    with pytest.raises(TypeError, match="object has no plain form"):
        messages.pack(MESSAGES[2]._replace(payload={"thing": object()}))


def test_a_record_of_what_has_no_plain_form_is_refused_with_what_there_is():
    # KeyError: NDArray[numpy.float64], on every Python for which NumPy defines NDArray by another means.
    with pytest.raises(
        TypeError, match=r"float32.* has no plain form: records are made of int, float, str, bool, .*float64"
    ):
        from_plain(NDArray[np.float32], [1.0])
    assert from_plain(NDArray[np.float64], [1, 2]).dtype == np.float64
