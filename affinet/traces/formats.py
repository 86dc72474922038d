"""Formats of link data by name, and which of them a file has."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from affinet.traces import bonnmotion, contacts, emane, intervals, iperf3, mahimahi, one, ping, setdest, table
from affinet.traces.link_data import LinkData
from netem.impairments import measured
from netem.impairments.measured import Lines, MeasuredError, shown


class Format(NamedTuple):
    """A format.

    Parameters
    ----------
    says
        What it is, for people.
    recognised
        Whether lines are of it.
    read
        What they say.
    """

    says: str
    recognised: Callable[[Lines], bool]
    read: Callable[[Lines], LinkData]


FORMATS: Mapping[str, Format] = {
    "table": Format("a table of time,src,dst and quantities", table.recognised, table.read),
    "ping": Format("the output of ping", ping.recognised, ping.read),
    "iperf3": Format("the output of iperf3 --json", iperf3.recognised, iperf3.read),
    "mahimahi": Format("a packet-delivery trace of mm-link", mahimahi.recognised, mahimahi.read),
    "one": Format("events of ONE", one.recognised, one.read),
    "contacts": Format("contacts: time one other up|down", contacts.recognised, contacts.read),
    "intervals": Format("contacts: one other begin end", intervals.recognised, intervals.read),
    "emane": Format("pathloss events of EMANE (EEL)", emane.recognised, emane.read),
    "setdest": Format("movements of ns-2", setdest.recognised, setdest.read),
    "bonnmotion": Format("movements of BonnMotion", bonnmotion.recognised, bonnmotion.read),
}


def read(file: Path, name: str | None) -> tuple[str, LinkData]:
    """The format of a file, and what it says.

    Parameters
    ----------
    file
        Where it is.
    name
        Of its format; None to find it by its content.

    Raises
    ------
    MeasuredError
        When it has no format that is known, or could have two, is wrong in its own, or tells of no link.
    OSError
        When it cannot be read.
    """
    lines = measured.read(file)
    chosen = name or _found(lines)
    data = FORMATS[chosen].read(lines)
    if data.paths and len(data.paths) < 2:
        raise MeasuredError(f"line {lines.numbers[0]}: one node in it, and no link: give the ways of two at least")
    return chosen, data


def _found(lines: Lines) -> str:
    found = [name for name, one in FORMATS.items() if lines.texts and one.recognised(lines)]
    if len(found) > 1:
        raise MeasuredError(_which(lines, found))
    if not found and lines.texts and "," not in lines.texts[0]:
        raise MeasuredError(
            f"line {lines.numbers[0]}: of no format that is known: {shown(lines.texts[0])}; say which, as its format, to "
            f"see what is wrong: {', '.join(FORMATS)}"
        )
    return found[0] if found else "table"  # which says what its columns must be


def _which(lines: Lines, found: Sequence[str]) -> str:
    """That nothing tells these formats apart, and what is wrong if it is of one."""
    wrong = ""
    for name in found:
        try:
            FORMATS[name].read(lines)
        except MeasuredError as error:
            wrong += f"; as {name} it is wrong in {error}"
    return f"it could be of format {' or '.join(found)}: say which, by --format or format = ...{wrong}"
