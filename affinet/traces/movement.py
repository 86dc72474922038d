"""How far nodes that move are from each other."""

from __future__ import annotations

import numpy as np

from affinet.traces.link_data import Waypoints
from analysis.models.arrays import Array


def position(path: Waypoints, time: Array) -> Array:
    """Where a node is at times (T,), shape (T, D): straight between its waypoints, at rest before and after."""
    return np.stack([np.interp(time, path.time, axis) for axis in path.position.T], axis=-1)


def distance(one: Waypoints, other: Waypoints, time: Array) -> Array:
    """How far two nodes are apart at times (T,), in metres, shape (T,)."""
    apart = position(one, time) - position(other, time)
    far: Array = np.sqrt((apart * apart).sum(axis=-1))
    return far
