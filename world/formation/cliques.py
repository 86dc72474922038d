"""Who sees whom within a range, and the cliques of such a graph: pieces that no motion but an affine one can bend."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from world.formation.nominal import Edges, Formation

_ROUNDING = 1e-9  # of a range: nodes that lie just within it do so on any machine
_FLAT = 1e-3  # of its extent: a piece that is thinner in some direction says too little about it


def within(nominal: Array, reach: float) -> Edges:
    """The pairs of nodes (N, D) that are no farther apart than a range in metres, numbered from 1."""
    far = np.zeros((len(nominal), len(nominal)))
    for coordinate in nominal.T:
        apart = coordinate[:, None] - coordinate
        far += apart * apart
    first, second = np.nonzero(np.triu(far <= reach * reach * (1.0 + _ROUNDING), k=1))
    return tuple(zip((first + 1).tolist(), (second + 1).tolist(), strict=True))


def cliques(formation: Formation) -> list[Integers]:
    """Of each edge the clique that grows from it by who is nearest to its middle, each once, as rows in ascending order."""
    neighbours: list[set[int]] = [set() for _ in range(formation.agents)]
    for i, j in formation.edges:
        neighbours[i - 1].add(j - 1)
        neighbours[j - 1].add(i - 1)
    grown = (_grown(formation.nominal, neighbours, i - 1, j - 1) for i, j in formation.edges)
    return [np.array(clique, dtype=np.int64) for clique in sorted(set(grown))]


def _grown(nominal: Array, neighbours: Sequence[set[int]], i: int, j: int) -> tuple[int, ...]:
    common = sorted(neighbours[i] & neighbours[j])
    apart = nominal[common] - 0.5 * (nominal[i] + nominal[j])
    clique = [i, j]
    for row in np.argsort((apart * apart).sum(axis=-1), kind="stable").tolist():
        if neighbours[common[row]].issuperset(clique):
            clique.append(common[row])
    return tuple(sorted(clique))


def affine_basis(nodes: Array) -> tuple[Array, Mask]:
    """An orthonormal basis of the affine functions on pieces of m nodes (..., m, D): (..., D + 1, m), and which pieces span.

    By Gram and Schmidt, twice, in sums and products only, so that its bits are those of any machine.
    """
    places = nodes.shape[-2]
    centred = nodes - nodes.sum(axis=-2, keepdims=True) / places
    extent = np.sqrt((centred * centred).sum(axis=(-2, -1)))
    basis = [np.full(nodes.shape[:-1], 1.0 / np.sqrt(places))]
    spans = extent > 0.0
    for direction in np.moveaxis(centred, -1, 0):
        rest = direction
        for _ in range(2):
            for known in basis:
                rest = rest - (known * rest).sum(axis=-1, keepdims=True) * known
        length = np.sqrt((rest * rest).sum(axis=-1))
        spans = spans & (length > _FLAT * extent)
        basis.append(rest / np.where(length > 0.0, length, 1.0)[..., None])
    return np.stack(basis, axis=-2), spans
