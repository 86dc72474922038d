"""Nominal positions of large formations: a piece of a lattice, or nodes strewn at random."""

from __future__ import annotations

from itertools import product
from math import ceil

import numpy as np

from analysis.models.arrays import Array
from analysis.models.elementary import power
from netem.core.draws import Purpose, uniform

KINDS = ("grid", "random")

# Of nodes strewn one to a unit of volume: far below where no more fit (Feder 1980: .55 of the plane, .38 of space).
_CLOSEST = 0.7
_DIGITS = 3
_AHEAD = 256  # draws at a time


def grid(agents: int, dimension: int) -> Array:
    """The nodes of the unit lattice that lie closest to the origin, shape (N, D), in metres; of those as far by coordinates."""
    side = ceil(float(power(agents, 1.0 / dimension)))  # the ball of this radius has more
    nodes = np.array(list(product(range(-side, side + 1), repeat=dimension)), dtype=np.float64)
    far = (nodes * nodes).sum(axis=-1)
    return nodes[np.lexsort([*nodes.T[::-1], far])[:agents]]


def strewn(agents: int, dimension: int, seed: int) -> Array:
    """Nodes at random, one to a cubic metre (square metre), none closer than .7 m to another, shape (N, D), in metres.

    Parameters
    ----------
    agents, dimension
        N and D.
    seed
        What the draws are a function of.
    """
    side = float(power(agents, 1.0 / dimension))
    nodes, tried = np.empty((0, dimension)), 0
    while True:
        draws = uniform(seed, Purpose.LAYOUT, tick=np.arange(tried, tried + _AHEAD), lanes=dimension)
        for node in np.round(side * (draws - 0.5), _DIGITS):
            apart = nodes - node
            if ((apart * apart).sum(axis=-1) >= _CLOSEST * _CLOSEST).all():
                nodes = np.vstack([nodes, node])
                if len(nodes) == agents:
                    return nodes
        tried += _AHEAD
