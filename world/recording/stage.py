"""What all layers of a recording share: its timeline, and space."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.models.arrays import Array
from analysis.models.elementary import cos, sin
from world.physics.world import World

TIMELINE = "sim_time"
# Recordings hold single floats, which tell millimetres apart up to this distance from their origin, in metres.
_FAR = 1000.0
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 25)


def origin(world: World) -> Array:
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


def points(stream: rr.RecordingStream, path: str, time: list[rr.TimeColumn], positions: Array) -> None:
    """Log points (T, n, D) at times."""
    columns = rr.Points3D.columns(positions=spatial(positions).reshape(-1, 3))
    stream.send_columns(path, time, columns.partition([positions.shape[1]] * len(positions)))


def scalars(stream: rr.RecordingStream, path: str, time: list[rr.TimeColumn], values: Array) -> None:
    """Log numbers (T, n) at times."""
    columns = rr.Scalars.columns(scalars=values.ravel())
    stream.send_columns(path, time, columns.partition([values.shape[1]] * len(values)))
