"""What Zenoh says of why it cannot, for people: once, and without the places in its own source."""

from __future__ import annotations

import re

_PLACE = re.compile(r" at \S+\.rs:\d+\.?")
_NUMBER = re.compile(r" \(os error \d+\)")
_TWICE = re.compile(r"([^\s/\[]+:\d+): \[?\1: ([^\]]*)\]?")


def plain(said: str) -> str:
    """The reason alone."""
    return _TWICE.sub(r"\1: \2", _NUMBER.sub("", _PLACE.sub("", said))).rstrip(". ")
