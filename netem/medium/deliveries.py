"""What a run in real time leaves of its deliveries: of each message, how long it was to be under way, and how long it was."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa

from netem.core import arrow
from netem.core.arrow import NAMES, Stream, named
from netem.core.links import Links
from netem.medium.parcels import Parcel
from netem.processes import system_errors

FILE = "deliveries.arrows"  # in a run directory
SCHEMA = pa.schema(
    [
        ("tick", pa.int32()),
        ("src", pa.int32()),
        ("dst", pa.int32()),
        ("channel", NAMES),
        ("content", pa.int32()),
        ("asked_s", pa.float32()),
        ("taken_s", pa.float32()),
    ]
)


class Deliveries:
    """Writes them down, in simulated seconds; what is booked is written when it is closed at the latest.

    Parameters
    ----------
    out
        The run directory.
    links, channels
        What rows of messages stand for.
    batch
        How many ticks are written at once.

    Raises
    ------
    OSError
        By all its methods: when something cannot be written.
    """

    def __init__(self, out: Path, links: Links, channels: Sequence[str], batch: int) -> None:
        self._path, self._links, self._channels, self._batch = out / FILE, links, list(channels), batch
        self._booked: list[tuple[int, int, int, int, float, float]] = []
        self._first = 0
        with system_errors.about(self._path):
            self._stream = Stream(self._path, SCHEMA)

    def __enter__(self) -> Deliveries:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with system_errors.about(self._path), system_errors.afterwards(self._write, self._stream.close):
            if error is not None:
                raise error

    def book(self, tick: int, parcels: Sequence[Parcel[Any]], now_s: float) -> None:
        """Messages that were delivered in a tick, by now."""
        self._booked += [
            (tick, parcel.link, parcel.channel, parcel.content, parcel.due_s - parcel.said_s, now_s - parcel.said_s)
            for parcel in parcels
        ]
        if tick >= self._first + self._batch:
            self._first = tick
            self._write()

    def _write(self) -> None:
        if not self._booked:
            return
        booked, self._booked = self._booked, []
        tick, link, channel, content, asked, taken = (np.array(column) for column in zip(*booked, strict=True))
        table = {
            "tick": tick,
            "src": self._links.src[link],
            "dst": self._links.dst[link],
            "channel": named(channel, self._channels),
            "content": content,
            "asked_s": asked,
            "taken_s": taken,
        }
        with system_errors.about(self._path):
            self._stream.write(table)


def read(path: Path) -> Any:
    """The deliveries as a pyarrow table, as far as they were written.

    Raises
    ------
    arrow.TableError
        When there are none.
    """
    return arrow.read(path, SCHEMA)
