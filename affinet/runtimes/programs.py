"""Programs as processes of a run: their pipes, their environment, and the end of what those of somebody else's have started."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from typing import IO

from netem.wire.session import ENVIRONMENT


class Program(subprocess.Popen[bytes]):
    """A program which writes its events to a pipe, and what else it says to its log.

    Parameters
    ----------
    command
        Its command line.
    stdin
        What it reads from, as `subprocess.Popen` takes it.
    log
        Its standard error.
    """

    def __init__(self, command: Sequence[str], stdin: int, log: IO[bytes]) -> None:
        super().__init__(
            command,
            stdin=stdin,
            stdout=subprocess.PIPE,
            stderr=log,
            env=os.environ | ENVIRONMENT,
            start_new_session=True,  # Ctrl-C is for the launcher, which ends its children in order
        )


class ForeignProgram(Program):
    """A program of somebody else's making, with all that it starts: they are stopped, and end, together."""

    def poll(self) -> int | None:
        """Its exit status; None as long as it runs."""
        if self.returncode is None and super().poll() is not None:
            self._signal_all(signal.SIGKILL)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Its exit status, once it has ended; `subprocess.TimeoutExpired` when it has not after so many seconds."""
        ran = self.returncode is None
        code = super().wait(timeout)
        if ran:
            self._signal_all(signal.SIGKILL)
        return code

    def send_signal(self, sig: int) -> None:
        """Send it and its own a signal, unless it has ended."""
        if self.poll() is None:
            self._signal_all(sig)

    def _signal_all(self, number: int) -> None:
        with suppress(ProcessLookupError):  # as a rule it has started nothing, or ended that itself
            os.killpg(self.pid, number)
