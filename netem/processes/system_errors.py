"""What the operating system refuses, in one line with the way out; and clean-up that hides no earlier failure."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from os import PathLike

_ROOM = "free some room or raise the limit (ulimit -f), or write to another place"
_RIGHTS = "get the right to it, or write to another place"
_TAKEN = "a file is where a directory is due, or the other way round: name another"
_MORE = "raise the limit (ulimit -u, or memory), or fly in one process (runtime inprocess)"
_FILES = "raise the limit of open files (ulimit -n)"
_WAYS_OUT = {
    errno.ENOSPC: _ROOM,
    errno.EDQUOT: _ROOM,
    errno.EFBIG: _ROOM,
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.EROFS: _RIGHTS,
    errno.ENOTDIR: _TAKEN,
    errno.EISDIR: _TAKEN,
    errno.EEXIST: _TAKEN,
    errno.ENAMETOOLONG: "give it a shorter name",
    errno.EAGAIN: _MORE,
    errno.ENOMEM: _MORE,
    errno.EMFILE: _FILES,
    errno.ENFILE: _FILES,
    errno.ENOENT: "it was not there, or is not any more: look at the path",
}


def said(error: OSError) -> str:
    """An error of the operating system in one line: where, what, and the way out."""
    if error.errno is None:
        return " ".join(str(error).split())
    where = "" if error.filename is None else f"{os.fspath(error.filename)!r}: "
    way_out = _WAYS_OUT.get(error.errno)
    return f"{where}{os.strerror(error.errno)}{f'; {way_out}' if way_out else ''}"


@contextmanager
def about(path: str | PathLike[str]) -> Iterator[None]:
    """Errors of the operating system in the block name this file, where they name none."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and error.filename is None:
            error.filename = os.fspath(path)
        raise


@contextmanager
def afterwards(*steps: Callable[[], object]) -> Iterator[None]:
    """Take all these steps when the block ends, whatever becomes of each; the first failure is the one that is raised."""
    first: BaseException | None = None
    try:
        yield
    except BaseException as error:  # noqa: BLE001 - raised again below, once everything is cleaned up
        first = error
    for step in steps:
        try:
            step()
        except BaseException as error:  # noqa: BLE001 - as above
            if first is None:
                first = error
            else:
                first.add_note(f"and then: {said(error) if isinstance(error, OSError) else repr(error)}")
    if first is not None:
        raise first
