"""The launcher's end of the nursery, and of the processes that it forks.

They are the nursery's children and not the launcher's, which signals them, and sees that they have ended, by pid file
descriptors; their exit status it hears of the nursery.
"""

from __future__ import annotations

import errno
import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import IO

from affinet.runtimes import nursery
from affinet.runtimes.child import Child, Process, RunFailed
from affinet.runtimes.programs import Program
from affinet.runtimes.silence import StatusHistory
from analysis.kernels import kernel as kernels

NURSERY = "nursery"
# What can be imported here can be there: PYTHONPATH cannot say so of a folder with a colon in its name.
_RUN = """import json, runpy, sys
path, _, package, *_ = sys.argv[1:]
sys.path[:] = json.loads(path)
runpy.run_module(package, run_name="__main__", alter_sys=True)"""
_LONGEST_ANSWER = 256


class Nursery:
    """The nursery, as the launcher has it."""

    def __init__(self, child: Child, connection: socket.socket, patience_s: float) -> None:
        """It has been started.

        Parameters
        ----------
        child
            The process.
        connection
            A socket whose other end is its standard input.
        patience_s
            How long it may do nothing before it answers, in seconds.
        """
        self.child = child
        self._connection = connection
        self._patience_s = patience_s
        self._living: dict[int, ForkedProcess] = {}

    @classmethod
    def started(cls, log: IO[bytes], patience_s: float, private: Path, prepared: str | None = None) -> Nursery:
        """A nursery that has been started, and says when it is ready; at its end it removes a folder.

        Parameters
        ----------
        log, patience_s
            Where its standard error goes; how long it may do nothing before it answers, in seconds.
        private
            The folder.
        prepared
            The kernels that it is to load, as JSON; by default those that were called in this process.

        Raises
        ------
        RunFailed
            When there is no such thing on this system.
        """
        if sys.platform != "linux":
            raise RunFailed("processes are forked and watched as Linux has it: fly in one process (runtime inprocess)")
        with ExitStack() as unless_started:
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            unless_started.enter_context(ours)
            with theirs:
                process = Program(program(private, prepared), theirs.fileno(), log)
            unless_started.pop_all()
        return cls(Child(NURSERY, None, process, Path(log.name), trusted=True), ours, patience_s)

    def fork(self, name: str, log: IO[bytes]) -> ForkedProcess:
        """A new process: what to call it, which begins with its role, and where its standard error goes.

        Raises
        ------
        RunFailed
            When the nursery is gone, or does not answer.
        OSError
            When the system has no more processes, or files.
        """
        with ExitStack() as unless_forked:
            stdin, orders = (unless_forked.enter_context(end) for end in _pipe())
            events, stdout = (unless_forked.enter_context(end) for end in _pipe())
            given = [stdin.fileno(), stdout.fileno(), log.fileno()]
            with suppress(BrokenPipeError, ConnectionResetError):  # it is gone, as its answer will say
                socket.send_fds(self._connection, [name.encode()], given)
            forked = None
            while forked is None:
                forked = self.hear()
            unless_forked.pop_all()
        stdin.close()
        stdout.close()
        process = self._living[forked[0]] = ForkedProcess(self, *forked, orders, events)
        return process

    def fileno(self) -> int:
        """Readable when it has something to tell: `hear` takes it in."""
        return self._connection.fileno()

    def leave(self, grace_s: float) -> None:
        """Let it go, within so many seconds: nobody is forked any more, and of nobody it is asked how he ended."""
        self._connection.close()
        if not self.child.is_ready:  # it imports, and does not look
            self.child.process.terminate()
        end_by(time.monotonic() + grace_s, self.child.process)
        self.child.free()
        for process in self._living.values():
            process.let_go()

    def hear(self) -> tuple[int, int] | None:
        """Take in the next thing it tells, of a new process or of the end of one.

        Returns
        -------
        tuple or None
            Of a new one, its pid and its descriptor.

        Raises
        ------
        RunFailed
            When the nursery is gone, or does not answer.
        OSError
            When the system would not fork.
        """
        self.child.looks = None
        while not _is_readable(self._connection.fileno(), self._patience_s):
            self.child.look()
            looks: StatusHistory | None = self.child.looks
            if looks and looks.stalled(self._patience_s, trusted=True):
                raise RunFailed(f"{self.child.who} {looks.now}, and had not answered after {self._patience_s:.1f} s")
        try:
            answer, given, _, _ = socket.recv_fds(self._connection, _LONGEST_ANSWER, 1, socket.MSG_CMSG_CLOEXEC)
        except ConnectionResetError:
            answer = b""
        match json.loads(answer or "null"):
            case {"forked": pid}:
                if not given:  # what is over the limit does not come
                    raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
                return pid, given[0]
            case {"refused": error}:
                raise OSError(error, os.strerror(error))
            case {"ended": pid, "status": status}:
                if process := self._living.pop(pid, None):
                    process.ended(status)
                return None
        raise RunFailed(self.child.obituary())


