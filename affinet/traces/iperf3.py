"""The JSON of `iperf3 --json`: what passed in each interval."""

from __future__ import annotations

import json
import re
from typing import Any

from affinet.traces.fields import FASTEST, LATEST
from affinet.traces.link_data import LinkData, Quantity, Steps, steps
from netem.impairments.measured import LONGEST, Lines, MeasuredError, shown

_HEADING = re.compile(r"^(?:\[ *ID\]\s+Interval|Connecting to host |Server listening on )")
_LOOKED_AT = 20


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return bool(lines.texts) and (lines.texts[0].lstrip().startswith("{") or _spoken(lines) is not None)


def read(lines: Lines) -> LinkData:
    """What a test says.

    Raises
    ------
    MeasuredError
        When it is none, or failed.
    """
    if (line := _spoken(lines)) is not None:
        raise MeasuredError(f"line {line}: what iperf3 says to people, and rounds: write it by iperf3 --json")
    said = _parsed(lines)
    if "error" in said:
        raise MeasuredError(f"the test failed: iperf3 says {shown(str(said['error']))}: run it again")
    sums, assumed = _intervals(said)
    rate = [(0, begins, 0, 1, _number(one, "bits_per_second", place)) for place, begins, one in sums]
    held = {Quantity.RATE: steps(rate)}
    told = [(place, begins, one) for place, begins, one in sums if "lost_packets" in one]
    if told:
        held[Quantity.AVAILABILITY] = _availability(told)
    if (trips := _round_trips(said)) is not None:
        held[Quantity.DELAY] = trips
        assumed.append("the rtt of TCP is a round trip: half of it is taken as the delay one way, with all that queued")
    if not told:
        assumed.append(
            "it says nothing of losses: test with UDP (-u), and take the receiver's JSON or --get-server-output"
        )
    assumed.append("the rate is what passed, and no more than what was offered: the link may carry more")
    ends = _first(_table(said.get("start")).get("connected"))
    last = sums[-1]
    return LinkData(
        nodes=(str(ends.get("local_host", "here")), str(ends.get("remote_host", "there"))),
        ends=last[1] + _number(last[2], "seconds", last[0], most=LATEST),
        steps=held,
        one_link=True,
        offered=True,
        assumed=tuple(assumed),
    )


def _spoken(lines: Lines) -> int | None:
    """The line of a heading that is not of its JSON."""
    for line, text in zip(lines.numbers[:_LOOKED_AT], lines.texts[:_LOOKED_AT], strict=True):
        if _HEADING.match(text):
            return line
    return None


def _parsed(lines: Lines) -> dict[str, Any]:
    try:
        said = json.loads("\n".join(lines.texts))
    except (ValueError, RecursionError) as error:  # ValueError: of whole numbers without end, too
        at = min(getattr(error, "lineno", 1), len(lines.numbers) or 1)
        line = lines.numbers[at - 1] if lines.numbers else 1
        raise MeasuredError(
            f"line {line}: no JSON: {getattr(error, 'msg', error)}; write it by iperf3 --json"
        ) from error
    if not isinstance(said, dict):
        raise MeasuredError("line 1: iperf3 --json writes one object, and this is none")
    return said


def _intervals(said: dict[str, Any]) -> tuple[list[tuple[int, float, dict[str, Any]]], list[str]]:
    """Number, time and sum of each interval that counts, and what is taken to be so."""
    assumed: list[str] = []
    server = said.get("server_output_json")
    own = said.get("intervals")
    if isinstance(server, dict) and not _tells_losses(own) and _tells_losses(server.get("intervals")):
        own = server["intervals"]
    if not isinstance(own, list) or not own:
        raise MeasuredError("there is no interval in it: let iperf3 run for longer than one (-i)")
    sums: list[tuple[int, float, dict[str, Any]]] = []
    for place, one in enumerate(own, start=1):
        total = one.get("sum") if isinstance(one, dict) else None
        if not isinstance(total, dict):
            raise MeasuredError(f"intervals.{place}: it has no sum: take the JSON as iperf3 wrote it")
        begins = _number(total, "start", place, most=LATEST)
        if sums and begins <= sums[-1][1]:
            raise MeasuredError(f"intervals.{place}.sum.start: {begins:g} s comes before the interval before it")
        if not total.get("omitted"):
            sums.append((place, begins, total))
    if not sums:
        raise MeasuredError("all its intervals are omitted: let iperf3 run for longer than -O says")
    if len(sums) < len(own):
        assumed.append(f"{len(own) - len(sums)} intervals that iperf3 was told to omit are left out")
    first = sums[0][1]
    return [(place, begins - first, total) for place, begins, total in sums], assumed


def _table(said: Any) -> dict[str, Any]:
    return said if isinstance(said, dict) else {}


def _first(said: Any) -> dict[str, Any]:
    return _table(said[0]) if isinstance(said, list) and said else {}


def _tells_losses(intervals: Any) -> bool:
    return isinstance(intervals, list) and any("lost_packets" in _table(_table(one).get("sum")) for one in intervals)


def _availability(sums: list[tuple[int, float, dict[str, Any]]]) -> Steps:
    rows = []
    for place, begins, total in sums:
        sent, lost = _number(total, "packets", place), _number(total, "lost_packets", place, least=-FASTEST)
        if lost > sent:
            raise MeasuredError(f"intervals.{place}.sum: {lost:g} packets of {sent:g} are lost: one of them is wrong")
        if sent:  # below 0 where more came late than were lost
            rows.append((0, begins, 0, 1, 1.0 - max(lost, 0.0) / sent))
    if not rows:
        raise MeasuredError("no packet was sent in any interval: run the test again")
    return steps(rows)


def _round_trips(said: dict[str, Any]) -> Steps | None:
    """Half of the rtt of the first stream, in each interval that counts."""
    rows = []
    for place, one in enumerate(said["intervals"] if isinstance(said.get("intervals"), list) else [], start=1):
        first = _first(_table(one).get("streams"))
        if "rtt" in first and not first.get("omitted"):
            rows.append(
                (
                    0,
                    _number(first, "start", place, most=LATEST),
                    0,
                    1,
                    _number(first, "rtt", place, most=1e6 * LONGEST) / 2e6,
                )
            )
    if not rows:
        return None
    held = steps(rows)
    return held._replace(time=held.time - held.time[0])


def _number(total: dict[str, Any], name: str, place: int, least: float = 0.0, most: float = FASTEST) -> float:
    value = total.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
        raise MeasuredError(
            f"intervals.{place}.sum.{name}: a number is due, got {shown(str(value))}: take the JSON as it was written"
        )
    return float(value)
