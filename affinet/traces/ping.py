"""The output of ping, of iputils, BusyBox or macOS: round trips, one by one."""

from __future__ import annotations

import re
from typing import NamedTuple

import numpy as np

from affinet.traces.fields import number
from affinet.traces.link_data import LinkData, Messages, Quantity, Steps
from analysis.models.arrays import Array
from netem.impairments.measured import Lines, MeasuredError, shown

_HEADER = re.compile(r"^PING\s+(\S+)")
_SEQUENCE = re.compile(r"\b(?:icmp_)?seq[= ](\d{1,18})")
_TOOK = re.compile(r"\btime([=<])(\S+)\s+ms")
_STAMP = re.compile(r"^\[(\d+\.?\d*)\]")
_SENT = re.compile(r"^(\d{1,18}) packets transmitted")
_ANSWER = re.compile(r"bytes from ")
_WRAP = 65536  # numbers of messages have 16 bits
_MOST = 10_000_000


class _Log(NamedTuple):
    took: dict[int, float]  # round trip in ms, by number
    stamp: dict[int, float]
    line: dict[int, int]
    missed: set[int]
    late: set[int]
    doubled: int
    sent: int | None
    target: str


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return any(_HEADER.match(text) for text in lines.texts[:3]) or any(
        _ANSWER.search(text) and _SEQUENCE.search(text) for text in lines.texts[:20]
    )


def read(lines: Lines) -> LinkData:
    """What a log says.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    log = _log(lines)
    if not log.took:
        raise MeasuredError(f"line {lines.numbers[-1] if lines.numbers else 1}: no answer in it, so no delay is known")
    seen = {*log.took, *log.missed}
    first = 0 if 0 in seen else 1
    last = max(seen) if log.sent is None else max(max(seen), first + log.sent - 1)
    number_of = np.arange(first, last + 1)
    lost = np.array([one not in log.took for one in number_of.tolist()])
    delay = np.array([log.took.get(one, np.nan) for one in number_of.tolist()]) / 2000.0
    late = np.array([one in log.late for one in number_of.tolist()])
    time = _times(number_of.astype(np.float64), log)
    assumed = ["ping tells of round trips: half of one is taken as the delay one way, and what is lost on either way"]
    if log.sent is None:
        assumed.append("its last lines are not there: what was lost after the last answer is not known")
    nowhere = np.zeros(len(time), dtype=np.int64)
    steps = Steps(nowhere, time, nowhere, nowhere + 1, 1.0 - lost)
    pace = float(time[-1] / (len(time) - 1)) if len(time) > 1 else 1.0
    return LinkData(
        nodes=("here", log.target),
        ends=float(time[-1]) + pace,
        steps={
            Quantity.AVAILABILITY: steps,
            Quantity.DELAY: Steps(nowhere, time, nowhere, nowhere + 1, delay).at(~lost),
        },
        messages=Messages(time, lost, delay, late, log.doubled),
        one_link=True,
        paced=not log.stamp,
        assumed=tuple(assumed),
    )


def _log(lines: Lines) -> _Log:
    took: dict[int, float] = {}
    stamp: dict[int, float] = {}
    line_of: dict[int, int] = {}
    missed, late, doubled = set[int](), set[int](), 0
    sent: int | None = None
    target, newest, answered, turns = "", -1, -1, 0
    for line, text in zip(*lines, strict=True):
        if header := _HEADER.match(text):
            if target or took:
                raise MeasuredError(f"line {line}: another ping begins: give each a file of its own")
            target = header[1]
        elif summary := _SENT.match(text):
            sent = int(summary[1])
            if sent > _MOST:
                raise MeasuredError(f"line {line}: {sent} packets were transmitted: at most {_MOST} are read")
            if took and sent < len(took):
                raise MeasuredError(
                    f"line {line}: {sent} packets were transmitted and {len(took)} answered: of which log is it?"
                )
        elif at := _SEQUENCE.search(text):
            if int(at[1]) >= _WRAP:
                raise MeasuredError(f"line {line}: icmp_seq {shown(at[1])}: ping counts to {_WRAP - 1} and begins anew")
            this = int(at[1]) + turns * _WRAP
            if newest - this > _WRAP // 2:
                turns, this = turns + 1, this + _WRAP
            newest = max(newest, this)
            if not _ANSWER.search(text):
                missed.add(this)
                continue
            if "(DUP!)" in text:
                doubled += 1
                continue
            if this in took:
                raise MeasuredError(f"line {line}: icmp_seq {this} is answered again: give each ping a file of its own")
            took[this] = _took(line, text)
            if this < answered:
                late.add(this)
            answered = max(answered, this)
            if at_time := _STAMP.match(text):
                stamp[this], line_of[this] = float(at_time[1]) - took[this] / 1000.0, line
    if stamp and len(stamp) < len(took):
        raise MeasuredError(f"line {lines.numbers[-1]}: only some answers have a time before them: use ping -D for all")
    return _Log(took, stamp, line_of, missed - took.keys(), late, doubled, sent, target or "there")


def _took(line: int, text: str) -> float:
    if (took := _TOOK.search(text)) is None:
        raise MeasuredError(f"line {line}: no time=... ms in it; ping with at least 16 bytes; got {shown(text)}")
    return number(line, took[2], "a round trip in ms", least=0.0)


def _times(numbers: Array, log: _Log) -> Array:
    """When each message was sent: in seconds by the stamps of the log, or how many went before it."""
    if not log.stamp:
        return np.asarray(numbers - numbers[0])
    known = np.array(sorted(log.stamp))
    at = np.array([log.stamp[one] for one in known.tolist()])
    for place in np.flatnonzero(np.diff(at) <= 0.0)[:1]:
        raise MeasuredError(
            f"line {log.line[int(known[place + 1])]}: the times in brackets do not go up with icmp_seq: of which log are they?"
        )
    pace = (at[-1] - at[0]) / (known[-1] - known[0]) if len(known) > 1 else 1.0
    time = np.interp(numbers, known, at)
    time = time + np.minimum(numbers - known[0], 0) * pace + np.maximum(numbers - known[-1], 0) * pace
    return np.asarray(time - time[0])
