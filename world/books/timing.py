"""How the processes of a run in real time kept their time, written down while it flies: a row for each process and tick."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from netem.core import arrow
from netem.core.arrow import Stream
from netem.processes import system_errors
from world.books.kept import Kept

FILE = "timing.arrows"  # in a run directory
SCHEMA = pa.schema(
    [
        ("tick", pa.int32()),
        ("process", pa.dictionary(pa.int32(), pa.string())),
        ("late_s", pa.float64()),
        ("missed", pa.int32()),
    ]
)


class TimingWriter:
    """Writes it down.

    Parameters
    ----------
    out
        The run directory.

    Raises
    ------
    OSError
        By all its methods: when something cannot be written.
    """

    def __init__(self, out: Path) -> None:
        self._path = out / FILE
        self._names: dict[str, int] = {}
        with system_errors.about(self._path):
            self._stream = Stream(self._path, SCHEMA)

    def close(self) -> None:
        """End the file."""
        with system_errors.about(self._path):
            self._stream.close()

    def write(self, kept: Sequence[Kept]) -> None:
        """More of it."""
        if not kept:
            return
        tick, process, late, missed = zip(*kept, strict=True)
        for name in process:
            self._names.setdefault(name, len(self._names))
        places = pa.array([self._names[name] for name in process], pa.int32())
        names = pa.DictionaryArray.from_arrays(places, pa.array(list(self._names)))
        with system_errors.about(self._path):
            self._stream.write(
                {"tick": np.array(tick), "process": names, "late_s": np.array(late), "missed": np.array(missed)}
            )


def read(path: Path) -> Any:
    """All of it as a pyarrow table, as far as it was written.

    Raises
    ------
    arrow.TableError
        When there is none.
    """
    return arrow.read(path, SCHEMA)
