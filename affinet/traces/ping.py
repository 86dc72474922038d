"""The output of ping, of iputils, BusyBox, macOS or Windows: round trips, one by one."""

from __future__ import annotations

from affinet.traces import ping_log, ping_unix, ping_windows
from affinet.traces.link_data import LinkData
from netem.impairments.measured import Lines


def recognised(lines: Lines) -> bool:
    """Whether it is such a file, in whatever language."""
    return ping_unix.recognised(lines) or ping_windows.recognised(lines)


def read(lines: Lines) -> LinkData:
    """What a log says.

    Raises
    ------
    MeasuredError
        When it is none.
    """
    of_windows = ping_windows.recognised(lines) and not ping_unix.recognised(lines)
    return ping_log.link_data(ping_windows.read(lines) if of_windows else ping_unix.read(lines))
