"""The commands on other machines, started from here by whatever gets there (`ssh`, `ip netns exec`), and watched."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from affinet.runtimes.child import RunFailed
from affinet.runtimes.told import printable
from netem.processes.system_errors import about

_LEFT_WITHIN_S = 1.5  # who has not joined yet hears nobody say that it is over
_LAST_BYTES, _LAST_LINES = 1 << 14, 3


@dataclass(frozen=True)
class Command:
    """One of them: on which machine, and what is started here to get it going there."""

    machine: str
    words: tuple[str, ...]


class _Running(NamedTuple):
    command: Command
    process: subprocess.Popen[bytes]
    log: Path


class Commands:
    """Started when the block begins, and gone when it is left.

    What gets there is ended here; the command there, if that does not end it, finds the coordinator gone.

    Parameters
    ----------
    commands
        What to start.
    logs
        Where what they say goes, a file each.
    """

    def __init__(self, commands: Sequence[Command], logs: Path) -> None:
        self._commands, self._logs = commands, logs
        self._running: list[_Running] = []

    def __enter__(self) -> Commands:
        self._logs.mkdir(parents=True, exist_ok=True)
        for number, command in enumerate(self._commands, 1):
            log = self._logs / f"command-{number}-{_plain(command.machine)}.log"
            with log.open("wb") as said, about(command.words[0]):
                process = subprocess.Popen(
                    command.words, stdin=subprocess.DEVNULL, stdout=said, stderr=said, start_new_session=True
                )
            self._running.append(_Running(command, process, log))
        return self

    def __exit__(self, *_: object) -> None:
        deadline_s = time.monotonic() + _LEFT_WITHIN_S
        for process in [running.process for running in self._running]:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline_s - time.monotonic()))
        for process in [running.process for running in self._running]:
            _end(process)

    def heed(self) -> None:
        """Go on if all of them run.

        Raises
        ------
        RunFailed
            When one has ended: which, and what it said last.
        """
        for command, process, log in self._running:
            if (status := process.poll()) is not None:
                raise RunFailed(
                    f"machine {command.machine}: {' '.join(command.words)!r} ended with exit status {status}: {_last(log)}"
                )


def _end(process: subprocess.Popen[bytes]) -> None:
    for end in (process.terminate, process.kill):
        if process.poll() is None:
            end()
            with suppress(subprocess.TimeoutExpired):
                process.wait(1.0)


def _last(log: Path) -> str:
    with log.open("rb") as file:
        file.seek(max(0, file.seek(0, os.SEEK_END) - _LAST_BYTES))
        lines = printable(file.read().decode(errors="replace")).splitlines()[-_LAST_LINES:]
    return " / ".join(lines) or "it had said nothing"


def _plain(name: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in name)
