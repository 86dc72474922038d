"""The file of a Rerun recording: what its writer meets, and whether it is whole."""

from __future__ import annotations

import os
import re
import socket
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

from netem.processes import system_errors

RECORDING = "run.rrd"  # in a run directory
# A whole file ends with where its footer begins, how long that is, a checksum, this word, and that there is one footer.
_ENDING = struct.Struct("<QQI8sI")
_BEGINNING = 2**18  # bytes: the blueprint, and what does not change
_WORD = b"RRF2FOOT"
_PATIENCE_S = 1.0
_SYSTEM_ERROR = re.compile(r"\(os error (\d+)\)")


class NotRecorded(OSError):
    """A recording that was promised is missing, or not whole: why."""


def wrong_with(path: Path) -> str | None:
    """What is wrong with a recording; None if it is there, and whole to its last byte."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            file.seek(max(0, size - _ENDING.size))
            ending = file.read()
    except FileNotFoundError:
        return f"{path} was never written"
    except OSError as error:
        return system_errors.said(error)
    if len(ending) == _ENDING.size:
        start, length, _, word, footers = _ENDING.unpack(ending)
        if word == _WORD and footers == 1 and start + length + _ENDING.size == size:
            return None
    return f"{path} breaks off after {size} bytes: was the disk full, or ulimit -f too low?"


def make_room(path: Path) -> None:
    """See that the beginning of a recording fits: the library waits for good for a writer that cannot write it.

    Raises
    ------
    OSError
        When it does not fit.
    """
    with system_errors.about(path):
        try:
            path.write_bytes(bytes(_BEGINNING))
            os.truncate(path, 0)  # who is killed before the library writes leaves nothing, not zeros
        except OSError:
            if path.is_file():  # and no device
                path.unlink()
            raise


def listens(viewer: str) -> bool:
    """Whether somebody listens at the URL of a viewer: the library waits for seconds for one that is gone."""
    place = urlsplit(viewer)
    try:
        socket.create_connection((place.hostname or "", place.port or 0), _PATIENCE_S).close()
    except OSError:
        return False
    return True


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """What the library raises in the block, as an error of the operating system that names the file."""
    try:
        yield
    except RuntimeError as error:
        if cause := _SYSTEM_ERROR.search(str(error)):
            number = int(cause[1])
            raise OSError(number, os.strerror(number), str(path)) from error
        raise NotRecorded(f"{path} breaks off ({error}): was the disk full, or ulimit -f too low?") from error
