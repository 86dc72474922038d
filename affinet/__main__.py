"""The `affinet` command, and `python -m affinet`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NoReturn

from affinet import rooms


def command() -> NoReturn:
    """What the shell starts."""
    try:
        rooms.refuse_shadows()
    except rooms.RoomShadowed as error:
        print(error, file=sys.stderr)  # noqa: T201
        sys.exit(2)
    with _ctrl_c_left_to_the_system():
        from affinet.cli import commands  # all of affinet, which needs its rooms
    commands.command()


@contextmanager
def _ctrl_c_left_to_the_system() -> Iterator[None]:
    """For imports: a library that meets Ctrl-C meanwhile may raise what it likes in its place."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    yield
    if ours:
        signal.signal(signal.SIGINT, signal.default_int_handler)


if __name__ == "__main__":
    command()
