"""What carries bytes between the processes of a floor: pipes, ZeroMQ, or Zenoh.

A place is where somebody hears: "sense" and "said" the hub, "journal" and "act" the world, "inbox/3" agent 3. Whoever says
something at "said" or "act" adds who it is, and on which channel: "said/3/theta".
"""

from __future__ import annotations

import json
import os
import struct
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

Say = Callable[[bytes], object]
Hear = Callable[[], bytes]
_LENGTH = struct.Struct("<I")
_CHUNK = 1 << 16


class Lines(Protocol):
    """What a process says and hears."""

    def says(self, place: str) -> Say:
        """A function that says bytes there."""

    def hears(self, place: str) -> Hear:
        """A function that waits for bytes there."""

    def await_everybody(self) -> None:
        """Wait until whoever is spoken to can hear."""

    def leave(self) -> None:
        """Say and hear nothing more."""


def _heard_at(place: str) -> str:
    first, _, rest = place.partition("/")
    return f"{first}-{rest}" if first == "inbox" else first


def places(agents: int) -> list[str]:
    """Where somebody hears."""
    return ["sense", "said", "journal", "act", *(f"inbox/{agent}" for agent in range(1, agents + 1))]


class Pipes:
    """Named pipes; what several write is below the 4,096 bytes that are written in one piece."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    @staticmethod
    def lay(folder: Path, agents: int) -> None:
        """Make the pipes before anybody starts."""
        for place in places(agents):
            os.mkfifo(folder / _heard_at(place))

    def says(self, place: str) -> Say:
        """A write with the length before it."""
        pipe = self._open(place)

        def say(data: bytes) -> None:
            left = memoryview(_LENGTH.pack(len(data)) + data)
            while left:
                left = left[os.write(pipe, left) :]

        return say

    def hears(self, place: str) -> Hear:
        """Reads of whatever is there."""
        pipe, arrived, data = self._open(place), deque[bytes](), bytearray()

        def hear() -> bytes:
            while not arrived:
                data.extend(os.read(pipe, _CHUNK))
                while len(data) >= _LENGTH.size:
                    end = _LENGTH.size + _LENGTH.unpack_from(data)[0]
                    if len(data) < end:
                        break
                    arrived.append(bytes(data[_LENGTH.size : end]))
                    del data[:end]
            return arrived.popleft()

        return hear

    def await_everybody(self) -> None:
        """A pipe keeps what nobody reads yet."""

    def leave(self) -> None:
        """Its end closes what it has opened."""

    def _open(self, place: str) -> int:
        return os.open(self._folder / _heard_at(place), os.O_RDWR)  # neither end waits for the other


class ZeroMQ:
    """Sockets that push and pull, over Unix sockets."""

    def __init__(self, folder: Path) -> None:
        import zmq

        self._folder, self._context, self._push, self._pull = folder, zmq.Context(), zmq.PUSH, zmq.PULL

    def says(self, place: str) -> Say:
        """A connected socket."""
        socket = self._context.socket(self._push)
        socket.connect(self._address(place))
        return socket.send

    def hears(self, place: str) -> Hear:
        """A bound socket."""
        socket = self._context.socket(self._pull)
        socket.bind(self._address(place))
        return socket.recv

    def await_everybody(self) -> None:
        """A socket keeps what nobody reads yet."""

    def leave(self) -> None:
        """Close all sockets."""
        self._context.destroy(linger=0)

    def _address(self, place: str) -> str:
        return f"ipc://{self._folder}/{_heard_at(place)}"


class Zenoh:
    """Keys, logins and access control of a run, and nothing else of affinet's."""

    def __init__(self, login: Sequence[str], agents: int, users: str, *, routes: bool) -> None:
        import zenoh

        from netem.wire.keys import Keys
        from netem.wire.rights import hub
        from netem.wire.session import Login, client

        self._keys, given = Keys("floor"), Login(*login)
        config = hub(given, users, self._keys, range(1, agents + 1), {}) if routes else client(given)
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(config)))
        self._fifo, self._publishers = zenoh.handlers.FifoChannel, list[Any]()

    def says(self, place: str) -> Say:
        """A publisher."""
        publisher = self._session.declare_publisher(self._key(place))
        self._publishers.append(publisher)
        return publisher.put

    def hears(self, place: str) -> Hear:
        """A subscriber with a queue."""
        wild = {"said": "said/*/*", "act": "act/*"}.get(place, place)
        subscriber = self._session.declare_subscriber(self._key(wild), self._fifo(4096))
        return lambda: subscriber.recv().payload.to_bytes()

    def await_everybody(self) -> None:
        """Until every publisher has a subscriber."""
        from netem.wire.carrier import Voice

        for publisher in self._publishers:
            Voice(publisher).await_heard()

    def leave(self) -> None:
        """Close the session."""
        self._session.close()  # type: ignore[no-untyped-call]

    def _key(self, place: str) -> str:
        match place.split("/"):
            case ["said", agent, channel]:
                return self._keys.broadcast(agent, channel)
            case ["act", agent]:
                return self._keys.act(agent)
            case ["inbox", agent]:
                return self._keys.inbox(int(agent))
            case [only]:
                return {"sense": self._keys.sense, "journal": self._keys.journal}[only]
        raise ValueError(f"nobody hears at {place!r}")
