"""Events of ONE, the Opportunistic Network Environment, as its StandardEventsReader reads them: `12.5 CONN 3 4 up`."""

from __future__ import annotations

import re

from affinet.traces import meetings
from affinet.traces.fields import moment
from affinet.traces.link_data import LinkData
from affinet.traces.meetings import Meeting
from netem.impairments.measured import Lines, MeasuredError, shown

_OF_MESSAGES = ("C", "S", "DE", "A", "DR", "R")
_HOST = re.compile(r"\D*(\d{1,18})")


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return any(len(words := text.split()) > 1 and words[1] == "CONN" for text in lines.texts[:200])


def read(lines: Lines) -> LinkData:
    """What events say.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    events, skipped, ends = [], 0, 0.0
    for line, text in zip(*lines, strict=True):
        words = text.split()
        ends = max(ends, moment(line, words[0]))
        action = words[1] if len(words) > 1 else ""
        if action in _OF_MESSAGES:
            skipped += 1
            continue
        if action != "CONN" or len(words) < 5 or words[4].lower() not in ("up", "down"):
            raise MeasuredError(f"line {line}: an event like '12.5 CONN 3 4 up' is due, got {shown(text)}")
        events.append(
            Meeting(line, float(words[0]), _host(line, words[2]), _host(line, words[3]), words[4].lower() == "up")
        )
    notes = [f"{skipped} events of messages are left out: they are of ONE's own"] if skipped else []
    return meetings.from_events(events, ends, notes)


def _host(line: int, text: str) -> str:
    """The address in a name: ONE's hosts have a group before it."""
    if (host := _HOST.fullmatch(text)) is None:
        raise MeasuredError(f"line {line}: a host is a number, with letters before it at most, got {shown(text)}")
    return str(int(host[1]))
