"""Contact traces of begin and end: `one other begin end`, and whatever stands behind, by blanks or commas."""

from __future__ import annotations

from affinet.traces import meetings
from affinet.traces.fields import number, numbers_only
from affinet.traces.link_data import LinkData
from affinet.traces.meetings import Meeting
from netem.impairments.measured import Lines, MeasuredError, shown


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    rows = [numbers_only(text) for text in lines.texts[:200]]
    return bool(rows) and all(
        row is not None
        and len(row) in (4, 5, 6)
        and row[0] % 1.0 == row[1] % 1.0 == 0.0
        and row[0] != row[1]
        and row[2] <= row[3]
        for row in rows
    )


def read(lines: Lines) -> LinkData:
    """What contacts say; those of a pair that overlap are one.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    told: dict[tuple[str, str], list[tuple[float, float, int]]] = {}
    for line, text in zip(*lines, strict=True):
        words = text.replace(",", " ").split()
        if len(words) < 4:
            raise MeasuredError(f"line {line}: 'one other begin end' is due, got {shown(text)}")
        begin = number(line, words[2], "the begin of a contact in s", least=0.0)
        end = number(line, words[3], "the end of a contact in s")
        if end < begin:
            raise MeasuredError(f"line {line}: the contact ends at {end:g} s, before it begins at {begin:g} s")
        if words[0] == words[1]:
            raise MeasuredError(f"line {line}: {words[0]} meets itself: two nodes are due")
        told.setdefault((min(words[:2]), max(words[:2])), []).append((begin, end, line))
    events = [event for pair, contacts in told.items() for event in _apart(pair, sorted(contacts))]
    events.sort(key=lambda event: (event.time, event.up))
    return meetings.from_events(events, 0.0)


def _apart(pair: tuple[str, str], contacts: list[tuple[float, float, int]]) -> list[Meeting]:
    events: list[Meeting] = []
    for begin, end, line in contacts:
        if end == begin:
            continue
        if events and begin <= events[-1].time:
            events[-1] = events[-1]._replace(time=max(end, events[-1].time))
            continue
        events += [Meeting(line, begin, *pair, up=True), Meeting(line, end, *pair, up=False)]
    return events
