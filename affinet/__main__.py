"""The `affinet` command, and `python -m affinet`."""

from __future__ import annotations

import sys
from typing import NoReturn

from affinet import rooms
from affinet.cli.importing import ctrl_c_left_to_the_system


def command() -> NoReturn:
    """What the shell starts."""
    try:
        rooms.refuse_shadows()
    except rooms.RoomShadowed as error:
        print(error, file=sys.stderr)  # noqa: T201
        sys.exit(2)
    with ctrl_c_left_to_the_system():
        from affinet.cli import commands  # which needs affinet's rooms
    commands.command()


if __name__ == "__main__":
    command()
