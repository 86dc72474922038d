"""Everything that happened in a run, as arrays, and the digest that two equal runs share."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.metrics import tracking_error
from netem.links import Mask
from netem.medium import FATE_OF, Fate, Fates
from netem.timeline import Timeline
from world.formation import Array
from world.world import World

Arrays = dict[str, NDArray[Any]]


class Moment(NamedTuple):
    """What happened in one tick, as arrays or as the nested lists that came over the wire.

    Parameters
    ----------
    position, velocity
        Where the agents are, and their inputs, shape (N, D), in metres and metres per second.
    estimate, known
        Estimated relative positions, shape (N, n, D), in metres, and where there are any, shape (N, n).
    psi
        Convergence indicators, shape (N,), NaN where undefined.
    fates
        Verdicts, shape (C, L).
    late
        How many messages of earlier ticks were delivered in this one.
    dropped
        Fates of messages whose receiver went while they were under way, shape (d,).
    """

    position: Any
    velocity: Any
    estimate: Any
    known: Any
    psi: Any
    fates: Any
    late: int
    dropped: Any


@dataclass(frozen=True)
class Moments:
    """Consecutive ticks; every array begins with them. Messages that arrived late, or were dropped under way, are counted.

    Parameters
    ----------
    first
        The first tick.
    target
        Where the manoeuvre wants the agents, shape (T, N, D), in metres.
    error
        Tracking error (15), shape (T,), in square metres.
    late
        How many arrived late, shape (T,).
    dropped
        How many were dropped under way, by fate, shape (T, fates).
    """

    first: int
    position: Array
    velocity: Array
    estimate: Array
    known: Mask
    psi: Array
    fates: Fates
    late: NDArray[np.int64]
    dropped: NDArray[np.int64]
    target: Array
    error: Array

    @property
    def ticks(self) -> NDArray[np.int64]:
        """Their numbers, shape (T,)."""
        return np.arange(self.first, self.first + len(self.error))


def gather(world: World, timeline: Timeline, first: int, moments: Sequence[Moment]) -> Moments:
    """Consecutive moments as arrays, with what they are measured against."""
    position, velocity, estimate, known, psi, fates, late, dropped = zip(*moments, strict=True)
    ticks = np.arange(first, first + len(moments))
    where, target = np.array(position), world.target(ticks)
    present = np.array([~timeline.at(tick).absent for tick in ticks.tolist()])
    return Moments(
        first=first,
        position=where,
        velocity=np.array(velocity),
        estimate=np.array(estimate),
        known=np.array(known, dtype=bool),
        psi=np.array(psi),
        fates=np.array(fates, dtype=np.uint8),
        late=np.array(late),
        dropped=np.array([np.bincount(np.array(gone, dtype=np.int64), minlength=len(Fate)) for gone in dropped]),
        target=target,
        error=tracking_error(where, target, present),
    )


class History:
    """The moments of a run, gathered; arrays begin with the ticks."""

    def __init__(self, world: World, channels: int) -> None:
        links, ticks = world.links, world.ticks
        agents, width, dimension = links.agents, links.slots.shape[1], world.formation.dimension
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

    def extend(self, moments: Moments, next_position: Array) -> None:
        """Take in the next ticks, and where they led."""
        span = slice(self.ticks, self.ticks + len(moments.error))
        for name in (
            "position",
            "target",
            "error",
            "velocity",
            "estimate",
            "known",
            "psi",
            "fates",
            "late",
            "dropped",
        ):
            getattr(self, name)[span] = getattr(moments, name)
        self.position[span.stop] = next_position
        self.ticks = span.stop

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
        """Write the arrays to a NumPy archive, whole or not at all: the process may be ended while it writes."""
        unfinished = path.with_suffix(".unfinished.npz")
        np.savez(unfinished, allow_pickle=False, **self.arrays())
        unfinished.replace(path)


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
