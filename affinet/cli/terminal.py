"""The standard streams as the command finds them: of few characters, closed, or a pipe whose reader has gone."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

from netem.processes.system_errors import about

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def settle() -> None:
    """Make the standard streams such that no run fails for what cannot be shown or is not read."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # or the next file that is opened would be taken for a standard stream
    sys.stdout, sys.stderr = _lenient(sys.stdout, BrokenPipeError), _lenient(sys.stderr, OSError)


class _WhileTaken(io.FileIO):
    """A descriptor; what it does not take for such an error is dropped.

    What comes after its reader has gone would have been unread; and where complaints cannot be written, nor can that one.
    """

    def __init__(self, descriptor: int, dropping: type[OSError]) -> None:
        super().__init__(descriptor, "wb", closefd=False)
        self._dropping = dropping

    def write(self, data: ReadableBuffer, /) -> int:
        """Write what is still taken."""
        try:
            with about("what it prints"):
                return super().write(data)
        except self._dropping:
            return memoryview(data).nbytes


def _lenient(stream: TextIO | None, dropping: type[OSError]) -> TextIO | None:
    """The same stream; a character that it does not have is a question mark."""
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    raw = _WhileTaken(stream.fileno(), dropping)
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=stream.encoding,
        errors="replace" if stream.errors == "strict" else stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
