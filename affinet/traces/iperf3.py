"""The JSON of `iperf3 --json`: what passed in each interval."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from affinet.traces.link_data import LinkData, Quantity, Steps, steps
from netem.impairments.measured import Lines, MeasuredError


def recognised(lines: Lines) -> bool:
    """Whether it is such a file."""
    return bool(lines.texts) and lines.texts[0].lstrip().startswith("{") and any("intervals" in t for t in lines.texts)


def read(lines: Lines) -> LinkData:
    """What a test says.

    Raises
    ------
    MeasuredError
        When it is none, or failed.
    """
    said = _parsed(lines)
    if "error" in said:
        raise MeasuredError(f"the test failed: iperf3 says {said['error']!r}: run it again")
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
    connected = said.get("start", {}).get("connected") or [{}]
    ends = connected[0] if isinstance(connected[0], dict) else {}
    last = sums[-1]
    return LinkData(
        nodes=(str(ends.get("local_host", "here")), str(ends.get("remote_host", "there"))),
        ends=last[1] + _number(last[2], "seconds", last[0]),
        steps=held,
        one_link=True,
        offered=True,
        assumed=tuple(assumed),
    )


def _parsed(lines: Lines) -> dict[str, Any]:
    try:
        said = json.loads("\n".join(lines.texts))
    except (json.JSONDecodeError, RecursionError) as error:
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
        begins = _number(total, "start", place)
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


def _tells_losses(intervals: Any) -> bool:
    return isinstance(intervals, list) and any(
        isinstance(one, dict) and "lost_packets" in (one.get("sum") or {}) for one in intervals
    )


def _availability(sums: list[tuple[int, float, dict[str, Any]]]) -> Steps:
    rows = []
    for place, begins, total in sums:
        sent, lost = _number(total, "packets", place), _number(total, "lost_packets", place, least=-np.inf)
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
        streams = one.get("streams") if isinstance(one, dict) else None
        first = streams[0] if isinstance(streams, list) and streams and isinstance(streams[0], dict) else {}
        if "rtt" in first and not first.get("omitted"):
            rows.append((0, _number(first, "start", place), 0, 1, _number(first, "rtt", place) / 2e6))
    if not rows:
        return None
    held = steps(rows)
    return held._replace(time=held.time - held.time[0])


def _number(total: dict[str, Any], name: str, place: int, least: float = 0.0) -> float:
    value = total.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= float(value) < np.inf:
        raise MeasuredError(
            f"intervals.{place}.sum.{name}: a number is due, got {value!r}: take the JSON as it was written"
        )
    return float(value)
