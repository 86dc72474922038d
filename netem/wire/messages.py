"""Messages <-> MessagePack, validated: the only place that packs or unpacks what travels over Zenoh.

Every message is a map of plain numbers and nested lists with `k` (tick), `src` (who says it) and `seq` (its number on its
key, from 0). The maps are spelled out in docs/protocol.md; an agent needs nothing of ours to speak them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any, NamedTuple, TypeVar

import msgpack
import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core.plain import PlainError, from_plain, plainly
from netem.faults.control import Answer, Order
from netem.medium.verdict import Fates

T = TypeVar("T")
Rows = list[Any]  # a nested list that is passed on as it came


class WireError(ValueError):
    """A message that does not say what its key promises."""


class Phase(StrEnum):
    """Which part of a tick an inbox belongs to."""

    SENSE = "sense"
    EXCHANGE = "exchange"
    END = "end"


class Sense(NamedTuple):
    """World to medium: the raw sensing of tick k; `last` says that the run is over and nothing was sensed.

    `measured` is y of every directed link in the order of the links, shape (L, D), `position` the true positions, shape
    (N, D), both in metres; `motion` the true velocities and higher derivatives, shape (N, m - 1, D), where the bodies are
    integrators of an order m above 1; `sightings` what each agent's detector says of a target, as in `SenseInbox`, if there
    is one; `fired` are the numbers of the triggers that fire in this tick.
    """

    k: int
    src: str
    seq: int
    last: bool
    measured: Array | Rows
    position: Array | Rows
    motion: Array | Rows | None
    sightings: Rows | None
    fired: Rows


class SenseInbox(NamedTuple):
    """Medium to agent: the measurements of tick k that reached it.

    `clock` is what the agent's own clock says, in ticks; `neighbours` are the agents measured, shape (m,), `measured` their
    relative positions z_i - z_j, shape (m, D), in metres; `position` is the agent's own, shape (D,), and only leaders, who have
    positioning, get it; `motion` its own velocity and higher derivatives, shape (m - 1, D), in metres per second, per second
    squared ..., if it integrates its input m > 1 times to a position; `sighting` what its detector says of a target, if there
    is one: `position`, where it was when the detection began, in metres, if one is `done`, the number of the method it was
    found `by`, and of the `method` that the detector uses from now on.
    """

    k: int
    src: str
    seq: int
    phase: Phase
    clock: int
    neighbours: Rows
    measured: Rows
    position: Rows | None
    motion: Rows | None
    sighting: dict[str, Any] | None


class Broadcast(NamedTuple):
    """Agent to its neighbours, through the medium: named fields of numbers and nested lists."""

    k: int
    src: int
    channel: str
    seq: int
    payload: dict[str, Any]


class ExchangeInbox(NamedTuple):
    """Medium to agent: the broadcasts that arrive in the exchange of tick k, sorted by (k, src, channel).

    They are plain maps with the fields of `Broadcast`, which the medium has read and checked before it passes them on.
    """

    k: int
    src: str
    seq: int
    phase: Phase
    messages: Rows


class EndInbox(NamedTuple):
    """Medium to agent: the run is over."""

    k: int
    src: str
    seq: int
    phase: Phase


class Act(NamedTuple):
    """Agent to world: its control input, and what it believes.

    `input` is u_i, shape (D,), in metres per second, or per second squared of a double integrator; `estimate` the relative
    positions it acts on, one per neighbour, shape (m, D), in metres; `known` which of them it has an estimate of at all, shape
    (m,); `covariance` the upper triangles of their covariances, row by row, shape (m, D (D + 1) / 2), in square metres, 0 where
    not known; `psi` its convergence indicator, NaN where undefined; `feasible` whether the neighbours it sees determine a local
    map, if its estimator fits one; `reports` what else its estimator says, named numbers and nested lists of numbers; `heard`
    how many broadcasts it has received so far.
    """

    k: int
    src: int
    seq: int
    input: Array | Rows
    estimate: Array | Rows
    known: Mask | Rows
    covariance: Array | Rows
    psi: float
    feasible: bool | None
    reports: dict[str, Any]
    heard: int


class Told(NamedTuple):
    """Centre to agent: its edges as the centralized filter sees them.

    `relative` has a row for each slot, shape (n, D), in metres, 0 in padding, `covariance` theirs, shape (n, D, D), in square
    metres.
    """

    k: int
    src: str
    seq: int
    relative: Array | Rows
    covariance: Array | Rows


class Journal(NamedTuple):
    """Medium to world: the verdicts of tick k.

    `fates` has the verdict on what was offered on each channel and link, shape (C, L), numbers of `Fate`; `odd` the messages
    that passed late, twice or corrupted, rows of `air.out_of_the_ordinary`; `apart`, `late`, `dropped` and `released` say how
    messages under way arrived or were dropped, as in `air.Delivery`; `handed` how many broadcasts were put into each agent's
    inbox, shape (N,); `injected` all faults injected so far, in plain form, when one was injected or healed.
    """

    k: int
    src: str
    seq: int
    fates: Fates | Rows
    odd: Integers | Rows
    apart: Integers | Rows
    late: int
    dropped: Integers | Rows
    released: Integers | Rows
    handed: Rows
    injected: Rows | None


# One packer, used again and again: a new one takes and returns a quarter of a megabyte for every message.
_PACKER = msgpack.Packer(default=plainly)
_AS_IN_AN_INBOX = b"\x91\x91"  # a list in a list, as deep as the messages of an exchange

INBOXES: dict[str, type[SenseInbox | ExchangeInbox | EndInbox]] = {
    Phase.SENSE: SenseInbox,
    Phase.EXCHANGE: ExchangeInbox,
    Phase.END: EndInbox,
}


def pack(message: NamedTuple) -> bytes:
    """A message as MessagePack."""
    packed: bytes = _PACKER.pack(message._asdict())
    return packed


def unpack(kind: type[T], data: bytes) -> T:
    """The message of this kind in `data`.

    Raises
    ------
    WireError
        When it is no such message: which field, what was expected, what came.
    """
    return _read(kind, _load(data))


def unpack_relayed(data: bytes) -> Broadcast:
    """A broadcast that is passed on as it is: its receiver must be able to read it inside an inbox.

    Raises
    ------
    WireError
        When it is no broadcast, or nests too deep.
    """
    ((plain,),) = _load(_AS_IN_AN_INBOX + data)
    return _read(Broadcast, plain)


def numbers(given: Any, whose: str, shape: tuple[int | None, ...] | None, kinds: str = "iuf") -> Array:
    """What somebody said as an array.

    Parameters
    ----------
    given
        A number, or nested lists of them.
    whose
        Who said it, and where: how the error begins.
    shape
        What it has to be, any length where it begins with None; None for any shape.
    kinds
        Of NumPy's data types, those that will do.

    Raises
    ------
    WireError
        When it is something else.
    """
    if isinstance(given, list) and not given and shape and not shape[0]:
        return np.empty([length or 0 for length in shape])
    try:
        array = np.array(given)
    except (TypeError, ValueError, OverflowError, RecursionError):
        array = np.array(None)
    if not (shape is None or _fits(array.shape, shape)) or (array.dtype.kind not in kinds and array.size):
        what = "truths" if kinds == "b" else "numbers"
        of = "" if shape is None else f" of shape ({', '.join('any' if n is None else str(n) for n in shape)})"
        raise WireError(f"{whose}: expected {what}{of}, got {shown(given)} (see docs/protocol.md)")
    return array


def shown(given: Any) -> str:
    """Whatever it is, in a few words."""
    try:
        text = repr(given)
    except RecursionError:
        return f"a {type(given).__name__} that nests too deep"
    return text if len(text) < 80 else text[:77] + "..."


def unpack_inbox(data: bytes) -> SenseInbox | ExchangeInbox | EndInbox:
    """What the medium sent an agent, by its phase.

    Raises
    ------
    WireError
        When it is no inbox.
    """
    plain = _load(data)
    phase = plain.get("phase") if isinstance(plain, dict) else None
    if not isinstance(phase, str) or phase not in INBOXES:
        raise WireError(f"an inbox needs a phase among {list(INBOXES)}, got {phase!r} (see docs/protocol.md)")
    return _read(INBOXES[phase], plain)


def pack_exchange(k: int, seq: int, broadcasts: Sequence[bytes]) -> bytes:
    """An exchange inbox around broadcasts that are packed already: the medium relays what was said, byte for byte."""
    head: Mapping[str, Any] = {"k": k, "src": "netem", "seq": seq, "phase": Phase.EXCHANGE}
    return b"".join(
        [
            _PACKER.pack_map_header(len(head) + 1),
            *(_PACKER.pack(part) for item in head.items() for part in item),
            _PACKER.pack("messages"),
            _PACKER.pack_array_header(len(broadcasts)),
            *broadcasts,
        ]
    )


def pack_record(record: Order | Answer) -> bytes:
    """An order to the medium, or its answer, as MessagePack."""
    packed: bytes = _PACKER.pack(record)
    return packed


def _read(kind: type[T], plain: Any) -> T:
    try:
        return from_plain(kind, plain)
    except PlainError as error:
        raise WireError(f"{kind.__name__}: {error} (see docs/protocol.md)") from error
    except RecursionError as error:
        raise WireError(f"{kind.__name__}: it nests too deep (see docs/protocol.md)") from error


def _fits(shape: tuple[int, ...], wanted: tuple[int | None, ...]) -> bool:
    return shape == wanted or (wanted[:1] == (None,) and len(shape) == len(wanted) and shape[1:] == wanted[1:])


def _load(data: bytes) -> Any:
    try:
        return msgpack.unpackb(data)
    except (ValueError, msgpack.UnpackException) as error:
        raise WireError(f"not MessagePack: {error}") from error
