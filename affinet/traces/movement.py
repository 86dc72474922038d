"""How far nodes that move are from each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from affinet.traces.link_data import Steps, Waypoints
from analysis.models.arrays import Array


def position(path: Waypoints, time: Array) -> Array:
    """Where a node is at times (T,), shape (T, D): straight between its waypoints, at rest before and after."""
    return np.stack([np.interp(time, path.time, axis) for axis in path.position.T], axis=-1)


def distance(one: Waypoints, other: Waypoints, time: Array) -> Array:
    """How far two nodes are apart at times (T,), in metres, shape (T,)."""
    apart = position(one, time) - position(other, time)
    far: Array = np.sqrt((apart * apart).sum(axis=-1))
    return far


def between_all(paths: Sequence[Waypoints], time: Array) -> Steps:
    """How far all nodes are from each other at times (T,), both ways."""
    pairs = [(one, other) for one in range(len(paths)) for other in range(len(paths)) if one != other]
    far = [distance(paths[one], paths[other], time) for one, other in pairs]
    src, dst = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    return Steps(
        np.zeros(len(pairs) * len(time), dtype=np.int64),
        np.tile(time, len(pairs)),
        np.repeat(src, len(time)),
        np.repeat(dst, len(time)),
        np.concatenate([*far, np.empty(0)]),
    )
