"""Plain contact traces: `time one other up`, and down when they part; by blanks or commas."""

from __future__ import annotations

from affinet.traces import meetings
from affinet.traces.fields import moment, node
from affinet.traces.link_data import LinkData
from affinet.traces.meetings import Meeting
from netem.impairments.measured import Lines, MeasuredError, shown

_STATES = {"up": True, "down": False}
_HEADING = "time"


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    rows = [_words(text) for text in _below_heading(lines).texts[:200]]
    return any(len(words) == 4 and words[3].lower() in _STATES for words in rows)


def read(lines: Lines) -> LinkData:
    """What contacts say.

    Raises
    ------
    MeasuredError
        When they are none.
    """
    events = []
    for line, text in zip(*_below_heading(lines), strict=True):
        words = _words(text)
        if len(words) != 4 or words[3].lower() not in _STATES:
            raise MeasuredError(f"line {line}: 'time one other up', or down, is due, got {shown(text)}")
        time = moment(line, words[0])
        events.append(Meeting(line, time, node(words[1]), node(words[2]), _STATES[words[3].lower()]))
    return meetings.from_events(events, 0.0)


def _words(text: str) -> list[str]:
    return text.replace(",", " ").replace(";", " ").split()


def _below_heading(lines: Lines) -> Lines:
    heading = bool(lines.texts) and _words(lines.texts[0])[:1] == [_HEADING]
    return lines.after(1) if heading else lines
