"""The program under test as a process: what it writes to standard output, line by line, and how it ends."""

from __future__ import annotations

import subprocess
import threading
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any, NamedTuple

from affinet.runtimes.child import Child
from affinet.runtimes.programs import ForeignProgram
from affinet.runtimes.told import LONGEST_LINE
from netem.processes.supervised import brief_bytes


class Told(NamedTuple):
    """A line on the standard output of one of its processes, by number from 0."""

    life: int
    line: bytes


GONE = object()  # a process has ended


class Program:
    """One process of the agent under test.

    Parameters
    ----------
    command
        Its command line.
    agent, life
        Which agent it is, and which process of that agent.
    log
        The file for its standard error.
    happened
        Where what it tells is put.

    Raises
    ------
    OSError
        When it cannot be started.
    """

    def __init__(self, command: list[str], agent: int, life: int, log: Path, happened: SimpleQueue[Any]) -> None:
        with log.open("wb") as errors:
            process = ForeignProgram(command, subprocess.PIPE, errors)
        self.child = Child("agent", agent, process, log, trusted=False)
        self._life, self._happened = life, happened
        threading.Thread(target=self._read, daemon=True).start()

    def brief(self, brief: Any) -> None:
        """Give it its brief."""
        self.child.brief(brief)

    def half_brief(self, brief: Any) -> None:
        """Give it half of its brief, and nothing more."""
        data = brief_bytes(brief)
        assert self.child.process.stdin is not None
        with suppress(BrokenPipeError):
            self.child.process.stdin.write(data[: len(data) // 2])
        self.orphan()

    def orphan(self) -> None:
        """Close its standard input, as the end of the launcher would."""
        if self.child.process.stdin is not None:
            with suppress(BrokenPipeError):
                self.child.process.stdin.close()

    def kill(self) -> None:
        """Kill it, and what it has started, and wait until it is gone."""
        self.child.process.kill()
        self.child.process.wait()
        self.orphan()

    def _read(self) -> None:
        stdout = self.child.process.stdout
        assert stdout is not None
        with stdout:
            while line := stdout.readline(LONGEST_LINE):
                self._happened.put(Told(self._life, line.rstrip(b"\n")))
        self.child.process.wait()
        self._happened.put(GONE)
