"""A process of a run, as the launcher has it: its pipes, what it told, how it ended."""

from __future__ import annotations

import errno
import os
import signal
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Protocol

import psutil

from affinet.runtimes.silence import ProcessStatus, StatusHistory
from affinet.runtimes.told import LONGEST_LINE, Beat, Event, NotItsOwn, beat, printable, read, shown
from netem.processes.supervised import brief_bytes, called

_LAST_LINES, _LAST_BYTES = 12, 1 << 16
_LONGEST_REASON = 4000
_SAID_BESIDE = {"beat", "refused"}  # it gets no further by these


class Process(Protocol):
    """What the launcher has of a process, be it a child of its own (`subprocess.Popen`) or one that the nursery forked."""

    @property
    def pid(self) -> int:
        """Its number among the processes of the machine."""

    @property
    def returncode(self) -> int | None:
        """Its exit status, or minus the signal that ended it; None as long as nobody has asked, or it runs."""

    @property
    def stdin(self) -> IO[bytes] | None:
        """The end of a pipe from which it reads."""

    @property
    def stdout(self) -> IO[bytes] | None:
        """The end of a pipe to which it writes."""

    def poll(self) -> int | None:
        """Its exit status; None as long as it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended; `subprocess.TimeoutExpired` when it has not after so many seconds."""

    def send_signal(self, number: int, /) -> None:
        """Send it a signal, unless it has ended."""

    def terminate(self) -> None:
        """Ask it to leave."""

    def kill(self) -> None:
        """End it."""


class Elsewhere(Protocol):
    """What is known of a process on another machine, by what its machine says."""

    @property
    def where(self) -> str:
        """The machine."""

    @property
    def pss_mb(self) -> float:
        """The most memory it was seen to take there, in megabytes."""

    def look(self) -> ProcessStatus:
        """What the system there says of it."""


class RunFailed(RuntimeError):
    """The run ended before its last tick: why."""


class UserCodeFailed(RunFailed):
    """It did because a user's own code did something wrong."""


def indented(title: str, lines: Sequence[str]) -> str:
    """Lines under a title."""
    return "\n    ".join([title, *lines])


def named(role: str, number: int | None) -> str:
    """What a process is called among those of a run."""
    if number is None:
        return role
    return called(number) if role == "agent" else f"{role} {number}"


