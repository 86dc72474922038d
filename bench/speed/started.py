"""Processes of a peer: started, told, heard, and ended."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from netem.wire.session import ENVIRONMENT

_BENCH = Path(__file__).parents[1]
_PATIENCE = 60.0  # s, for what has nothing more to do


class PeerFailed(Exception):
    """A peer does not run on this machine."""


class Process:
    """A module that is told what it is in a line of JSON, says when it is ready, and ends with its standard input."""

    def __init__(self, module: str, told: Mapping[str, Any]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-m", f"speed.{module}"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | ENVIRONMENT | {"PYTHONPATH": str(_BENCH)},
        )
        self.pid, self._module = self._process.pid, module
        self.tell(json.dumps(told))

    def tell(self, line: str) -> None:
        """One line.

        Raises
        ------
        PeerFailed
            When it has ended.
        """
        assert self._process.stdin
        try:
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise self._ended() from None

    def said(self) -> str:
        """The next line it says.

        Raises
        ------
        PeerFailed
            When it has ended.
        """
        assert self._process.stdout
        if not (line := self._process.stdout.readline()):
            raise self._ended()
        return line.strip()

    def end(self) -> None:
        """Let it go, and wait for it."""
        if self._process.returncode is None:
            self._process.communicate("done\n", timeout=_PATIENCE)

    def kill(self) -> None:
        """Whatever it does."""
        if self._process.returncode is None:
            self._process.kill()
            self._process.communicate()

    def _ended(self) -> PeerFailed:
        status = self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            assert stream
            with suppress(BrokenPipeError):  # what it has not read
                stream.close()
        return PeerFailed(f"bench/speed/{self._module}.py ended with status {status}")


@contextmanager
def all_of(module: str, told: Mapping[str, Mapping[str, Any]]) -> Iterator[dict[str, Process]]:
    """A process for each role, ready; none is left behind."""
    started: dict[str, Process] = {}
    try:
        for role, brief in told.items():
            started[role] = Process(module, brief)
        for process in started.values():
            process.said()
        yield started
        for process in started.values():
            process.end()
    except BaseException:
        for process in started.values():
            process.kill()
        raise
