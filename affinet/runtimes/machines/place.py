"""A seat, as the machine has it that holds it: its session with the coordinator, and the process that runs there."""

from __future__ import annotations

import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import psutil

from affinet.runtimes.forked import ForkedProcess
from affinet.runtimes.machines import joining
from affinet.runtimes.machines.coordinator import KEPT
from affinet.runtimes.machines.joining import (
    Admitted,
    Alive,
    Asked,
    Down,
    Ended,
    Joining,
    Listing,
    Logged,
    Started,
    Told,
    Up,
)
from netem.core.refusal import Refusal
from netem.wire import offset, seats
from netem.wire.carrier import Ear, NotCarried, Question
from netem.wire.certificates import AGAIN
from netem.wire.offset import ClockOffset
from netem.wire.repeating import RepeatingSession
from netem.wire.sequence import UninstructedLoss
from netem.wire.session import Login, client
from netem.wire.wrong import WireError

_FOUND_WITHIN_S, _TRIED_S = 60.0, 3.0  # a coordinator, whoever is started first
_ANSWERED_WITHIN_S = 10.0
_ROOM = 4096
_PART = 1 << 18
_PSS_EVERY = 20  # beats: it costs milliseconds
Given = Callable[["Place", Down | Question | Exception], None]


class Refused(Refusal, RuntimeError):
    """The coordinator does not take this machine: why."""


