"""What comes to an agent that is no inbox of its run."""

from __future__ import annotations

from collections.abc import Iterator

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.record import Record

_SECTION = "What is no inbox"


def _gives_up(record: Record) -> Iterator[str]:
    if record.spoiled is None:
        return
    for said in record.said[record.spoiled :]:
        yield f"it answered on {said.stream!r}"
    if record.lives[-1].exit is None:
        yield "it stayed"
    elif record.lives[-1].exit == 0:
        yield "it left with exit status 0"


CASES = (
    Case("garbage", "leave with an error, unanswered, at what is no MessagePack", _SECTION, flights.GARBAGE, _gives_up),
    Case("no-phase", "leave with an error, unanswered, at an inbox of no phase", _SECTION, flights.NO_PHASE, _gives_up),
    Case("gap", "leave with an error, unanswered, where an inbox is missing", _SECTION, flights.GAP, _gives_up),
)
