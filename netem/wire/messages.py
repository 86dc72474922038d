"""Messages <-> MessagePack, validated: the only place that packs or unpacks what travels over Zenoh.

Every message is a map with `k` (tick), `src` (who says it) and `seq` (its number on its key, from 0). Arrays in it are bytes,
by `netem.wire.arrays`: what a message is made of is checked here, in C, and what its arrays hold by whoever reads them, who
knows their shapes. The maps are spelled out in docs/protocol.md; an agent needs nothing of ours to speak them.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Annotated, Any, TypeVar

import msgspec

from netem.core.plain import located, plainly
from netem.faults.control import Answer, Order
from netem.wire.arrays import Packed
from netem.wire.wrong import WireError, Wrong

T = TypeVar("T")

_Whole = Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]  # that is to stand in an array


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Named fields, each of its type: what is anything else is no message. Defaults are left out."""


class Sighted(_Message, frozen=True, kw_only=True):
    """What a detector says of a target: where it was when the detection began, shape (D,), in metres, if one is `done`.

    `by` is the number of the method it was found by, `method` that of the method used from now on.
    """

    position: bytes
    done: bool
    by: _Whole
    method: _Whole


class Sense(_Message, frozen=True, kw_only=True):
    """World to medium: the raw sensing of tick k; `last` says that the run is over and nothing was sensed.

    `measured` is y of every directed link in the order of the links, shape (L, D), `position` the true positions, shape
    (N, D), both in metres; `motion` the true velocities and higher derivatives, shape (N, m - 1, D), where the bodies are
    integrators of an order m above 1; `sightings` what each agent's detector says of a target, as in `SenseInbox`, if there
    is one; `fired` are the numbers of the triggers that fire in this tick. Where physics is not simulated `measured` has NaN in
    gaps, `position` where it is not known, and of a recorded flight `flown` is what everybody flies when the tick begins, shape
    (N, D), in metres per second. In real time `began` is when the run did, in seconds of the monotonic clock.
    """

    k: int
    src: str
    seq: int
    last: bool
    measured: bytes
    position: bytes
    motion: bytes | None
    sightings: list[Sighted] | None
    fired: list[int]
    flown: bytes | None = None
    began: float | None = None


class Roster(_Message, frozen=True, kw_only=True):
    """Medium to host: who of its agents gets an inbox in tick k, who of them was restarted, and who of those remembers."""

    k: int
    src: str
    seq: int
    awake: list[int]
    restarted: list[int]
    remembering: list[int]


class SenseInbox(_Message, frozen=True, kw_only=True, tag_field="phase", tag="sense"):
    """Medium to agent: the measurements of tick k that reached it.

    `clock` is what the agent's own clock says, in ticks; `neighbours` are the agents measured, shape (m,), `measured` their
    relative positions z_i - z_j, shape (m, D), in metres; `position` is the agent's own, shape (D,), and only leaders, who have
    positioning, get it; `motion` its own velocity and higher derivatives, shape (m - 1, D), in metres per second, per second
    squared ..., if it integrates its input m > 1 times to a position; `sighting` what its detector says of a target, if there
    is one; `flown` the input it flies just now, shape (D,), in metres per second, where that is not what it commanded, as in a
    recorded flight. In real time `began` is when the run did, in seconds of the monotonic clock, and `gains` by how much the
    agent's clock gains just now, in seconds per second, beside what its timer says.
    """

    k: int
    src: str
    seq: int
    clock: _Whole
    neighbours: list[int]
    measured: bytes
    position: bytes | None
    motion: bytes | None
    sighting: Sighted | None
    flown: bytes | None = None
    began: float | None = None
    gains: float = 0.0


class Broadcast(_Message, frozen=True, kw_only=True):
    """Agent to its neighbours, through the medium: named fields of numbers and nested lists.

    In real time `at` is when it is said, in simulated seconds since the run began, by the monotonic clock.
    """

    k: int
    src: int
    channel: str
    seq: int
    payload: dict[str, Any]
    at: float | None = None


class ExchangeInbox(_Message, frozen=True, kw_only=True, tag_field="phase", tag="exchange"):
    """Medium to agent: the broadcasts that arrive in the exchange of tick k, sorted by (k, src, channel)."""

    k: int
    src: str
    seq: int
    messages: list[Broadcast]


class EndInbox(_Message, frozen=True, kw_only=True, tag_field="phase", tag="end"):
    """Medium to agent: the run is over."""

    k: int
    src: str
    seq: int


class Punctuality(_Message, frozen=True, kw_only=True):
    """How a process keeps its time, in a run in real time.

    `late` are seconds by which what it does in a tick began later than it should have, the worst of them; `missed` how many
    deadlines it has missed since it said so last.
    """

    late: float
    missed: int


class Act(_Message, frozen=True, kw_only=True):
    """Agent to world: its control input, and what it believes.

    `input` is u_i, shape (D,), in metres per second, or per second squared of a double integrator; `estimate` the relative
    positions it acts on, one per neighbour, shape (m, D), in metres; `known` which of them it has an estimate of at all, shape
    (m,); `covariance` the upper triangles of their covariances, row by row, shape (m, D (D + 1) / 2), in square metres, 0 where
    not known; `psi` its convergence indicator, NaN where undefined; `feasible` whether the neighbours it sees determine a local
    map, if its estimator fits one; `reports` what else its estimator says, named numbers and nested lists of numbers; `heard`
    how many broadcasts it has received so far. In real time it tells its `punctuality`.
    """

    k: int
    src: int
    seq: int
    input: Packed
    estimate: Packed
    known: Packed
    covariance: Packed
    psi: float
    feasible: bool | None
    reports: dict[str, Any]
    heard: int
    punctuality: Punctuality | None = None


