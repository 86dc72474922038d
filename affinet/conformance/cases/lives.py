"""An agent that is killed and restarted, or stopped and woken."""

from __future__ import annotations

from collections.abc import Iterator

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.cases.answering import numbering, unanswered
from affinet.conformance.cases.forms import miscounted, told_input
from affinet.conformance.record import Record

_SECTION = "Killed, restarted, paused"


def _begins_anew(record: Record) -> Iterator[str]:
    yield from unanswered(record)
    yield from numbering(record, 1)


def _counts_anew(record: Record) -> Iterator[str]:
    yield from (said for asked, said in miscounted(record) if asked.life == 1)


def _flies_nothing(record: Record) -> Iterator[str]:
    begins = next((asked for asked in record.asked if asked.life == 1), None)
    yield from (said for asked, said in told_input(record, 1) if asked is begins)


def _goes_on(record: Record) -> Iterator[str]:
    yield from unanswered(record)
    yield from numbering(record, 0)


def _flies_on(record: Record) -> Iterator[str]:
    woken = next(tick for tick in range(record.plan.world.ticks) if record.plan.timeline.resumed(tick))
    yield from (said for asked, said in told_input(record, 0) if asked.tick == woken)


CASES = (
    Case("restart-numbers", "number its messages from 0 as a new process", _SECTION, flights.KILLED, _begins_anew),
    Case("restart-heard", "count `heard` from 0 as a new process", _SECTION, flights.KILLED, _counts_anew),
    Case("restart-input", "tell that nothing flies as a new process", _SECTION, flights.KILLED, _flies_nothing),
    Case(
        "restart-warm",
        "number its messages from 0 as one that `remembers`, too",
        _SECTION,
        flights.REMEMBERS,
        _begins_anew,
    ),
    Case(
        "pause-numbers",
        "go on with its numbers after a pause, at the tick of its inbox",
        _SECTION,
        flights.PAUSED,
        _goes_on,
    ),
    Case("pause-input", "tell after a pause that its last input flies", _SECTION, flights.PAUSED, _flies_on),
)
