"""How a process that ran a user's own code ends: at once, whatever threads that code has left behind."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable
from typing import NoReturn

_FAILED, _INTERRUPTED = 1, 130


def status_of(main: Callable[[], int | None]) -> int:
    """The exit status that Python would give a process that runs this; what it would say of an error is said."""
    try:
        return main() or 0
    except SystemExit as ending:
        if ending.code is None or isinstance(ending.code, int):
            return ending.code or 0
        print(ending.code, file=sys.stderr)  # noqa: T201
        return _FAILED
    except BaseException as error:  # noqa: BLE001 - the process is over, and as Python does it says of what
        sys.excepthook(type(error), error, error.__traceback__)
        return _INTERRUPTED if isinstance(error, KeyboardInterrupt) else _FAILED


def leave(status: int) -> NoReturn:
    """End this process without waiting for its threads, as the interpreter would for those that are no daemons."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):  # gone, full or closed since: there is nobody to tell
            if stream is not None:
                stream.flush()
    os._exit(status)
