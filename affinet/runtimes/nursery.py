"""The nursery (`python -m affinet.runtimes.nursery`): it imports once what processes of a run have in common, and forks them.

A fork of a process that runs threads, or has opened a session, hangs sooner or later. So nothing is imported here that starts
a thread (Rerun and Arrow do: the world and the medium import them for themselves), and no code of a user's own.

Kernels that planning has called are loaded before anything is forked.

Its standard input is a socket to the launcher, and its lifeline. A datagram that comes is the name of a process to fork,
with its standard input, output and error beside it; the answer is a process identifier with a pid file descriptor beside it,
or the error that kept it from forking. Later it tells with which exit status the process ended, since that is told to parents
alone (docs/decisions/0024).
"""

from __future__ import annotations

import ctypes
import errno
import gc
import json
import os
import select
import signal
import socket
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

import numpy as np

from affinet.runtimes.private import remove
from agents import estimators, laws
from agents import process as agent_process
from agents.centre import process as centre_process
from analysis.kernels import kernel as kernels
from netem import process as medium_process
from netem.processes.supervised import go_on_without_a_launcher
from world import process as world_process

_STDIN, _STDOUT, _STDERR = 0, 1, 2
_PR_SET_NAME = 15
_LONGEST_NAME = 64

ROLES: Mapping[str, Callable[[], None]] = {
    "world": world_process.main,
    "netem": medium_process.main,
    "centre": centre_process.main,
    "agent": agent_process.main,
    "host": agent_process.host,
}


class ThreadsRun(RuntimeError):
    """Something that was imported has started a thread, so nothing can be forked."""


def refuse_threads() -> None:
    """Go on if this process runs one thread, this one.

    Raises
    ------
    ThreadsRun
        If it runs more.
    """
    if (threads := len(os.listdir("/proc/self/task"))) > 1:
        raise ThreadsRun(
            f"{threads} threads run once all is imported, and a fork of them may hang: who starts one is imported later"
        )


class Forks:
    """The processes that were forked and have not ended, and the launcher that asks for more."""

    def __init__(self, launcher: socket.socket) -> None:
        self._launcher = launcher
        self._living: dict[int, int] = {}  # by the descriptor that says when it has ended
        self._poll = select.poll()  # has no descriptor of its own that a fork would have to close
        self._poll.register(launcher, select.POLLIN)

    def next(self) -> Callable[[], None] | None:
        """What this process is to run, in a forked one; None in the nursery, once the launcher is gone."""
        while True:
            for descriptor, _ in self._poll.poll():
                if descriptor in self._living:
                    self._tell_of_the_end(descriptor)
                    continue
                name, given, _, _ = socket.recv_fds(self._launcher, _LONGEST_NAME, 3, socket.MSG_CMSG_CLOEXEC)
                if not name:
                    return None
                if self._is_forked(name.decode(), given):
                    return ROLES[name.decode().partition(" ")[0]]

    def _is_forked(self, name: str, given: Sequence[int]) -> bool:
        try:
            pid = _fork(given)
        except OSError as error:
            self._launcher.send(json.dumps({"refused": error.errno}).encode())
        else:
            if pid == 0:
                self._launcher.detach()
                _begin(name, given)
                return True
            ends = os.pidfd_open(pid)
            self._living[ends] = pid
            self._poll.register(ends, select.POLLIN)
            socket.send_fds(self._launcher, [json.dumps({"forked": pid}).encode()], [ends])
        for descriptor in given:
            os.close(descriptor)
        return False

    def _tell_of_the_end(self, descriptor: int) -> None:
        self._poll.unregister(descriptor)
        os.close(descriptor)
        pid, status = os.waitpid(self._living.pop(descriptor), 0)
        self._launcher.send(json.dumps({"ended": pid, "status": os.waitstatus_to_exitcode(status)}).encode())


def _fork(given: Sequence[int]) -> int:
    if len(given) < 3:  # what is over the limit does not come
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    return os.fork()


def _begin(name: str, given: Sequence[int]) -> None:
    """Be a process like a fresh one, which shares with others no more than the memory it does not write to."""
    for standard, descriptor in zip((_STDIN, _STDOUT, _STDERR), given, strict=True):
        os.dup2(descriptor, standard)
    for descriptor in map(int, os.listdir("/proc/self/fd")):
        if descriptor > _STDERR:
            with suppress(OSError):  # by which they were listed
                os.close(descriptor)
    os.setsid()  # Ctrl-C is for the launcher, which ends its children in order
    _be_called(name)
    np.random.seed()  # noqa: NPY002 - a user's own code may draw by it, and all would draw the same; `random` sees to itself


def _be_called(name: str) -> None:
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())  # as `ps` and `top` show it


def _take_turns() -> None:
    """Have no process of the run interrupt another: whom a message wakes would, and its sender has more of them to send."""
    if os.sched_getscheduler(0) == os.SCHED_OTHER:  # whoever has chosen another has reasons
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def main() -> None:
    """Import, then fork whenever the launcher asks, and be what was forked."""
    for package in (estimators, laws):
        for module in iter_modules(package.__path__, f"{package.__name__}."):
            import_module(module.name)
    kernels.prepare(json.loads(sys.argv[-1]))  # once for all: a fork shares them
    _be_called("nursery")
    _take_turns()
    signal.signal(signal.SIGCHLD, signal.SIG_DFL)  # ignored, as it may come to us, it has nobody's exit status told
    go_on_without_a_launcher()
    try:
        refuse_threads()
    except ThreadsRun as error:
        _tell("failed", reason=str(error))
        sys.exit(1)
    gc.freeze()  # a collection would write to all that is shared, and so have it copied
    _tell("ready")
    run = None
    with suppress(BrokenPipeError, ConnectionResetError):  # the launcher is gone
        run = Forks(socket.socket(fileno=_STDIN)).next()
    if run is None:
        remove(Path(sys.argv[-2]))  # the launcher may have been killed, and could not
    else:
        run()


def _tell(event: str, **facts: str) -> None:
    os.write(_STDOUT, json.dumps({"event": event} | facts).encode() + b"\n")


if __name__ == "__main__":
    main()