class ForkedProcess:
    """What `subprocess.Popen` is for a child of one's own, of a process that the nursery forked.

    Attributes
    ----------
    pid, stdin, stdout
        The process, and the ends of its pipes.
    returncode
        Its exit status, or minus the signal that ended it; None as long as it has not been told.
    """

    def __init__(self, nursery: Nursery, pid: int, descriptor: int, stdin: IO[bytes], stdout: IO[bytes]) -> None:
        self._nursery = nursery
        self._descriptor = descriptor
        self.pid, self.stdin, self.stdout = pid, stdin, stdout
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Its exit status; None as long as it runs.

        Raises
        ------
        RunFailed
            When it has ended, and the nursery is gone or does not answer.
        """
        with suppress(subprocess.TimeoutExpired):
            return self.wait(0.0)
        return None

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended.

        Raises
        ------
        TimeoutExpired
            When it has not after so many seconds.
        RunFailed
            When it has, and the nursery is gone or does not answer.
        """
        if self.returncode is None and not _is_readable(self._descriptor, timeout):
            raise subprocess.TimeoutExpired(str(self.pid), timeout or 0.0)
        while self.returncode is None:
            self._nursery.hear()
        return self.returncode

    def send_signal(self, number: int) -> None:
        """Send it a signal, unless it has ended."""
        if self.returncode is None:
            with suppress(ProcessLookupError):
                signal.pidfd_send_signal(self._descriptor, number)

    def terminate(self) -> None:
        """Ask it to leave."""
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)

    def ended(self, status: int) -> None:
        """It has, as the nursery says."""
        self.returncode = status
        self.let_go()

    def let_go(self) -> None:
        """Give back the descriptor: there is nothing more to do with the process."""
        os.close(self._descriptor)


def program(private: Path, prepared: str | None = None) -> list[str]:
    """The command line of the nursery: the search path of this process, a private folder, kernels that planning has called."""
    path = [os.path.abspath(entry) for entry in sys.path if entry]
    told = [str(private), json.dumps(kernels.prepared()) if prepared is None else prepared]
    return [sys.executable, "-P", "-c", _RUN, json.dumps(path), "-m", nursery.__name__, *told]


def end_by(deadline: float, process: Process) -> None:
    """Wait for its end until this moment of the monotonic clock, and end it then.

    Raises
    ------
    RunFailed
        When it has ended, and the nursery, by which it was forked, is gone or does not answer.
    """
    try:
        process.wait(max(0.0, deadline - time.monotonic()))
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _pipe() -> tuple[IO[bytes], IO[bytes]]:
    reads, writes = os.pipe()
    return open(reads, "rb"), open(writes, "wb")


def _is_readable(descriptor: int, timeout_s: float | None) -> bool:
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    if poll.poll(None if timeout_s is None else 1000.0 * timeout_s):
        return True
    return bool(poll.poll(0))  # we may have been stopped past the timeout, and it has been readable all along
