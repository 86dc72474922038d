"""Everything that happened in a run, as arrays, and the digest that two equal runs share."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netem.links import Links, Mask
from netem.medium import FATE_OF, Fate, Fates
from netem.timeline import Timeline
from world.formation import Array


Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Moment:
    """What happened in one tick.

    Parameters
    ----------
    tick
        k.
    position, target
        Where the agents are and should be, shape (N, D), in metres.
    error
        Tracking error (15), in square metres.
    velocity
        Inputs, shape (N, D), in metres per second.
    estimate, known
        Estimated relative positions, shape (N, n, D), in metres, and where there are any, shape (N, n).
    psi
        Convergence indicators, shape (N,), NaN where undefined.
    fates
        Verdicts, shape (C, L).
    late
        Messages of earlier ticks delivered in this one: their link rows, shape (m,).
    dropped
        Fates of messages whose receiver went while they were under way, shape (d,).
    """

    tick: int
    position: Array
    target: Array
    error: float
    velocity: Array
    estimate: Array
    known: Mask
    psi: Array
    fates: Fates
    late: NDArray[np.int64]
    dropped: Fates


class History:
    """The moments of a run, gathered; arrays begin with the ticks."""

    def __init__(self, ticks: int, links: Links, channels: int, dimension: int) -> None:
        agents, width = links.agents, links.slots.shape[1]
        self.ticks = 0
        self.position = np.zeros((ticks + 1, agents, dimension))
        self.target = np.zeros((ticks, agents, dimension))
        self.error = np.full(ticks, np.nan)
        self.velocity = np.zeros((ticks, agents, dimension))
        self.estimate = np.zeros((ticks, agents, width, dimension))
        self.known = np.zeros((ticks, agents, width), dtype=bool)
        self.psi = np.full((ticks, agents), np.nan)
        self.fates = np.zeros((ticks, channels, len(links)), dtype=np.uint8)
        self.late = np.zeros(ticks, dtype=np.int64)
        self.dropped = np.zeros((ticks, len(Fate)), dtype=np.int64)

    def append(self, moment: Moment, next_position: Array) -> None:
        """Take in one tick, and where it led."""
        k = moment.tick
        self.position[k], self.position[k + 1] = moment.position, next_position
        self.target[k], self.error[k], self.velocity[k] = moment.target, moment.error, moment.velocity
        self.estimate[k], self.known[k], self.psi[k] = moment.estimate, moment.known, moment.psi
        self.fates[k] = moment.fates
        self.late[k], self.dropped[k] = len(moment.late), np.bincount(moment.dropped, minlength=len(Fate))
        self.ticks = k + 1

    def arrays(self) -> Arrays:
        """All arrays by name, up to the last tick."""
        k = self.ticks
        return {
            "position": self.position[: k + 1],
            "target": self.target[:k],
            "error": self.error[:k],
            "velocity": self.velocity[:k],
            "estimate": self.estimate[:k],
            "known": self.known[:k],
            "psi": self.psi[:k],
            "fates": self.fates[:k],
            "late": self.late[:k],
            "dropped": self.dropped[:k],
        }

    def save(self, path: Path) -> None:
        """Write the arrays to a NumPy archive."""
        np.savez(path, allow_pickle=False, **self.arrays())


def load(path: Path) -> Arrays:
    """The arrays of a run, by name.

    Raises
    ------
    FileNotFoundError
        When the run never wrote them.
    """
    with np.load(path, allow_pickle=False) as archive:
        return dict(archive)


def digest(arrays: Arrays) -> str:
    """SHA-256 over positions, inputs, estimates, indicators and verdicts, bit for bit."""
    total = hashlib.sha256()
    for name, array in sorted(arrays.items()):
        total.update(f"{name}{array.dtype.str}{array.shape}".encode())
        total.update(np.ascontiguousarray(array).tobytes())
    return total.hexdigest()


def bites(timeline: Timeline, fates: Fates) -> list[int]:
    """How many messages each fault held in the ticks flown, from verdicts (ticks, C, L): 0 means that it proved nothing."""
    counted = []
    for number, fault in enumerate(timeline.faults):
        verdicts = fates[fault.start : fault.end][:, :, timeline.held(number)]
        counted.append(int((verdicts == FATE_OF[fault.verb]).sum()))
    return counted
