"""What a rogue agent may say on its own keys, one mistake at a time: made from what it should have said."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import msgpack

from netem.wire.wrong import Wrong

Said = dict[str, Any]
ACT, INPUT, MEASUREMENT = "act", "input", "measurement"
EXTENSION, TIMESTAMP = msgpack.packb(msgpack.ExtType(5, b"abc")), msgpack.packb(msgpack.Timestamp(1, 2))
NAN, INF = float("nan"), float("inf")
LARGEST = 1 << 20


class Hostile(NamedTuple):
    """One of them: on which key, what kind of mistake it is, and how it is made of what should have been said."""

    on: str
    name: str
    wrong: Wrong
    made: Callable[[Said], bytes]

    def __str__(self) -> str:
        return f"{self.on}: {self.name}"


def nested(depth: int) -> bytes:
    """Lists in lists."""
    return b"\x91" * depth + b"\x90"


def with_field(said: Said, field: str, packed: bytes) -> bytes:
    """A packed map, one field of which is bytes of any kind."""
    head = msgpack.Packer().pack_map_header(len(said | {field: None}))
    parts = (msgpack.packb(name) + (packed if name == field else msgpack.packb(value)) for name, value in said.items())
    return head + b"".join(parts) + (b"" if field in said else msgpack.packb(field) + packed)


def _with(on: str, wrong: Wrong, **fields: Any) -> Hostile:
    ((field, value),) = fields.items()
    shown = repr(value) if len(repr(value)) < 40 else f"{type(value).__name__} of {len(value)}"
    return Hostile(on, f"{field} {shown}", wrong, lambda said: msgpack.packb(said | fields))


def _payload(on: str, name: str, change: Callable[[Said], Any], wrong: Wrong = Wrong.SHAPE) -> Hostile:
    return Hostile(on, name, wrong, lambda said: msgpack.packb(said | {"payload": change(said["payload"])}))


def _raw(on: str, field: str, name: str, packed: bytes, wrong: Wrong) -> Hostile:
    return Hostile(on, f"{field} {name}", wrong, lambda said: with_field(said, field, packed))


def _bytes(on: str) -> Iterator[Hostile]:
    """No message at all."""
    for name, data in {
        "nothing": b"",
        "a reserved byte": b"\xc1",
        "a text": msgpack.packb("text"),
        "nil": b"\xc0",
        "a number": msgpack.packb(2**63),
        "an empty map": b"\x80",
        "an empty list": b"\x90",
        "zeros": bytes(100),
        "a list of 2^32": b"\xdd\xff\xff\xff\xff",
        "a map of 2^32": b"\xdf\xff\xff\xff\xff",
        "4 GB of bytes": b"\xc6\xff\xff\xff\xff",
        "an extension": EXTENSION,
        "a time stamp": TIMESTAMP,
        "a number as key": b"\x81\x01\x02",
        "a list as key": b"\x81\x91\x01\x02",
        "no UTF-8": b"\x81\xa1\xff\x02",
    }.items():
        yield Hostile(on, name, Wrong.MALFORMED, lambda _, data=data: data)
    yield Hostile(on, "a list around it", Wrong.MALFORMED, lambda said: msgpack.packb([said]))
    yield Hostile(on, "cut short", Wrong.MALFORMED, lambda said: msgpack.packb(said)[:-1])
    yield Hostile(on, "two at once", Wrong.MALFORMED, lambda said: msgpack.packb(said) * 2)
    yield Hostile(on, "1 MiB and a byte", Wrong.OVERSIZED, lambda _: bytes(LARGEST + 1))
    yield Hostile(on, "10 MB", Wrong.OVERSIZED, lambda _: bytes(10_000_000))
    yield Hostile(on, "1 MiB of empty lists", Wrong.MALFORMED, lambda _: b"\xdd\x00\x0f\xff\xf0" + b"\x90" * 0xFFFF0)


def _envelope(on: str, fields: tuple[str, ...]) -> Iterator[Hostile]:
    """No message of this agent and tick."""
    for field in ("k", "src", "seq"):
        for value in (7.0, "7", None, True, [7], {}, b"7", NAN):
            yield _with(on, Wrong.MALFORMED, **{field: value})
        yield _raw(on, field, "nested 100 deep", nested(100), Wrong.MALFORMED)
        yield _raw(on, field, "an extension", EXTENSION, Wrong.MALFORMED)
    for field in fields:
        yield Hostile(
            on,
            f"no {field}",
            Wrong.MALFORMED,
            lambda said, field=field: msgpack.packb({name: value for name, value in said.items() if name != field}),
        )
    yield _with(on, Wrong.MALFORMED, colour="red")
    yield _raw(on, "colour", "nested 1,000 deep", nested(1000), Wrong.MALFORMED)
    for src in (1, 3, 0, -1, 2**63):
        yield _with(on, Wrong.SPOOFED, src=src)
    for name, wrong, by in (
        ("of the tick before", Wrong.PAST, -1),
        ("of long ago", Wrong.PAST, -(2**62)),
        ("of the next tick", Wrong.FUTURE, 1),
        ("of tick 2^63 and more", Wrong.FUTURE, 2**63),
    ):
        yield Hostile(on, name, wrong, lambda said, by=by: msgpack.packb(said | {"k": said["k"] + by}))
    for name, wrong, by in (
        ("a number skipped", Wrong.SKIPPED, 1),
        ("number 2^63 and more", Wrong.SKIPPED, 2**63),
        ("the number before", Wrong.REPEATED, -1),
        ("number -2^62", Wrong.REPEATED, -(2**62)),
    ):
        yield Hostile(on, name, wrong, lambda said, by=by: msgpack.packb(said | {"seq": said["seq"] + by}))


def _acts() -> Iterator[Hostile]:
    for value in (1e308, 1e200, 1e6, 1.1e5, 2**63, INF, -INF, NAN):
        yield _with(ACT, Wrong.VALUE, input=[value, 0.0])
    for value in (
        ["1", "2"],
        [1.0],
        [1.0, 2.0, 3.0],
        [[1.0, 2.0]],
        [],
        [1.0, None],
        [True, False],
        [[1.0], [1.0, 2.0]],
    ):
        yield _with(ACT, Wrong.SHAPE, input=value)
    for value in (b"1", b"", bytes(15), bytes(17), bytes(24)):
        yield _with(ACT, Wrong.SHAPE, input=value)
    for value in ("1 2", 1.0, None, {}, True):
        yield _with(ACT, Wrong.MALFORMED, input=value)
    two = [[1.0, 0.0], [0.5, 0.5]]
    for value in (NAN, INF, -INF, 1e308):
        yield _with(ACT, Wrong.VALUE, estimate=[[value, 0.0], two[1]])
        yield _with(ACT, Wrong.VALUE, covariance=[[0.5, value, 0.5]] * 2)
    for value in (-0.5, -1e-6, -1e308):
        yield _with(ACT, Wrong.VALUE, covariance=[[0.5, 0.0, value]] * 2)
        yield _with(ACT, Wrong.VALUE, covariance=[[value, 0.0, 0.5]] * 2)
    for value in (two * 2, two[:1], [1.0, 2.0], [["1", "2"], ["3", "4"]], [[1.0], [2.0, 3.0]], bytes(31)):
        yield _with(ACT, Wrong.SHAPE, estimate=value)
    for value in ([[0.5, 0.0, 0.5]] * 3, [[0.5, 0.0]] * 2, [0.5] * 6, bytes(47)):
        yield _with(ACT, Wrong.SHAPE, covariance=value)
    for value in (
        ["yes"],
        ["yes", "no"],
        [1, 0],
        [1.0, 0.0],
        [True],
        [True] * 3,
        [None, None],
        b"\2\0",
        b"\1",
        b"\1\0\1",
    ):
        yield _with(ACT, Wrong.SHAPE, known=value)
    for field in ("estimate", "known", "covariance"):
        yield _raw(ACT, field, "nested 100 deep", nested(100), Wrong.SHAPE)
        yield _raw(ACT, field, "nested 900 deep", nested(900), Wrong.SHAPE)
        yield _raw(ACT, field, "nested 5,000 deep", nested(5000), Wrong.DEEP)
        yield _raw(ACT, field, "of extensions", b"\x92" + EXTENSION * 2, Wrong.SHAPE)
        for value in ("yes", 1.0, None, {}):
            yield _with(ACT, Wrong.MALFORMED, **{field: value})
    for value in (INF, -INF, -1.0, 1e308):
        yield _with(ACT, Wrong.VALUE, psi=value)
    for value in ("0.5", None, [0.5], True):
        yield _with(ACT, Wrong.MALFORMED, psi=value)
    for value in (1, "yes", 0.0, []):
        yield _with(ACT, Wrong.MALFORMED, feasible=value)
    for value in ([], None, "none", 1):
        yield _with(ACT, Wrong.MALFORMED, reports=value)
    for value in ({"colour": [1.0]}, {"": b""}, {"x" * 1000: 1}):
        yield _with(ACT, Wrong.SHAPE, reports=value)
    yield _raw(ACT, "reports", "nested 5,000 deep", b"\x81\xa1x" + nested(5000), Wrong.DEEP)
    for value in (2**63, -1, -(2**62)):
        yield _with(ACT, Wrong.MISCOUNTED, heard=value)
    yield Hostile(
        ACT, "heard one too many", Wrong.MISCOUNTED, lambda said: msgpack.packb(said | {"heard": said["heard"] + 1})
    )
    for value in (None, "12", 12.0, True, [12]):
        yield _with(ACT, Wrong.MALFORMED, heard=value)


def _broadcasts(on: str) -> Iterator[Hostile]:
    for value in ([1, 2], None, "garbage", 1.0, b"garbage", True):
        yield _with(on, Wrong.MALFORMED, payload=value)
    for channel in ("gossip", "theta", "", "x" * 1000, MEASUREMENT if on == INPUT else INPUT):
        yield _with(on, Wrong.SPOOFED, channel=channel)
    for value in (None, 7, ["input"], True):
        yield _with(on, Wrong.MALFORMED, channel=value)
    yield _raw(on, "payload", "nested 900 deep", b"\x81\xa1x" + nested(900), Wrong.SHAPE)
    yield _raw(on, "payload", "nested 1,021 deep", b"\x81\xa1x" + nested(1021), Wrong.DEEP)
    yield _raw(on, "payload", "nested 5,000 deep", b"\x81\xa1x" + nested(5000), Wrong.DEEP)
    yield _payload(on, "nothing in it", lambda _: {})
    yield _payload(on, "garbage in it", lambda _: {"garbage": [1, "two", None, {}]})
    yield _payload(on, "one field too many", lambda payload: payload | {"colour": "red"})


def _inputs() -> Iterator[Hostile]:
    for value in (NAN, INF, -INF, 1e308):
        yield _payload(INPUT, f"velocity {value}", lambda _, value=value: {"velocity": [value, 0.0]}, Wrong.VALUE)
    for value in (
        None,
        "fast",
        ["1", "2"],
        [1.0],
        [[1.0, 2.0]],
        bytes(15),
        bytes(17),
        1.0,
        {},
        [True, False],
        [{}, {}],
    ):
        yield _payload(INPUT, f"velocity {value}", lambda _, value=value: {"velocity": value})


def _measurements() -> Iterator[Hostile]:
    for value in (NAN, INF, 1e308):
        yield _payload(
            MEASUREMENT,
            f"measured {value}",
            lambda said, value=value: said | {"measured": [[value, 0.0]] * 2},
            Wrong.VALUE,
        )
    for value in (
        None,
        "far",
        1.0,
        [["1", "2"]] * 2,
        [[1.0, 2.0]] * 3,
        [1.0] * 4,
        bytes(31),
        bytes(33),
        {},
        [[{}, {}]] * 2,
    ):
        yield _payload(MEASUREMENT, f"measured {value}", lambda said, value=value: said | {"measured": value})
    for value in (
        [1, 4],
        [1, 1],
        [1, 2],
        [1.0, 3.0],
        [True, 3],
        ["1", "3"],
        [[1], [3]],
        [1],
        None,
        1,
        "13",
        [1, 2**63],
        [1, {}],
    ):
        yield _payload(MEASUREMENT, f"neighbours {value}", lambda said, value=value: said | {"neighbours": value})


def catalogue() -> list[Hostile]:
    """All of them; the agent is number 2 of three that all see each other, in a plane."""
    broadcast, act = ("k", "src", "channel", "seq", "payload"), ("k", "src", "seq", "input", "estimate", "known")
    act += ("covariance", "psi", "feasible", "reports", "heard")
    return [
        *(one for on in (ACT, INPUT, MEASUREMENT) for one in _bytes(on)),
        *(one for on in (ACT, INPUT, MEASUREMENT) for one in _envelope(on, act if on == ACT else broadcast)),
        *_acts(),
        *(one for on in (INPUT, MEASUREMENT) for one in _broadcasts(on)),
        *_inputs(),
        *_measurements(),
    ]