@dataclass
class Child:
    """A process of the run.

    Parameters
    ----------
    role
        "netem", "world", "centre", "agent" or "host".
    number
        Of an agent, or a host.
    process, log
        The process, and the file its standard error goes to.
    trusted
        Whether what it runs is sure to come to an end, as no code of a user's own is.
    elsewhere
        The same process, where it runs on another machine.
    expected_to_die
        Whether its death is in the script, or the run is over.
    confessed
        Whether it said why it goes down.
    is_ready, is_done
        Whether it has told so.
    pss_mb
        The most memory it was seen to take, in megabytes; what several share is divided among them.
    lost
        How many messages it says that the transport lost.
    doing, beat_s
        What it does, and when it told so, by the clock of its group; None before its first beat.
    refused
        How many messages it has refused so far, by agent and mistake.
    looks
        What the system says of it, since it was first looked at because nothing moved.
    """

    role: str
    number: int | None
    process: Process
    log: Path
    trusted: bool
    elsewhere: Elsewhere | None = None
    expected_to_die: bool = False
    confessed: bool = False
    is_ready: bool = False
    is_done: bool = False
    pss_mb: float = 0.0
    lost: int = 0
    doing: Beat | None = None
    beat_s: float = 0.0
    refused: dict[tuple[int | None, str], int] = field(default_factory=dict)
    looks: StatusHistory | None = None
    _pending: bytes = b""

    @property
    def name(self) -> str:
        """For people, and for those who wait for it."""
        return named(self.role, self.number)

    @property
    def who(self) -> str:
        """Its name, its number among the processes of its machine, and which that is, if it is another."""
        where = "" if self.elsewhere is None else f" on {self.elsewhere.where}"
        return f"{self.name} (pid {self.process.pid}{where})"

    @property
    def is_mute(self) -> bool:
        """Whether its events have ended."""
        return self.process.stdout is None or self.process.stdout.closed

    @property
    def events_fd(self) -> int:
        """Where its events come from."""
        assert self.process.stdout is not None
        return self.process.stdout.fileno()

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
        """Note its memory."""
        if self.elsewhere is not None:
            self.pss_mb = self.elsewhere.pss_mb
        if self.elsewhere is not None or self.process.returncode is not None:
            return
        with suppress(psutil.NoSuchProcess, psutil.AccessDenied):  # a program with other rights keeps it to itself
            self.pss_mb = max(self.pss_mb, psutil.Process(self.process.pid).memory_full_info().pss / 2**20)

    def look(self) -> ProcessStatus:
        """What the system says of it.

        Raises
        ------
        RunFailed
            When it is gone.
        """
        if self.process.poll() is not None:  # something that it had started keeps its pipe open
            raise RunFailed(self.obituary())
        now = _status(self.process.pid) if self.elsewhere is None else self.elsewhere.look()
        self.looks = StatusHistory(now, now, now) if self.looks is None else self.looks.then(now)
        return now

    def hear(self) -> list[Event] | None:
        """What it has told since it was last heard, or None at its end of file.

        Raises
        ------
        RunFailed
            When it failed, or told what is not its own to tell.
        """
        chunk = os.read(self.events_fd, 65536)
        if not chunk:
            return None
        *lines, self._pending = (self._pending + chunk).split(b"\n")
        if len(self._pending) > LONGEST_LINE:
            said = shown(self._pending)
            raise RunFailed(f"{self.who}: it said {said} on its standard output, and does not end the line")
        events = (self._event(line) for line in lines)
        return [event for event in events if event["event"] not in _SAID_BESIDE]

    def free(self) -> None:
        """Give back what the launcher holds of a process that is gone, or about to be."""
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe:
                with suppress(BrokenPipeError):
                    pipe.close()

    def obituary(self) -> str:
        """How it ended, and its last lines."""
        code = self.process.wait()
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else f"ended with exit status {code}"
        lines = self.last_lines
        return f"{self.who} was {how}." + (indented(" Its last lines:", lines) if lines else " It had said nothing.")

    @property
    def last_lines(self) -> list[str]:
        """What it said last on its standard error."""
        with self.log.open("rb") as log:
            log.seek(max(0, log.seek(0, os.SEEK_END) - _LAST_BYTES))
            return printable(log.read().decode(errors="replace")).splitlines()[-_LAST_LINES:]

    def report(self) -> dict[str, Any]:
        """For the summary."""
        report = {
            "role": self.role,
            "id": self.number,
            "pid": self.process.pid,
            "pss_mb": round(self.pss_mb, 1),
            "exit": self.process.returncode,
        }
        where = {} if self.elsewhere is None else {"machine": self.elsewhere.where}
        return report | where | ({"lost": self.lost} if self.lost else {})

    def _event(self, line: bytes) -> Event:
        try:
            event = read(self.role, line)
        except NotItsOwn as error:
            raise RunFailed(f"{self.who}: {error} (docs/protocol.md)") from error
        self.confessed = event["event"] in ("failed", "user-code")
        match event["event"]:
            case "failed":
                raise RunFailed(f"{self.name}: {printable(event['reason'])[:_LONGEST_REASON]}")
            case "user-code":
                raise UserCodeFailed(f"{self.name}: {printable(event['reason'])[:_LONGEST_REASON]}")
            case "beat":
                self.doing = beat(event)
            case "lost":
                self.lost += event["count"]
            case "refused":
                self.refused |= {(agent, wrong): count for agent, wrong, count in event["of"]}
            case "ready" if self.is_ready or self.is_done:
                raise RunFailed(f"{self.who}: it said twice that it is ready (docs/protocol.md)")
            case "done" if self.is_done or not self.is_ready:
                raise RunFailed(f"{self.who}: it said that it is done, and was not flying (docs/protocol.md)")
            case "ready":
                self.is_ready = True
            case "done":  # it has done its part: agents leave while the world still writes
                self.is_done = self.expected_to_die = True
        return event

    def _write(self, data: bytes) -> None:
        stdin: Any = self.process.stdin
        with suppress(BrokenPipeError, ValueError):  # it is gone, or the run is over and the pipe closed
            stdin.write(data)
            stdin.flush()


def _status(pid: int) -> ProcessStatus:
    process = psutil.Process(pid)
    used = process.cpu_times()
    return ProcessStatus(process.status(), used.user + used.system)
