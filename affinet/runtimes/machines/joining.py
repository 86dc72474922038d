"""What the commands on machines and the coordinator say to each other, as MessagePack, checked when it is read.

A machine joins with what it flies with; then the coordinator has it start processes, and both relay: what is for a process
down, what it says up. Processes of a seat are numbered, as an agent that is killed and restarted has several.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import msgspec

from affinet.runtimes.machines.identity import Identity
from netem.wire.offset import ClockOffset
from netem.wire.wrong import WireError

T = TypeVar("T")

TABLE = ".arrows"  # how the names of tables end
GIVEN_BACK = b""  # in place of `Joining`: the machine leaves the seat to another, before the run begins


class _Message(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Named fields, each of its type."""


class Joining(_Message, frozen=True, kw_only=True):
    """A machine asks for a seat.

    `machine` is what it calls itself, `folder` a directory of its own for files of the processes, `keys` where its certificates
    lie; `scenario` the digest of the one it was given, `listens` where the medium is to listen, if it is that; `clock` how much
    the coordinator's clock shows more than its own.
    """

    seat: str
    machine: str
    folder: str
    keys: str
    identity: Identity
    scenario: str | None
    listens: str | None
    clock: ClockOffset


class Admitted(_Message, frozen=True, kw_only=True):
    """It may. After `gone_after_s` without a word from the coordinator it gives up; `kernels` are those that will be called."""

    gone_after_s: float
    kernels: dict[str, list[list[int]]]


class Start(_Message, frozen=True, tag="start"):
    """Start process `number`, called `name`, which begins with its role."""

    number: int
    name: str


class Say(_Message, frozen=True, tag="say"):
    """Write this to its standard input."""

    number: int
    data: bytes


class Shut(_Message, frozen=True, tag="shut"):
    """Close its standard input."""

    number: int


class Signal(_Message, frozen=True, tag="signal"):
    """Send it a signal."""

    number: int
    signal: int


class Leave(_Message, frozen=True, tag="leave"):
    """The run is over."""


class Started(_Message, frozen=True, tag="started"):
    """It runs."""

    number: int
    pid: int


class Told(_Message, frozen=True, tag="told"):
    """It wrote this to its standard output."""

    number: int
    data: bytes


class Logged(_Message, frozen=True, tag="logged"):
    """It wrote this to its standard error."""

    number: int
    data: bytes


class Ended(_Message, frozen=True, tag="ended"):
    """It has ended, with this exit status, or minus the signal."""

    number: int
    status: int


class Failed(_Message, frozen=True, tag="failed"):
    """The machine can start nothing any more: why."""

    why: str


class Alive(_Message, frozen=True, kw_only=True):
    """The seat lives, and its process `number`, 0 for none, is in this state; `pss_mb` is its memory when last measured."""

    number: int
    status: str
    used_s: float
    pss_mb: float


class Listing(_Message, frozen=True, kw_only=True, tag="listing"):
    """Asks for the files in the machine's folder whose names end so: their names, and how many bytes there are of each."""

    ending: str


class Part(_Message, frozen=True, kw_only=True, tag="part"):
    """Asks for a part of a file in the machine's folder."""

    name: str
    start: int


Down = Start | Say | Shut | Signal | Leave
Asked = Listing | Part
Up = Started | Told | Logged | Ended | Failed

_encoder = msgspec.msgpack.Encoder()


def pack(message: _Message | float | dict[str, int]) -> bytes:
    """A message as MessagePack."""
    return _encoder.encode(message)


def unpack(kind: Any, data: bytes) -> Any:
    """The message of this kind in `data`.

    Raises
    ------
    WireError
        When it is no such message.
    """
    try:
        return msgspec.msgpack.decode(data, type=kind)
    except (msgspec.DecodeError, RecursionError, UnicodeDecodeError) as error:
        raise WireError(f"between machines: {error}") from error


def plain_kernels(prepared: Mapping[str, Any]) -> dict[str, list[list[int]]]:
    """The kernels that were called here, without the files that they lie in here."""
    return {name: [list(sizes) for sizes, _ in of_one] for name, of_one in prepared.items()}
