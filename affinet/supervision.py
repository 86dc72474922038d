"""The launcher's end of supervision: children it started, what they tell, and how they end.

A child's standard output carries its events, so its end of file is its death, seen at once and without polling. The other
end is `netem/supervised.py`.
"""

from __future__ import annotations

import errno
import json
import os
import selectors
import signal
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil

from netem.session import ENVIRONMENT
from netem.supervised import brief_bytes

_LAST_LINES = 12
_GRACE_S = 1.2
# What can be imported here can be there: PYTHONPATH cannot say so of a folder with a colon in its name.
_RUN = """import json, runpy, sys
path, _, package = sys.argv[1:]
sys.path[:] = json.loads(path)
runpy.run_module(package, run_name="__main__", alter_sys=True)"""


class RunFailed(RuntimeError):
    """The run ended before its last tick: why."""


class UserCodeFailed(RunFailed):
    """It did because a user's own code did something wrong."""


@dataclass
class Child:
    """A process of the run.

    Parameters
    ----------
    role
        "netem", "world" or "agent".
    number
        Of an agent.
    process, log
        The process, and the file its standard error goes to.
    expected_to_die
        Whether its death is in the script, or the run is over.
    """

    role: str
    number: int | None
    process: subprocess.Popen[bytes]
    log: Path
    expected_to_die: bool = False
    rss_mb: float = 0.0
    pending: bytes = b""
    events: deque[dict[str, Any]] = field(default_factory=deque)

    @property
    def name(self) -> str:
        """For people."""
        return self.role if self.number is None else f"{self.role} {self.number}"

    def order(self, order: str) -> None:
        """Give it an order; a child that is gone cannot take it, and its end of file will say so."""
        self._write(f"{order}\n".encode())

    def brief(self, brief: Any) -> None:
        """Give it its brief, which it reads when it has come that far."""
        # Longer than a pipe holds: to wait for one that imports, or is frozen, would keep a death of another from being seen.
        try:
            threading.Thread(target=self._write, args=(brief_bytes(brief),), daemon=True).start()
        except RuntimeError as error:  # what Python makes of it where the system has no more threads
            raise OSError(errno.EAGAIN, str(error)) from error

    def pause(self) -> None:
        """Stop it, as the script says."""
        self.process.send_signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Let it go on."""
        self.process.send_signal(signal.SIGCONT)

    def measure(self) -> None:
        """Note its resident memory."""
        with suppress(psutil.NoSuchProcess):
            self.rss_mb = max(self.rss_mb, psutil.Process(self.process.pid).memory_info().rss / 2**20)

    def obituary(self) -> str:
        """How it ended, and its last lines."""
        code = self.process.wait()
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit status {code}"
        lines = self.log.read_text(errors="replace").splitlines()[-_LAST_LINES:]
        said = "".join(f"\n    {line}" for line in lines) if lines else " It had said nothing."
        return f"{self.name} (pid {self.process.pid}) was {how}.{' Its last lines:' if lines else ''}{said}"

    def report(self) -> dict[str, Any]:
        """For the summary."""
        return {
            "role": self.role,
            "id": self.number,
            "pid": self.process.pid,
            "rss_mb": round(self.rss_mb, 1),
            "exit": self.process.returncode,
        }

    def _write(self, data: bytes) -> None:
        stdin: Any = self.process.stdin
        with suppress(BrokenPipeError, ValueError):  # it is gone, or the run is over and the pipe closed
            stdin.write(data)
            stdin.flush()


def module(package: str) -> list[str]:
    """The command line of `python -m package`, with the search path of this process."""
    path = [os.path.abspath(entry) for entry in sys.path if entry]
    return [sys.executable, "-P", "-c", _RUN, json.dumps(path), "-m", package]


class Crew:
    """All children of a run; leaving the block leaves none behind."""

    def __init__(self, logs: Path) -> None:
        self._logs = logs
        self._selector = selectors.DefaultSelector()
        self.children: list[Child] = []

    def __enter__(self) -> Crew:
        return self

    def __exit__(self, *_: object) -> None:
        self._end_all()
        self._selector.close()

    def start(self, role: str, program: Sequence[str], brief: Any, number: int | None = None) -> Child:
        """Start a program, and give it its brief."""
        log = self._logs / (f"{role}.log" if number is None else f"{role}-{number}.log")
        with log.open("ab") as standard_error:
            process = subprocess.Popen(
                program,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=standard_error,
                env=os.environ | ENVIRONMENT,
                start_new_session=True,  # Ctrl-C is for the launcher, which ends its children in order
            )
        child = Child(role, number, process, log)
        self.children.append(child)
        self._selector.register(self._stdout(child), selectors.EVENT_READ, child)
        child.brief(brief)
        return child

    def events(self, timeout_s: float, missing: str) -> Iterator[tuple[Child, dict[str, Any]]]:
        """What the children tell, as it comes; endless.

        Raises
        ------
        RunFailed
            When a child dies out of turn or fails, or nobody tells anything for `timeout_s`.
        """
        while True:
            for child in self.children:
                while child.events:
                    yield child, child.events.popleft()
            ready = self._selector.select(timeout_s)
            if not ready:
                raise RunFailed(f"waited {timeout_s:g} s for {missing}")
            for key, _ in ready:
                self._read(key.data)

    def kill(self, child: Child) -> None:
        """Kill a child as the script says, and wait until it is gone."""
        child.expected_to_die = True
        child.measure()
        child.process.kill()
        child.process.wait()

    def release(self) -> None:
        """The run is over: from now on everybody may leave."""
        for child in self.children:
            child.expected_to_die = True
            child.resume()

    def await_all_gone(self, timeout_s: float) -> None:
        """Wait until every child has left.

        Raises
        ------
        RunFailed
            When one has not within `timeout_s`, or left with an error.
        """
        deadline = time.monotonic() + timeout_s
        for child in self.children:
            try:
                child.process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired as error:
                raise RunFailed(f"{child.name} had not left {timeout_s:g} s after the end of the run") from error
            if child.process.returncode > 0:
                raise RunFailed(child.obituary())

    def _read(self, child: Child) -> None:
        chunk = os.read(self._stdout(child), 65536)
        if not chunk:
            self._selector.unregister(self._stdout(child))
            if not child.expected_to_die:
                raise RunFailed(child.obituary())
            return
        *lines, child.pending = (child.pending + chunk).split(b"\n")
        for line in lines:
            event = json.loads(line)
            if event["event"] == "failed":
                failure = UserCodeFailed if event.get("user_code") else RunFailed
                raise failure(f"{child.name}: {event['reason']}")
            if event["event"] == "done":  # it has done its part: agents leave while the world still writes
                child.expected_to_die = True
            child.events.append(event)

    def _end_all(self) -> None:
        # The world goes first: it has a recording to close.
        alive = [child for child in self.children if child.process.poll() is None]
        for child in sorted(alive, key=lambda child: child.role != "world"):
            child.process.terminate()
            child.resume()  # one that is stopped could not hear that it has to leave
        deadline = time.monotonic() + _GRACE_S
        for child in alive:
            try:
                child.process.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.process.kill()
                child.process.wait()
        for child in self.children:
            for pipe in (child.process.stdin, child.process.stdout):
                if pipe:
                    with suppress(BrokenPipeError):
                        pipe.close()

    @staticmethod
    def _stdout(child: Child) -> int:
        assert child.process.stdout is not None
        return child.process.stdout.fileno()