class Measured(_Message, frozen=True, kw_only=True):
    """Driver to world: what is measured on the robot of an agent, where robots fly outside.

    `k` is the tick after that of the last command, 0 before the first; `neighbours` are the agents measured, shape (m,), and
    `measured` says where they are from the robot, z_j - z_i as its sensor has it, shape (m, D), in metres; `position` is its
    place, shape (D,), in metres, where that is known: leaders have positioning, of others estimates are held against it.
    """

    k: int
    src: str
    seq: int
    agent: int
    neighbours: list[int]
    measured: bytes
    position: bytes | None


class Command(_Message, frozen=True, kw_only=True):
    """World to driver: the input that the robot of an agent is to fly from now on, shape (D,), in metres per second.

    With `last` the run is over, and it is to stand still.
    """

    k: int
    src: str
    seq: int
    agent: int
    input: bytes
    last: bool


class Told(_Message, frozen=True, kw_only=True):
    """Centre to agent: its edges as the centralized filter sees them.

    `relative` has a row for each slot, shape (n, D), in metres, 0 in padding, `covariance` theirs, shape (n, D, D), in square
    metres; `nis` its innovations squared, normalised, shape (n,), NaN where it has none.
    """

    k: int
    src: str
    seq: int
    relative: bytes
    covariance: bytes
    nis: bytes


class Journal(_Message, frozen=True, kw_only=True):
    """Medium to world: the verdicts of tick k.

    `verdicts` has the verdict on what was offered on each channel and link, shape (C, L), numbers of `Verdict`; `odd` the
    messages that passed late, twice or corrupted, rows of `entry.out_of_the_ordinary`; `apart`, `late`, `dropped` and
    `released` say how messages under way arrived or were dropped, as in `in_flight.Delivery`; `handed` how many broadcasts
    were put into each agent's inbox, shape (N,); `injected` all faults injected so far, in plain form, when one was injected
    or healed. In real time it tells its `punctuality`.
    """

    k: int
    src: str
    seq: int
    verdicts: bytes
    odd: bytes
    apart: bytes
    late: int
    dropped: bytes
    released: bytes
    handed: list[int]
    injected: list[Any] | None
    punctuality: Punctuality | None = None


class _Relayed(msgspec.Struct, frozen=True, kw_only=True, tag_field="phase", tag="exchange"):
    """An `ExchangeInbox` around broadcasts that are packed already."""

    k: int
    src: str
    seq: int
    messages: list[msgspec.Raw]


Inbox = SenseInbox | ExchangeInbox | EndInbox

_ENCODER = msgspec.msgpack.Encoder(enc_hook=plainly)
_AS_IN_AN_INBOX = b"\x91\x91"  # a list in a list, as deep as the messages of an exchange


def pack(message: _Message | Order | Answer) -> bytes:
    """A message, an order to the medium or its answer as MessagePack."""
    return _ENCODER.encode(message)


def unpack(kind: type[T], data: bytes) -> T:
    """The message of this kind in `data`.

    Raises
    ------
    WireError
        When it is no such message: which field, what was expected, what came.
    """
    read: T = _read(kind, kind.__name__, data)
    return read


def unpack_relayed(data: bytes) -> Broadcast:
    """A broadcast that is passed on as it is: its receiver must be able to read it inside an inbox.

    Raises
    ------
    WireError
        When it is no broadcast, or nests too deep.
    """
    broadcasts: list[list[Broadcast]] = _read(list[list[Broadcast]], "Broadcast", _AS_IN_AN_INBOX + data, "$[0][0]")
    return broadcasts[0][0]


def unpack_inbox(data: bytes) -> Inbox:
    """What the medium sent an agent, by its phase.

    Raises
    ------
    WireError
        When it is no inbox.
    """
    read: Inbox = _read(Inbox, "an inbox", data)
    return read


def pack_exchange(k: int, seq: int, broadcasts: Sequence[bytes]) -> bytes:
    """An exchange inbox around broadcasts that are packed already: the medium relays what was said, byte for byte."""
    return _ENCODER.encode(_Relayed(k=k, src="netem", seq=seq, messages=[msgspec.Raw(said) for said in broadcasts]))


@cache
def _decoder(kind: Any) -> Any:
    return msgspec.msgpack.Decoder(kind)


def _read(kind: Any, name: str, data: bytes, root: str = "$") -> Any:
    try:
        return _decoder(kind).decode(data)
    except msgspec.ValidationError as error:
        raise WireError(f"{name}: {located(error, root)} (see docs/protocol.md)") from error
    except RecursionError as error:
        raise WireError(f"{name}: it nests too deep (see docs/protocol.md)", Wrong.DEEP) from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise WireError(f"{name}: not MessagePack: {error} (see docs/protocol.md)") from error
