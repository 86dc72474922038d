"""What all layers of a recording share: its two timelines, its space, and how much is logged there at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from analysis.models.arrays import Array, Mask
from analysis.models.elementary import cos, sin
from netem.faults.conditions import Conditions
from netem.faults.timeline import Timeline
from world.books.history import Moments
from world.books.realised import Realised
from world.physics.world import World

TIMELINE, TICKS = "sim_time", "tick"
# Recordings hold single floats, which tell millimetres apart up to this distance from their origin, in metres.
_FAR = 1000.0
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)
Colours = NDArray[np.uint32]
Times = Sequence[rr.TimeColumn]


@dataclass(frozen=True)
class Stretch:
    """Consecutive ticks of a run, and what is shown of those that are recorded.

    Parameters
    ----------
    moments, timeline
        All that happened in the ticks, and what was imposed.
    realised
        The graph that worked in the ticks that are recorded.
    ticks, kept
        The ticks that are recorded, and where they are among all.
    time
        The same as columns of the recording.
    position, target
        Where agents were and should have been, shape (T, N, D), in metres from the origin of the recording.
    conditions, present
        What was imposed in each recorded tick, and who took part, shape (T, N).
    """

    moments: Moments
    timeline: Timeline
    realised: Realised
    ticks: list[int]
    kept: slice
    time: Times
    position: Array
    target: Array
    conditions: list[Conditions]
    present: Mask


class Layer(Protocol):
    """One thing that a recording shows."""

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""


class Stage:
    """Where layers log.

    Parameters
    ----------
    stream
        The recording.
    world
        What is flown.
    """

    def __init__(self, stream: rr.RecordingStream, world: World) -> None:
        self.stream, self._dt = stream, world.dt
        self.origin = _origin(world)
        self.reach = float(np.ptp(world.formation.nominal, axis=0).max())

    def times(self, ticks: Sequence[int]) -> Times:
        """Ticks on both timelines: in simulated seconds, and by their numbers, which checkers and journals name."""
        return [
            rr.TimeColumn(TIMELINE, duration=[tick * self._dt for tick in ticks]),
            rr.TimeColumn(TICKS, sequence=list(ticks)),
        ]

    def still(self, path: str, what: Any) -> None:
        """Log what does not change."""
        self.stream.log(path, what, static=True)

    def points(self, path: str, time: Times, positions: Array, colours: Colours | None = None) -> None:
        """Log points (T, n, D)."""
        given = spatial(positions).reshape(-1, 3)
        columns = rr.Points3D.columns(positions=given, colors=None if colours is None else colours.ravel())
        self.stream.send_columns(path, time, columns.partition([positions.shape[1]] * len(positions)))

    def segments(self, path: str, time: Times, ends: Array, colours: Colours | None = None) -> None:
        """Log segments (T, n, 2, 3)."""
        moments, number = ends.shape[:2]
        columns = rr.LineStrips3D.columns(
            strips=ends.reshape(-1, 2, 3), colors=None if colours is None else colours.ravel()
        )
        self.stream.send_columns(path, time, columns.partition([number] * moments))

    def arrows(self, path: str, time: Times, origins: Array, vectors: Array) -> None:
        """Log arrows (T, n, D) from points (T, n, D)."""
        columns = rr.Arrows3D.columns(vectors=spatial(vectors).reshape(-1, 3), origins=spatial(origins).reshape(-1, 3))
        self.stream.send_columns(path, time, columns.partition([origins.shape[1]] * len(origins)))

    def scalars(self, path: str, time: Times, values: Array) -> None:
        """Log numbers (T, n)."""
        columns = rr.Scalars.columns(scalars=values.ravel())
        self.stream.send_columns(path, time, columns.partition([values.shape[1]] * len(values)))


def _origin(world: World) -> Array:
    """The origin of a recording, shape (D,), in metres: that of space, unless the swarm begins far from it."""
    begins = world.target(0)[0] if world.start == "targets" else np.zeros(world.formation.dimension)
    rounded: Array = _FAR * np.trunc(begins / _FAR)
    return rounded


def spatial(position: Array) -> Array:
    """Points (..., D) as points (..., 3); a plane is seen from above."""
    missing = 3 - position.shape[-1]
    return np.pad(position, [(0, 0)] * (position.ndim - 1) + [(0, missing)])


def ellipses(centre: Array, covariance: Array, deviations: float) -> Array:
    """Where so many standard deviations lie: closed lines (..., C, 25, 3) about centres (..., D), with covariances (..., D, D).

    C is 1 in two dimensions; in three, one line in each plane of two principal axes.
    """
    values, vectors = np.linalg.eigh(covariance)
    axes = deviations * vectors * np.sqrt(np.maximum(values, 0.0))[..., None, :]
    first, second = np.triu_indices(centre.shape[-1], 1)
    lines = axes[..., first][..., None] * cos(_CIRCLE) + axes[..., second][..., None] * sin(_CIRCLE)
    return spatial(centre[..., None, None, :] + np.moveaxis(lines, -3, -1))
