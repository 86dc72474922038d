"""Waiting for an agent under test: what happens meanwhile is taken down, and whoever works is not called silent."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from typing import Any

from affinet.conformance.program import Program, Told
from affinet.conformance.record import Life, Record, Said
from affinet.conformance.star import Published
from affinet.runtimes.child import Child, RunFailed
from affinet.runtimes.told import NotItsOwn, printable, read
from netem.processes.supervised import BEAT_S

_MOST = 100_000  # messages and lines of one flight: a flood would never end
_DRAINING_S = 0.1  # in which what a process has said before its end arrives


class Attention:
    """What happens around one agent, and how long to wait for it.

    Parameters
    ----------
    record
        What is filled.
    happened
        Where the network and the processes put what comes of it.
    """

    def __init__(self, record: Record, happened: SimpleQueue[Any]) -> None:
        self._record, self.happened = record, happened
        self._taken = 0

    def waits(self, program: Program, done: Callable[[], bool], allowance_s: float) -> bool:
        """Wait until something is the case; whether it came to that before the program ended, or did nothing for too long.

        Parameters
        ----------
        program
            Who is to bring it about.
        done
            What is waited for.
        allowance_s
            How long it may do nothing, and how much processor time it may take.
        """
        child, since_s = program.child, time.monotonic()
        child.looks = None
        while not done() and self._taken < _MOST:
            if self._take(BEAT_S / 2):
                continue
            waited_s = time.monotonic() - since_s
            if child.process.poll() is not None:
                self._drain()
                break
            if waited_s >= allowance_s / 2 and _does_nothing(child, allowance_s) and waited_s >= allowance_s:
                break
        return done()

    def leaves(self, program: Program, allowance_s: float) -> bool:
        """Wait until it has left; whether it has."""
        self.waits(program, lambda: program.child.process.poll() is not None, allowance_s)
        self._drain()
        return program.child.process.poll() is not None

    def _drain(self) -> None:
        while self._take(_DRAINING_S):
            pass

    def _take(self, patience_s: float) -> bool:
        try:
            happened = self.happened.get(timeout=patience_s)
        except Empty:
            return False
        self._taken += 1
        match happened:
            case Published(stream, data):
                self._record.said.append(Said(len(self._record.lives) - 1, len(self._record.asked), stream, data))
            case Told(life, line):
                self._note(self._record.lives[life], line)
        return True

    @staticmethod
    def _note(life: Life, line: bytes) -> None:
        try:
            event = read("agent", line)
        except NotItsOwn as error:
            life.wrong.append(str(error))
            return
        match event["event"]:
            case "ready" if life.ready:
                life.wrong.append("it said twice that it is ready")
            case "done" if life.done or not life.ready:
                life.wrong.append("it said that it is done, and was not flying")
            case "ready":
                life.ready = True
            case "done":
                life.done = True
            case "failed" | "user-code":
                life.failed = printable(event["reason"])


def _does_nothing(child: Child, allowance_s: float) -> bool:
    with suppress(RunFailed):  # it has just ended
        child.look()
    return child.looks is not None and child.looks.stalled(allowance_s, trusted=False)
