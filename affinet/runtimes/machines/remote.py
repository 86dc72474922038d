"""A process on another machine, as the launcher has it: like a child of its own."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from typing import IO, cast

from affinet.runtimes.machines.joining import (
    Alive,
    Down,
    Ended,
    Failed,
    Logged,
    Say,
    Shut,
    Signal,
    Started,
    Told,
    Up,
)
from affinet.runtimes.silence import ProcessStatus

_LOOKS_S = 0.1


class RemoteProcess:
    """What `subprocess.Popen` is for a child of one's own, of a process on another machine.

    Attributes
    ----------
    pid, stdin, stdout
        Its number over there, once it was told, and the ends of its pipes.
    returncode
        Its exit status, or minus the signal that ended it; None as long as it has not been told.
    """

    def __init__(
        self, number: int, where: str, say: Callable[[Down], None], heed: Callable[[], bool], log: IO[bytes]
    ) -> None:
        """It is about to be started.

        Parameters
        ----------
        number, where
            Which of the seat's processes it is, and on which machine.
        say
            Tells that machine.
        heed
            Looks whether the machine is still there, and raises if it is not; whether nothing is awaited of it any more.
        log
            Where its standard error goes.
        """
        self.where = where
        self.pid = 0
        self.returncode: int | None = None
        reads, self._writes = os.pipe()
        os.set_blocking(self._writes, False)
        self.stdout: IO[bytes] = os.fdopen(reads, "rb")
        self.stdin: IO[bytes] = cast("IO[bytes]", _Orders(number, say))
        self._number, self._say, self._heed = number, say, heed
        self._log = os.dup(log.fileno())
        self._ended = threading.Event()
        self._is_let_go = False
        self._alive = Alive(number=number, status="sleeping", used_s=0.0, pss_mb=0.0)

    @property
    def pss_mb(self) -> float:
        """Its memory when it was last measured."""
        return self._alive.pss_mb

    def look(self) -> ProcessStatus:
        """What its machine said of it last."""
        return ProcessStatus(self._alive.status, self._alive.used_s)

    def poll(self) -> int | None:
        """Its exit status; None as long as it runs."""
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended.

        Raises
        ------
        TimeoutExpired
            When it has not after so many seconds.
        RunFailed
            When its machine is gone.
        """
        began_s = time.monotonic()
        while self.returncode is None:
            waited_s = time.monotonic() - began_s
            if timeout is not None and waited_s >= timeout:
                raise subprocess.TimeoutExpired(self.where, timeout)
            if self._heed():
                return -signal.SIGKILL  # it will be ended there: its machine finds the coordinator gone
            self._ended.wait(_LOOKS_S)
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.returncode is None:
            self._say(Signal(self._number, number))

    def terminate(self) -> None:
        """Ask it to leave."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it; what it still says is nobody's concern."""
        self._is_let_go = True
        self.send_signal(signal.SIGKILL)

    def lives(self, alive: Alive) -> None:
        """Its machine says so."""
        self._alive = alive

    def take(self, message: Up) -> None:
        """What its machine tells of it, in a thread that is not the launcher's; once it has ended, nothing."""
        if self.returncode is not None:
            return
        match message:
            case Started(pid=pid):
                self.pid = pid
            case Told(data=data):
                self._pass_on(data)
            case Logged(data=data):
                os.write(self._log, data)
            case Ended(status=status):
                self._end(status)
            case Failed():
                self._end(1)

    def let_go(self) -> None:
        """Nothing more comes of it."""
        self._is_let_go = True
        if self.returncode is None:
            self._end(-signal.SIGKILL)

    def _end(self, status: int) -> None:
        os.close(self._writes)
        os.close(self._log)
        self.returncode = status
        self._ended.set()

    def _pass_on(self, data: bytes) -> None:
        # The launcher may wait for this process meanwhile, and not read.
        writable = select.poll()
        writable.register(self._writes, select.POLLOUT)
        while data and not self._is_let_go:
            if writable.poll(1000 * _LOOKS_S):
                try:
                    data = data[os.write(self._writes, data) :]
                except BrokenPipeError:  # the launcher has forgotten it
                    return


class _Orders:
    """The standard input of a process on another machine."""

    def __init__(self, number: int, say: Callable[[Down], None]) -> None:
        self._number, self._say = number, say
        self.closed = False

    def write(self, data: bytes) -> None:
        """Send it there."""
        if self.closed:
            raise ValueError("it is closed")
        self._say(Say(self._number, data))

    def flush(self) -> None:
        """It is on its way."""

    def close(self) -> None:
        """Have it closed there."""
        if not self.closed:
            self.closed = True
            self._say(Shut(self._number))
