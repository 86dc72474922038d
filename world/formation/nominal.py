"""Formations: nominal positions, nominal graph, leaders."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from analysis.models.arrays import Array, Integers, Mask

Edges = tuple[tuple[int, int], ...]


class NotRigid(ValueError):
    """No stress stabilises the framework."""


@dataclass(frozen=True)
class Formation:
    """A nominal framework (paper 000, section II).

    Parameters
    ----------
    nominal
        Nominal positions P, shape (N, D), in metres.
    edges
        Undirected edges between agents, numbered from 1.
    leaders
        Agents that follow the manoeuvre.
    weights
        Of its own: what i gives j and what j gives i over each edge i-j, shape (M, 2). None where they are solved for.
    """

    nominal: Array
    edges: Edges
    leaders: tuple[int, ...]
    weights: Array | None = None

    @property
    def agents(self) -> int:
        """N."""
        return len(self.nominal)

    @property
    def dimension(self) -> int:
        """D."""
        return self.nominal.shape[-1]

    @cached_property
    def is_leader(self) -> Mask:
        """Shape (N,)."""
        return np.isin(np.arange(1, self.agents + 1), self.leaders)

    @cached_property
    def ends(self) -> Integers:
        """The two agents of each edge, as rows of arrays, from 0, shape (M, 2)."""
        return np.array(self.edges, dtype=np.int64).reshape(-1, 2) - 1


def _edges(text: str) -> Edges:
    pairs = (pair.split("-") for pair in text.split())
    return tuple((int(i), int(j)) for i, j in pairs)


PRESETS: dict[str, Formation] = {
    # Graph 1 of paper 000.
    "zhao7": Formation(
        nominal=np.array([[2, 0], [1, 1], [1, -1], [0, 1], [0, -1], [-1, 1], [-1, -1]], dtype=np.float64),
        edges=_edges("1-2 1-3 1-4 1-5 2-4 2-7 3-5 3-6 4-5 4-6 5-7 6-7"),
        leaders=(1, 2, 3),
    ),
    # Graph 2 of paper 000, the hexagon of paper 004. With the stress solved here 10 of 110 admissible sets of leaders are
    # stable under undamped one-tick varying-velocity control; 2, 6, 8 has the smallest radius, .873 (4, 5, 7 diverges, 1.327).
    "hexa10": Formation(
        nominal=np.array(
            [[3, 0], [2, 2], [2, -2], [1, 0], [0, 2], [0, -2], [-1, 0], [-2, 2], [-2, -2], [-3, 0]],
            dtype=np.float64,
        ),
        edges=_edges(
            "1-2 1-3 1-4 1-5 1-6 2-3 2-4 2-5 2-7 3-4 3-6 3-7 4-5 4-6 4-7 4-8 4-9 5-6 5-7 5-8 5-10 6-7 6-9 6-10 7-8 7-9 7-10 "
            "8-9 8-10 9-10"
        ),
        leaders=(2, 6, 8),
    ),
    # An octahedron with its diagonals and a tetrahedron in it, in three dimensions. Its stress is well conditioned (.960 to
    # 1.067); 152 of 189 admissible sets of leaders are stable under one-tick varying-velocity control, this one at radius .648.
    "octa10": Formation(
        nominal=np.array(
            [
                *([2, 0, 0], [-2, 0, 0], [0, 2, 0], [0, -2, 0], [0, 0, 2], [0, 0, -2]),
                *([0.5, 0.5, 0.5], [0.5, -0.5, -0.5], [-0.5, 0.5, -0.5], [-0.5, -0.5, 0.5]),
            ],
            dtype=np.float64,
        ),
        edges=_edges(
            "1-2 3-4 5-6 1-3 1-4 1-5 1-6 2-3 2-4 2-5 2-6 3-5 3-6 4-5 4-6 1-7 3-7 5-7 1-8 4-8 6-8 2-9 3-9 6-9 2-10 4-10 5-10 "
            "7-8 7-9 7-10 8-9 8-10 9-10"
        ),
        leaders=(1, 3, 6, 10),
    ),
}
