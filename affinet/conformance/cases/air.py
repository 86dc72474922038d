"""What the air does to an agent: nothing comes, it comes late, twice; and what its own clock does."""

from __future__ import annotations

from collections.abc import Iterator

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.cases.answering import unanswered
from affinet.conformance.cases.forms import acts, broadcasts, miscounted
from affinet.conformance.record import Record

_STAR, _SENSE, _EXCHANGE = "The star", "An agent's life, 3. Sense", "An agent's life, 4. Exchange"


def goes_on(record: Record) -> Iterator[str]:
    """Whatever it leaves unanswered, or answers in another form than is promised."""
    yield from unanswered(record)
    yield from broadcasts(record)
    yield from acts(record)


def _counts(record: Record) -> Iterator[str]:
    yield from unanswered(record)
    yield from (said for _, said in miscounted(record))


def _of_its_inbox(record: Record) -> Iterator[str]:
    yield from unanswered(record)
    for asked, stream, said in record.answers:
        if asked.phase == "sense" and asked.clock != asked.tick and said.fields.get("k") == asked.clock:
            yield f"{asked}: on {stream!r} it takes what its clock says, {asked.clock}, for the tick"


CASES = (
    Case("silence", "answer whatever comes, and if it is nothing", _EXCHANGE, flights.SILENT, goes_on),
    Case("late", "count broadcasts of earlier ticks too", _EXCHANGE, flights.LATE, _counts),
    Case("doubled", "count a broadcast twice that comes twice", _EXCHANGE, flights.DOUBLED, _counts),
    Case("clock", "take the tick from `k`, whatever its clock says", _SENSE, flights.CLOCK, _of_its_inbox),
)
