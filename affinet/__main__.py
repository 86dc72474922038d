"""The `affinet` command, and `python -m affinet`."""

from __future__ import annotations

import sys
from typing import NoReturn

from affinet import rooms


def command() -> NoReturn:
    """What the shell starts."""
    try:
        rooms.refuse_shadows()
    except rooms.RoomShadowed as error:
        print(error, file=sys.stderr)  # noqa: T201
        sys.exit(2)
    from affinet.cli import commands  # all of affinet, which needs its rooms

    commands.command()


if __name__ == "__main__":
    command()
