"""Localization on random graphs: agents anywhere in a square, who measure those nearby (paper 003, section VII)."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import pdist, squareform

from analysis.models import jacobi
from analysis.models.arrays import Array
from analysis.models.jacobi import EdgeInformation
from analysis.models.sensor import Sensor

_SIDE, _REACH = 10.0, 4.0  # m
_SENSOR = Sensor("line-of-sight", np.diag([0.15**2, 0.1**2]))


def edges(seed: int, agents: int) -> EdgeInformation:
    """What agents know of each other, anywhere in the square: of those within reach, and of enough others to join all.

    Parameters
    ----------
    seed
        Of this graph alone.
    agents
        How many.
    """
    rng = np.random.default_rng(seed)
    position = _SIDE * rng.random((agents, 2))
    distance = squareform(pdist(position))
    tree = minimum_spanning_tree(distance).toarray() > 0.0
    near = (distance < _REACH) & (rng.random(distance.shape) < 0.5)
    measured = np.triu(near | near.T, 1) | tree
    relative = position[:, None] - position[None]
    said = _SENSOR.measured(relative, rng.normal(size=relative.shape) * np.sqrt(np.diagonal(_SENSOR.covariance)))
    spread = np.where(measured[..., None, None], _SENSOR.spread(said), np.eye(2))
    return jacobi.together(said, np.where(measured[..., None, None], np.linalg.inv(spread), 0.0))


@cache  # a study judges them, and draws them
def rates(number: int, agents: int, h: float) -> Array:
    """Convergence rates with the weighted centroid and with agent 1 as the anchor, on so many graphs, shape (number, 2)."""
    found = [jacobi.rates(edges(seed, agents), h, anchor=0) for seed in range(number)]
    return np.array(found, dtype=np.float64)
