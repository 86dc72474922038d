"""How an agent comes, and how it leaves."""

from __future__ import annotations

from collections.abc import Iterator

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.record import Record

_BRIEF, _CONNECT, _END = (f"An agent's life, {step}" for step in ("1. Brief", "2. Connect", "5. End"))


def _ready(record: Record) -> Iterator[str]:
    if not record.asked:
        yield record.stopped or "it was never asked for anything"


def _unasked(record: Record) -> Iterator[str]:
    for said in record.said:
        yield f"before its first inbox it published {len(said.data)} bytes on {said.stream!r}"


def _plain_lines(record: Record) -> Iterator[str]:
    for life in record.lives:
        yield from life.wrong


def _done(record: Record) -> Iterator[str]:
    if not record.stopped and not record.lives[-1].done:
        yield "it did not say so"


def _left(record: Record) -> Iterator[str]:
    if not record.stopped and record.lives[-1].exit is None:
        yield "it stayed"


def _left_with_0(record: Record) -> Iterator[str]:
    yield from _left(record)
    if record.lives[-1].exit:
        yield record.lives[-1].last_words


def _ended(record: Record) -> Iterator[str]:
    yield from _done(record)
    yield from _left_with_0(record)


CASES = (
    Case(
        "ready", "say that it is ready, and hear its inbox by then", _CONNECT, flights.PLAIN, _ready, shown_early=True
    ),
    Case("unasked", "publish nothing before its first inbox", _CONNECT, flights.UNASKED, _unasked),
    Case(
        "lines",
        "write to standard output the lines that are named, and nothing else",
        _CONNECT,
        flights.PLAIN,
        _plain_lines,
    ),
    Case("done", "say that it is done when its inbox says that the run is over", _END, flights.PLAIN, _done),
    Case("exit", "leave then, with exit status 0", _END, flights.PLAIN, _left_with_0),
    Case("end-first", "say so and leave where that is its first inbox", _END, flights.UNASKED, _ended),
    Case("orphaned", "leave when standard input closes", _CONNECT, flights.ORPHANED, _left),
    Case("orphaned-early", "leave when standard input closes within the brief", _BRIEF, flights.ORPHANED_EARLY, _left),
)
