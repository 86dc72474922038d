"""Where a graph breaks: its bridges, its cut vertices and its smallest cut.

Agents are numbered from 1; graphs are undirected and connected.

SciPy's graphs are imported where they are asked: that takes a third of a second, and few scenarios name a cut.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.models.arrays import Mask
from analysis.models.graph import reached

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Edge = tuple[int, int]


def bridges(agents: int, edges: Sequence[Edge]) -> list[Edge]:
    """Edges whose loss alone disconnects the graph."""
    return [edge for edge in edges if _parts(agents, [other for other in edges if other != edge]) > 1]


def cut_vertices(agents: int, edges: Sequence[Edge]) -> list[int]:
    """Agents whose loss alone disconnects the others."""
    # An agent without edges is a part of its own.
    return [
        agent for agent in range(1, agents + 1) if _parts(agents, [edge for edge in edges if agent not in edge]) > 2
    ]


def smallest_cut(agents: int, edges: Sequence[Edge]) -> Mask:
    """One side of a smallest set of edges that separates the graph, shape (N,): by maximum flows from agent 1."""
    from scipy.sparse.csgraph import maximum_flow

    graph = _matrix(agents, edges)
    flows = [maximum_flow(graph, 0, sink) for sink in range(1, agents)]
    least = min(range(len(flows)), key=lambda n: flows[n].flow_value)
    residual: Mask = (graph - flows[least].flow).toarray() > 0
    side: Mask = reached(residual)[0]
    return side


def _parts(agents: int, edges: Sequence[Edge]) -> int:
    from scipy.sparse.csgraph import connected_components

    number: int = connected_components(_matrix(agents, edges), directed=False)[0]
    return number


def _matrix(agents: int, edges: Sequence[Edge]) -> csr_array:
    from scipy.sparse import csr_array

    matrix = np.zeros((agents, agents), dtype=np.int32)
    for i, j in edges:
        matrix[i - 1, j - 1] = matrix[j - 1, i - 1] = 1
    return csr_array(matrix)
