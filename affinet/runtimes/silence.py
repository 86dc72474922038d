"""Slow or stalled: who holds a swarm up, and whether it still works. Everything here is pure; `supervision.py` looks.

Nothing is judged while anything moves. Where nothing has moved for as long as the run is patient, those are looked at for
whom, in the end, everybody waits. They hold it up if they are stopped, or sleep; one that computes, or wants the processor or
a disk, works. The agents' code is the user's: they may compute for as long as the run is patient, in seconds of processor time.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import NamedTuple

import psutil

from affinet.runtimes.told import Beat
from netem.processes.supervised import LAUNCHER
from netem.wire.session import HUB, WORLD

_STOPPED = frozenset({psutil.STATUS_STOPPED, psutil.STATUS_TRACING_STOP})
_WORKING = frozenset({psutil.STATUS_RUNNING, psutil.STATUS_DISK_SLEEP, psutil.STATUS_WAKING})
_LETTER = {
    psutil.STATUS_STOPPED: "T",
    psutil.STATUS_TRACING_STOP: "t",
    psutil.STATUS_RUNNING: "R",
    psutil.STATUS_DISK_SLEEP: "D",
    psutil.STATUS_SLEEPING: "S",
    psutil.STATUS_ZOMBIE: "Z",
}
_IDLE_S = 0.02  # of processor time, between two looks: a beat takes less


class ProcessStatus(NamedTuple):
    """A process as the system sees it: its status, in psutil's words, and the processor time it has used, in seconds."""

    status: str
    used_s: float

    @property
    def stopped(self) -> bool:
        """Whether somebody has stopped it."""
        return self.status in _STOPPED

    def __str__(self) -> str:
        letter = _LETTER.get(self.status, self.status)
        if self.stopped:
            return f"is stopped (state {letter})"
        return f"{'computes' if self.status in _WORKING else 'sleeps'} (state {letter})"


class StatusHistory(NamedTuple):
    """The first time it was looked at since something moved, the last time but one, and the last time."""

    first: ProcessStatus
    before: ProcessStatus
    now: ProcessStatus

    def then(self, now: ProcessStatus) -> StatusHistory:
        """The same, after another look."""
        return StatusHistory(self.first, self.now, now)

    def stalled(self, patience_s: float, *, trusted: bool) -> bool:
        """Whether it does nothing; or, unless what it runs is `trusted` to end, computes for too long."""
        if self.now.stopped:
            return True
        works = self.now.status in _WORKING or self.now.used_s - self.before.used_s > _IDLE_S
        return not works or (not trusted and self.now.used_s - self.first.used_s >= patience_s)


def holding_up(beats: Mapping[str, Beat | None], awaited: Collection[str]) -> list[str]:
    """Those for whom everybody waits, and who wait for nobody.

    Parameters
    ----------
    beats
        What every process does, by name; None where it does not say, or has not lately.
    awaited
        Those whom the launcher waits for.
    """
    medium = beats.get(HUB)
    # While broadcasts are missing nobody owes an act yet.
    collects = medium is not None and not {WORLD, LAUNCHER}.issuperset(medium.waits)
    ahead = [HUB] if collects else list(awaited)
    seen, ends = set(ahead), []
    while ahead:
        name = ahead.pop()
        beat = beats[name]
        if beat is None or not beat.waits:
            ends.append(name)
            continue
        others = [other for other in beat.waits if other in beats and other not in seen]
        seen.update(others)
        ahead += others
    return sorted(ends)


def stalled(looks: Mapping[str, StatusHistory], patience_s: float, trusted: Collection[str]) -> list[str]:
    """Of those who hold everybody up, the ones to blame; nobody as long as one of them works."""
    if stopped := [name for name, look in looks.items() if look.now.stopped]:
        return stopped
    lazy = [name for name, look in looks.items() if look.stalled(patience_s, trusted=name in trusted)]
    busy = [name for name in looks if name not in lazy]
    return [] if busy else lazy
