"""A run's private folder: its socket, and what nobody but this user may read. However the run ends, it is gone after it.

The launcher removes it when it ends, the nursery when the launcher is killed, and when both are, the next run of this user.
It is held by a lock, which the system takes away with the launcher.
"""

from __future__ import annotations

import fcntl
import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

_PREFIX, _HELD = "affinet-", "held"
_PLACES = ("/tmp", "/var/tmp", "/dev/shm")  # where the user's own temporary folder will not do
_PLAIN_PATH = re.compile(r"[A-Za-z0-9/._+-]+")  # an endpoint is a grammar of its own, in which '?' and '#' part it
_LONGEST_SOCKET, _SOCKET = 107, f"/{_PREFIX}12345678/z.sock"


@contextmanager
def private_folder() -> Iterator[Path]:
    """A new one, until the block ends; those of runs that were killed are removed.

    Raises
    ------
    OSError
        When there is no place for it.
    """
    where = socket_folder()
    _remove_abandoned(Path(where))
    folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=where))
    try:
        with _hold(folder):
            yield folder
    finally:
        remove(folder)


def remove(folder: Path) -> None:
    """Remove one, as far as it is there."""
    shutil.rmtree(folder, ignore_errors=True)


def socket_folder() -> str:
    """A temporary folder in which the path of a socket is short enough for the system and plain enough for an endpoint.

    Raises
    ------
    OSError
        When there is none.
    """
    own = tempfile.gettempdir()
    for folder in (own, *_PLACES):
        fits = len(folder) + len(_SOCKET) <= _LONGEST_SOCKET and _PLAIN_PATH.fullmatch(folder)
        if fits and os.access(folder, os.W_OK | os.X_OK):
            return folder
    raise OSError(
        f"{own!r} is too long or too odd a path for the run's socket, and {', '.join(_PLACES)} cannot be written to; "
        f"set TMPDIR to a plain path of at most {_LONGEST_SOCKET - len(_SOCKET)} characters"
    )


@contextmanager
def _hold(folder: Path) -> Iterator[None]:
    lock = folder / f"{_HELD}-soon"
    descriptor = os.open(lock, os.O_CREAT | os.O_RDWR, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        lock.rename(folder / _HELD)  # now that it is locked: nobody takes it for abandoned in between
        yield
    finally:
        os.close(descriptor)


def _remove_abandoned(where: Path) -> None:
    for folder in where.glob(f"{_PREFIX}*"):
        with suppress(OSError):  # it is held, or is another's, or has gone meanwhile
            if folder.lstat().st_uid == os.geteuid():
                _remove_unless_held(folder)


def _remove_unless_held(folder: Path) -> None:
    descriptor = os.open(folder / _HELD, os.O_RDWR | os.O_NOFOLLOW)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        remove(folder)
    finally:
        os.close(descriptor)