class Place:
    """A seat on this machine; leaving the block leaves it.

    Parameters
    ----------
    login
        Where the coordinator listens, and as whom to join.
    given
        Takes what the coordinator says, in a thread of its own, or why nothing it says can be heard any more.
    """

    def __init__(self, login: Login, given: Given) -> None:
        self.name, self._given = login.name, given
        self._session = _found(login)
        self._up = self._session.says(seats.up(self.name))
        self._alive = self._session.says_once(seats.alive(self.name))
        self._down = self._session.hears(seats.down(self.name), _ROOM)
        self._beats = 0
        self._pss_mb = 0.0
        self.number = 0
        self.process: ForkedProcess | None = None
        self.pending = bytearray()  # for its standard input
        self.is_shut = False
        self.log_fd = -1
        self.open_fds: set[int] = set()  # of its output, which it may close before it ends
        self.beaten = threading.Event()
        self._listening: threading.Thread | None = None

    def __enter__(self) -> Place:
        return self

    def __exit__(self, *failure: Any) -> None:
        self._session.__exit__(*failure)
        if self._listening is not None:
            self._listening.join()

    def clock(self) -> ClockOffset:
        """How much the coordinator's clock shows more than ours.

        Raises
        ------
        Refused
            When nobody answers.
        """
        return offset.measured(lambda: float(joining.unpack(float, self._ask(seats.CLOCK, b""))))

    def join(self, asks: Joining) -> Admitted:
        """Ask for the seat.

        Raises
        ------
        Refused
            When this machine does not get it.
        """
        answer = self._ask(seats.join(self.name), joining.pack(asks))
        self._session.hands(seats.BEAT, lambda _: self.beaten.set())
        self._session.asks(seats.file(self.name), lambda question: self._given(self, question))
        self._listening = threading.Thread(target=self._listen, args=(self._down,), daemon=True)
        self._listening.start()
        self._session.is_here(seats.here(self.name))
        try:
            admitted: Admitted = joining.unpack(Admitted, answer)
        except WireError as error:
            raise Refused(f"another affinet coordinates: {error}; install the same on both") from error
        return admitted

    def give_back(self) -> None:
        """Leave the seat to another machine, before the run begins."""
        with suppress(Refused):  # the coordinator is gone, or finds out that we are
            self._ask(seats.join(self.name), joining.GIVEN_BACK)

    def tell(self, message: Up) -> None:
        """Tell the coordinator."""
        self._up.say(joining.pack(message))

    def started(self, number: int, process: ForkedProcess, log_fd: int) -> None:
        """A process runs here now."""
        self.number, self.process, self.log_fd = number, process, log_fd
        self.pending.clear()
        self.is_shut = False
        self._beats = 0
        self.open_fds = {process.stdout.fileno(), log_fd}
        for fd in (process.stdin.fileno(), process.stdout.fileno(), log_fd):
            os.set_blocking(fd, False)
        self.tell(Started(number, process.pid))

    def relay(self) -> None:
        """Pass on what the process can take, and what it has said."""
        if self.process is None:
            return
        self.write()
        for fd, kind in ((self.process.stdout.fileno(), Told), (self.log_fd, Logged)):
            with suppress(BlockingIOError):
                while data := os.read(fd, 1 << 16):
                    self.tell(kind(self.number, data))
                self.open_fds.discard(fd)

    def write(self) -> None:
        """Pass on what the process can take."""
        if self.process is None or self.process.stdin.closed:
            return
        try:
            while self.pending:
                del self.pending[: os.write(self.process.stdin.fileno(), self.pending)]
        except BlockingIOError:
            return
        except BrokenPipeError:  # it is gone, as will be told
            self.pending.clear()
        if self.is_shut:
            with suppress(BrokenPipeError):
                self.process.stdin.close()

    def ended(self) -> None:
        """The process has: tell all there is to tell of it."""
        process = self.process
        if process is None or process.returncode is None:
            return
        self.relay()
        self._forget(process)
        self.tell(Ended(self.number, process.returncode))

    def beat(self) -> None:
        """Say that we live, and what the process does."""
        status, used_s = psutil.STATUS_SLEEPING, 0.0
        if self.process is not None:
            with suppress(psutil.NoSuchProcess, psutil.AccessDenied):
                process = psutil.Process(self.process.pid)
                used = process.cpu_times()
                status, used_s = process.status(), used.user + used.system
                if self._beats % _PSS_EVERY == 1:
                    self._pss_mb = max(self._pss_mb, process.memory_full_info().pss / 2**20)
        self._beats += 1
        number = 0 if self.process is None else self.number
        self._alive.say(joining.pack(Alive(number=number, status=str(status), used_s=used_s, pss_mb=self._pss_mb)))

    def ask_to_leave(self) -> None:
        """Ask the process to leave, also if it is stopped."""
        if self.process is not None:
            self.process.terminate()
            self.process.send_signal(signal.SIGCONT)

    def _forget(self, process: ForkedProcess) -> None:
        for pipe in (process.stdin, process.stdout):
            with suppress(BrokenPipeError):
                pipe.close()
        os.close(self.log_fd)
        self.process = None

    def _ask(self, key: str, data: bytes) -> bytes:
        try:
            return self._session.ask(key, data, _ANSWERED_WITHIN_S)
        except NotCarried as error:
            raise Refused(f"{self.name.replace('-', ' ')}: {str(error).removeprefix('refused: ')}") from error

    def _listen(self, ear: Ear) -> None:
        try:
            while True:
                self._given(self, joining.unpack(Down, ear.next().data))
        except NotCarried:  # the session is left
            return
        except (UninstructedLoss, WireError) as error:
            self._given(self, error)


def of_folder(folder: Path, asked: Asked) -> bytes:
    """What is asked for of a folder: which files there are, or a part of one."""
    if isinstance(asked, Listing):
        found = sorted(file for file in folder.iterdir() if file.name.endswith(asked.ending))
        return joining.pack({file.name: file.stat().st_size for file in found})
    with (folder / Path(asked.name).name).open("rb") as file:
        file.seek(asked.start)
        return file.read(_PART)


def own_name() -> str:
    """What this machine calls itself."""
    return socket.gethostname()


def _found(login: Login) -> RepeatingSession:
    config = client(login, _TRIED_S)
    deadline_s = time.monotonic() + _FOUND_WITHIN_S
    while True:
        try:
            return RepeatingSession(config, _nothing, KEPT)
        except NotCarried as error:
            why = login.why_refused() or str(error)
            if AGAIN in why or time.monotonic() > deadline_s:
                raise Refused(why) from error


def _nothing(_key: str, _count: int) -> None:
    """The coordinator counts what is lost."""
