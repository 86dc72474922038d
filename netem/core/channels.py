"""The channels of a swarm, and their class.

`sense` is the air a sensor looks through: the world offers it one message per directed link and tick. Every other channel
is communication: an agent broadcasts on it, the medium decides link by link who hears.
"""

from __future__ import annotations

import re
import zlib

SENSE = "sense"
MEASUREMENT = "measurement"
INPUT = "input"
THETA = "theta"
PLACE = "place"
TARGET = "target"
CENTRE = "centre"  # not of the air: what a centralized filter tells reaches everybody

_NAME = re.compile(r"[a-z][a-z0-9-]{0,31}")


def check(name: str) -> str:
    """The name itself, if it can stand in a key expression.

    Raises
    ------
    ValueError
        When it cannot.
    """
    if not _NAME.fullmatch(name):
        raise ValueError(
            f"channel {name!r}: use lower-case letters, digits and '-', starting with a letter, at most 32"
        )
    return name


def code(name: str) -> int:
    """The channel's word in the counter of a draw: from its name alone, so a new channel moves no other's draws."""
    return zlib.crc32(name.encode())
