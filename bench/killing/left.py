"""What a run has left that was killed, and how far each part of it goes."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import RrdReader

from affinet.scenario.sections import RecordSection
from netem.core import arrow
from netem.medium import deliveries, journal
from netem.medium.medium import JOURNAL
from world.books import history, timing
from world.recording.file import RECORDING
from world.recording.logbook import GRAPH, GRAPH_SCHEMA

ARRAYS = "arrays"
BOOK, DRAWN, SEEN = "journal", "graph", "recording"
KEPT, DELIVERED = "timing", "deliveries"
_EVERY = RecordSection().every
_ERROR = "/metrics/tracking_error"


class Unreadable(RuntimeError):
    """Something of it cannot be read: what, and why."""


def ticks(out: Path, *, was_ended: bool) -> dict[str, int]:
    """By what it left, how many ticks there are of it; nothing of what it had not begun.

    Parameters
    ----------
    out
        The run directory.
    was_ended
        Whether somebody was alive to end the recording: one that was not is read with a warning.

    Raises
    ------
    Unreadable
        When it has begun something that cannot be read.
    """
    begun = {what: (reads, out / file) for what, (file, reads) in _LEFT.items() if _has_begun(out / file)}
    with warnings.catch_warnings():
        warnings.simplefilter("error" if was_ended else "ignore")
        return {what: _read(what, reads, path) for what, (reads, path) in begun.items()}


def _read(what: str, reads: Callable[[Path], int], path: Path) -> int:
    try:
        return reads(path)
    except (journal.JournalError, arrow.TableError, history.Damaged, RuntimeError, ValueError, Warning) as error:
        raise Unreadable(f"{what}: {error}") from error


def _has_begun(path: Path) -> bool:
    return path.exists() and path.stat().st_size > 0


def _journal(path: Path) -> int:
    return _last(journal.read(path)) + 1


def _arrays(path: Path) -> int:
    return len(history.load(path)["error"])


def _graph(path: Path) -> int:
    return _last(arrow.read(path, GRAPH_SCHEMA)) + 1


def _recording(path: Path) -> int:
    chunks: Any = RrdReader(str(path)).stream().to_chunks()
    errors = (chunk for chunk in chunks if str(chunk.entity_path) == _ERROR)
    return _EVERY * sum(chunk.num_rows for chunk in errors if not chunk.is_static)


def _timing(path: Path) -> int:
    return _last(timing.read(path)) + 1


def _deliveries(path: Path) -> int:
    return _last(deliveries.read(path)) + 1


def _last(table: Any) -> int:
    return int(table["tick"].to_numpy().max(initial=-1))


def late_s(out: Path) -> float:
    """By how much ticks of the world began late at most, in seconds."""
    kept = timing.read(out / timing.FILE)
    of_world = np.array(kept["process"].to_pylist()) == "world"
    return float(kept["late_s"].to_numpy()[of_world].max(initial=0.0))


def too_short(ticks: Mapping[str, int], flown_s: float, late_s: float, dt_s: float) -> list[str]:
    """What is missing of a run in real time that was flown for so long, or ends more than a second before that.

    Parameters
    ----------
    ticks
        How many there are, by what it left.
    flown_s, late_s
        For how long it was flown by the clock, and how late it may have been, in seconds.
    dt_s
        A tick.
    """
    if missing := _LEFT.keys() - ticks.keys():
        return [f"it flew for {flown_s:.2f} s, and left no {', '.join(sorted(missing))}"]
    behind = {what: flown_s - dt_s * of_it for what, of_it in ticks.items()}
    return [
        f"it flew for {flown_s:.2f} s, {late_s:.2f} s late at most, and the {what} ends {seconds:.2f} s before that"
        for what, seconds in behind.items()
        if seconds > 1.0 + late_s
    ]


_LEFT: Mapping[str, tuple[str, Callable[[Path], int]]] = {
    BOOK: (JOURNAL, _journal),
    ARRAYS: (history.ARRAYS, _arrays),
    DRAWN: (GRAPH, _graph),
    SEEN: (RECORDING, _recording),
    KEPT: (timing.FILE, _timing),
    DELIVERED: (deliveries.FILE, _deliveries),
}
