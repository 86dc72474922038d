"""Contact traces of begin and end: `one other begin end`, and whatever stands behind, by blanks or commas."""

from __future__ import annotations

from affinet.traces import meetings
from affinet.traces.fields import LATEST, moment, node, numbers_only
from affinet.traces.link_data import LinkData
from affinet.traces.meetings import Meeting
from netem.impairments.measured import Lines, MeasuredError, shown


def recognised(lines: Lines) -> bool:
    """Whether it has the form of such a file: what is wrong in one that has is told of the line, and is no other format."""
    rows = [numbers_only(text) for text in lines.texts[:200]]
    return all(
        row is not None and len(row) in (4, 5, 6) and row[0] % 1.0 == row[1] % 1.0 == 0.0 for row in rows
    ) and any(row is not None and row[0] != row[1] for row in rows)


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
        begin = moment(line, words[2], "the begin of a contact in s")
        end = moment(line, words[3], "the end of a contact in s", least=-LATEST)
        if end < begin:
            raise MeasuredError(f"line {line}: the contact ends at {end:g} s, before it begins at {begin:g} s")
        one, other = node(words[0]), node(words[1])
        if one == other:
            raise MeasuredError(f"line {line}: {one} meets itself: two nodes are due")
        told.setdefault((min(one, other), max(one, other)), []).append((begin, end, line))
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
