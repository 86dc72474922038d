"""The child's end of supervision: how a process of a run hears from the launcher, and tells it what happens.

Supervision does not travel the air it supervises. A child gets its brief on standard input, hears orders there, and
reports events on standard output, one JSON map a line. Standard input is also its lifeline: when it closes, the launcher is
gone and the child goes too, so nothing is ever orphaned, be it stopped or inside a call that lasts.

A child beats by itself: twice a second a thread of its own tells which tick it is in, and whom it waits for. It judges
nobody: that is for the launcher, who hears everybody (docs/decisions/0002).
"""

from __future__ import annotations

import json
import os
import queue
import signal
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, NamedTuple, NoReturn, TypeVar

import msgpack

from netem.core.plain import from_plain, to_plain
from netem.processes.parent import signal_at_its_end
from netem.processes.system_errors import said
from netem.processes.user_code import UserCodeError

T = TypeVar("T")

_LENGTH = struct.Struct("<I")
_STDIN, _STDOUT, _STDERR = 0, 1, 2
_LAST_RESORT_S = 2.0
_LAST_WORDS = {"done", "failed", "user-code"}

BEAT_S = 0.5
LOST = "lost"  # an order that tells of messages: their key, and how many
LAUNCHER = "launcher"  # as one who is waited for


def called(agent: int) -> str:
    """An agent's name among the processes of a run."""
    return f"agent {agent}"


class _Doing(NamedTuple):
    tick: int
    what: str
    whom: Callable[[], Iterable[str]]


def brief_bytes(brief: Any) -> bytes:
    """A brief as the launcher writes it to a child's standard input."""
    packed: bytes = msgpack.packb(to_plain(brief))
    return _LENGTH.pack(len(packed)) + packed


class Supervisor:
    """The launcher, as a child sees it."""

    def __init__(self) -> None:
        # What the child or a library prints belongs in its log, not among the events.
        self._events = os.dup(_STDOUT)
        os.dup2(_STDERR, _STDOUT)
        self._confessed = False
        self._speaking = threading.Lock()
        self._doing = _Doing(0, "", tuple)
        self._refused: Callable[[], Sequence[Any]] = tuple
        self._told_refused: Sequence[Any] = ()
        self._orders: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._lost: queue.SimpleQueue[tuple[str, int]] = queue.SimpleQueue()
        signal.signal(signal.SIGTERM, _leave)
        go_on_without_a_launcher()

    def brief(self, kind: type[T]) -> T:
        """The child's brief; from then on the lifeline is watched, and the child beats."""
        (length,) = _LENGTH.unpack(_read_exactly(_LENGTH.size))
        brief = from_plain(kind, msgpack.unpackb(_read_exactly(length), strict_map_key=False))
        for watch in (self._watch, self._beat):
            threading.Thread(target=watch, daemon=True).start()
        return brief

    def tell(self, event: str, **facts: Any) -> None:
        """Report an event to the launcher."""
        if event in _LAST_WORDS:
            self._tell_refused()
        line = json.dumps({"event": event} | facts).encode() + b"\n"
        with self._speaking:
            while line:
                line = line[os.write(self._events, line) :]

    def lost(self, key: str, count: int) -> None:
        """Report messages that the transport lost, and that were had again."""
        self.tell("lost", key=key, count=count)

    def lost_anywhere(self) -> dict[str, int]:
        """Messages that any process has reported so since this was asked last, by key, as the launcher tells the medium."""
        counts = Counter[str]()
        with suppress(queue.Empty):
            while True:
                key, count = self._lost.get_nowait()
                counts[key] += count
        return dict(counts)

    def counts(self, refused: Callable[[], Sequence[Any]]) -> None:
        """From now on tell with each beat what the child has refused so far; asked from another thread."""
        self._refused = refused

    def _tell_refused(self) -> None:
        refused = self._refused()
        if refused != self._told_refused:
            self._told_refused = refused
            self.tell("refused", of=refused)

    def works(self, tick: int) -> None:
        """From now on the child waits for nobody: what comes of this tick is up to it."""
        self._doing = _Doing(tick, "", tuple)

    def waits(self, tick: int, what: str, whom: Callable[[], Iterable[str]]) -> None:
        """From now on the child waits for others.

        Parameters
        ----------
        tick
            The tick it is in.
        what, whom
            What it waits for, and the names of those who still owe it; asked from another thread.
        """
        self._doing = _Doing(tick, what, whom)

    def await_order(self, order: str) -> None:
        """Wait until the launcher gives this order.

        Raises
        ------
        RuntimeError
            When it gives another.
        """
        before = self._doing
        self.waits(before.tick, f"the order to {order}", lambda: (LAUNCHER,))
        if (given := self._orders.get()) != order:
            raise RuntimeError(f"the launcher ordered {given!r} where {order!r} was due")
        self._doing = before

    @contextmanager
    def confessing(self) -> Iterator[None]:
        """Report why the block failed before the process goes down with it."""
        try:
            yield
        except Exception as error:
            if not self._confessed:
                self._confessed = True
                self.tell("user-code" if isinstance(error, UserCodeError) else "failed", reason=_reason(error))
            raise

    def _beat(self) -> None:
        while True:
            tick, what, whom = self._doing
            try:
                self.tell("beat", k=tick, what=what, waits=list(whom()))
                self._tell_refused()
            except OSError:  # the launcher is gone, and the lifeline says so
                return
            time.sleep(BEAT_S)

    def _watch(self) -> None:
        pending = b""
        while chunk := os.read(_STDIN, 4096):
            *lines, pending = (pending + chunk).split(b"\n")
            for line in lines:
                self._obey(line.decode())
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(_LAST_RESORT_S)
        # A library call, like one that waits for a router that is gone, keeps the main thread from hearing a signal.
        os.kill(os.getpid(), signal.SIGKILL)

    def _obey(self, line: str) -> None:
        word, *facts = line.split()
        if word == LOST:
            key, count = facts
            self._lost.put((key, int(count)))
        else:
            self._orders.put(line)


def go_on_without_a_launcher() -> None:
    """Have the system wake this process when the one that started it ends: stopped, it could not see its lifeline close."""
    signal_at_its_end(signal.SIGCONT)


def _leave(signum: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + signum)


def _reason(error: Exception) -> str:
    if isinstance(error, UserCodeError):
        return str(error)
    return said(error) if isinstance(error, OSError) else f"{type(error).__name__}: {error}"


def _read_exactly(size: int) -> bytes:
    read = b""
    while len(read) < size:
        if not (chunk := os.read(_STDIN, size - len(read))):
            raise SystemExit(
                "standard input closed before the brief was complete: this process is started by the launcher"
            )
        read += chunk
    return read
