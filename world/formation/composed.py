"""The stress of a large formation, composed of its cliques.

A clique K of m nodes that span carries the stress of all its pairs that is the projection onto what is not affine on it,
I - A (A^T A)^-1 A^T with A = [P_K 1]: positive semidefinite of rank m - D - 1. Their sum is positive semidefinite, and is
zero for nothing but what is affine on every clique. Two cliques with D + 1 nodes in common that span share one affine map.
Where all hang together so, the sum has nullity D + 1, and the framework is universally rigid (paper 004, theorem 3.2). That
is sufficient, not necessary; what decides is the sum's own nullity.
"""

from __future__ import annotations

from itertools import groupby
from math import floor, log10

import numpy as np
from scipy import sparse

from analysis.models.arrays import Array, Integers
from netem.core.listing import listed
from world.formation import spectrum
from world.formation.cliques import affine_basis, cliques
from world.formation.leading import corners
from world.formation.nominal import Formation, NotRigid

_SINGULAR = 1e-9  # of the largest eigenvalue: what no leaders hold
_DIGITS = 3
ROUNDS = 3  # of evening out: more bring little (docs/decisions/0025)


def compose(formation: Formation) -> Array:
    """Edge weights, shape (M,), of the sum of the stresses of the cliques, of largest eigenvalue 1 or just less.

    Raises
    ------
    NotRigid
        When an agent is in no clique that carries a stress, or the cliques do not hold together: the sum has a nullity above
        D + 1.
    """
    L = summed(formation)
    if alone := (np.flatnonzero(L.diagonal() == 0.0) + 1).tolist():
        least = formation.dimension + 2
        raise NotRigid(f"agents {listed(alone)} are in no clique of {least} or more that spans")
    top = spectrum.largest(L)
    held = corners(formation.nominal)
    followers = np.setdiff1d(np.arange(formation.agents), held)
    if spectrum.slowest(L[followers][:, followers], top)[0] < _SINGULAR * top:
        least = formation.dimension + 1
        raise NotRigid(f"its cliques do not hold together: the sum of their stresses has a nullity above {least}")
    i, j = formation.ends.T
    weights: Array = -np.asarray(L[i, j]).ravel() / _rounded_up(top)
    return weights


def summed(formation: Formation, rounds: int = ROUNDS) -> sparse.csr_array:
    """The sum of the stresses of the cliques, shape (N, N), at its own scale.

    Parameters
    ----------
    formation
        Its nodes and edges.
    rounds
        How often the shares of the cliques are evened out.
    """
    alike = [_carried(formation.nominal, np.stack(list(same))) for _, same in groupby(_sizable(formation), key=len)]
    groups = [(pieces, stress) for pieces, stress in alike if len(pieces)]
    size = (formation.agents, formation.agents)
    if not groups:
        return sparse.csr_array(size)
    shares = _evened(formation.agents, groups, rounds)
    rows = [np.repeat(pieces, pieces.shape[1], axis=1).ravel() for pieces, _ in groups]
    columns = [np.tile(pieces, (1, pieces.shape[1])).ravel() for pieces, _ in groups]
    values = [(share[:, None, None] * stress).ravel() for share, (_, stress) in zip(shares, groups, strict=True)]
    return sparse.csr_array((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=size)


def _sizable(formation: Formation) -> list[Integers]:
    """The cliques of which each may carry a stress, by their size."""
    return sorted((clique for clique in cliques(formation) if len(clique) > formation.dimension + 1), key=len)


def _carried(nominal: Array, pieces: Integers) -> tuple[Integers, Array]:
    """Those of the pieces (K, m) that span, and the stress of each, shape (K, m, m)."""
    basis, spans = affine_basis(nominal[pieces])
    stress = np.broadcast_to(np.eye(pieces.shape[1]), (len(pieces), pieces.shape[1], pieces.shape[1]))
    for function in np.moveaxis(basis, -2, 0):
        stress = stress - function[:, :, None] * function[:, None, :]
    return pieces[spans], stress[spans]


def _evened(agents: int, groups: list[tuple[Integers, Array]], rounds: int) -> list[Array]:
    """A share (K,) of each piece, less where many overlap: else those would set the largest eigenvalue, and the rim be slow."""
    rows = np.concatenate([pieces.ravel() for pieces, _ in groups])
    own = [np.einsum("kii->ki", stress) for _, stress in groups]
    shares = [np.ones(len(pieces)) for pieces, _ in groups]
    for _ in range(rounds):
        parts = [(share[:, None] * weight).ravel() for share, weight in zip(shares, own, strict=True)]
        degree = np.bincount(rows, weights=np.concatenate(parts), minlength=agents)
        shares = [
            share * pieces.shape[1] / degree[pieces].sum(axis=1)
            for share, (pieces, _) in zip(shares, groups, strict=True)
        ]
    return shares


def _rounded_up(value: float) -> float:
    """To three digits: the last bits of an eigenvalue depend on the machine, those of the weights do not."""
    unit = float(f"1e{floor(log10(value)) - _DIGITS + 1}")
    return float(np.ceil(value / unit)) * unit
