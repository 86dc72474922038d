"""That an agent answers each inbox, once, and in whose name, of which tick and by which number."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from affinet.conformance import flights
from affinet.conformance.case import Case
from affinet.conformance.record import ACT, Record
from netem.core.listing import listed
from netem.core.plain import shown

_STAR, _SENSE, _EXCHANGE = "The star", "An agent's life, 3. Sense", "An agent's life, 4. Exchange"


def unanswered(record: Record) -> Iterator[str]:
    """Whatever was not answered, and why the flight did not get to its end."""
    yield from _silences(record, {ACT, *record.channels})
    if record.stopped and len(record.asked) - 1 not in record.unanswered:
        yield record.stopped


def _silences(record: Record, streams: set[str]) -> Iterator[str]:
    for number, silent in record.unanswered.items():
        if not (mute := sorted(streams.intersection(silent))):
            continue
        stopped = record.stopped if record.asked[number] is record.asked[-1] else None
        yield stopped or f"{record.asked[number]}: nothing came on {listed(mute)}"


def _all_channels(record: Record) -> Iterator[str]:
    yield from _silences(record, set(record.channels))


def _acts(record: Record) -> Iterator[str]:
    yield from _silences(record, {ACT})


def _once(record: Record) -> Iterator[str]:
    for asked in record.asked:
        for stream in [ACT] if asked.phase == "exchange" else record.channels:
            if (times := len(record.to(asked, stream))) > 1:
                yield f"{asked}: {times} messages came on {stream!r}"
    for stream in sorted({said.stream for said in record.said} - {ACT, *record.channels}):
        yield f"it broadcasts on {stream!r}; channels here are {listed(record.channels)}"


def _ticks(record: Record) -> Iterator[str]:
    for asked, stream, said in record.answers:
        if said.fields.get("k") != asked.tick:
            yield f"{asked}: k = {shown(said.fields.get('k'))} on {stream!r}"


def _sources(record: Record) -> Iterator[str]:
    for asked, stream, said in record.answers:
        channel = None if stream == ACT else stream
        named = (said.fields.get("src"), said.fields.get("channel"))
        if named != (record.agent, channel):
            yield f"{asked}: src, channel = {shown(named)} on {stream!r}, where it is agent {record.agent}"


def numbering(record: Record, life: int) -> Iterator[str]:
    """Numbers of one of its processes that are not those after the ones before."""
    due = defaultdict[str, int](int)
    for asked, stream, said in record.answers:
        if asked.life == life:
            if said.fields.get("seq") != due[stream]:
                yield f"{asked}: seq = {shown(said.fields.get('seq'))} on {stream!r}, where {due[stream]} was due"
            due[stream] += 1


def _numbers(record: Record) -> Iterator[str]:
    yield from numbering(record, 0)


CASES = (
    Case("channels", "answer each sense inbox on every channel of the run", _SENSE, flights.PLAIN, _all_channels),
    Case("acts", "answer each exchange inbox with an act", _EXCHANGE, flights.PLAIN, _acts),
    Case("once", "answer once, and on no other channel", _SENSE, flights.PLAIN, _once),
    Case("tick", "say in `k` the tick of the inbox", _STAR, flights.PLAIN, _ticks),
    Case("source", "say in `src` who it is, and in `channel` on which it speaks", _STAR, flights.PLAIN, _sources),
    Case("numbers", "number its messages from 0, each key for itself, without gaps", _STAR, flights.PLAIN, _numbers),
)
