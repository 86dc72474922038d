"""The standard streams as the command finds them: of few characters, closed, or a pipe whose reader has gone."""

from __future__ import annotations

import io
import os
import sys
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer


def settle() -> None:
    """Make the standard streams such that no run fails for what cannot be shown or is not read."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # or the next file that is opened would be taken for a standard stream
    sys.stdout, sys.stderr = _lenient(sys.stdout), _lenient(sys.stderr)


class _WhileRead(io.FileIO):
    """A descriptor; what is written after its reader has gone is dropped, as it would have been unread."""

    def write(self, data: ReadableBuffer, /) -> int:
        """Write what is still read."""
        try:
            return super().write(data)
        except BrokenPipeError:
            return memoryview(data).nbytes


def _lenient(stream: TextIO | None) -> TextIO | None:
    """The same stream; a character that it does not have is a question mark."""
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    raw = _WhileRead(stream.fileno(), "wb", closefd=False)
    return io.TextIOWrapper(
        io.BufferedWriter(raw),
        encoding=stream.encoding,
        errors="replace" if stream.errors == "strict" else stream.errors,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )
