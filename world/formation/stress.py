"""Stress of a framework, and whether it stabilises the formation (paper 004, sections 3.3 and 3.4)."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache

import numpy as np
from scipy.linalg import null_space

from analysis.models.arrays import Array, Mask
from world.formation import composed
from world.formation.nominal import Edges, Formation, NotRigid

# The smallest nonzero eigenvalue of a stress of unit norm below which the solver cannot tell it from zero.
_RIGID = 1e-6
# Agents up to which the program alone is asked, which takes seconds then; and up to which it is where cliques do not hold
# together, which takes a minute. It grows with N^4 (docs/decisions/0025).
_PROGRAM_FIRST, _PROGRAM_AT_ALL = 40, 100
_ONE_AT_A_TIME = threading.Lock()  # filters of warnings are global: of two that overlap, one would never be undone


def incidence(agents: int, edges: Edges) -> Array:
    """Incidence matrix B of the undirected graph, shape (N, M): +1 where an edge leaves, -1 where it enters."""
    B = np.zeros((agents, len(edges)))
    for column, (i, j) in enumerate(edges):
        B[i - 1, column], B[j - 1, column] = 1.0, -1.0
    return B


def laplacian(formation: Formation, weights: Array) -> Array:
    """Stress matrix L = B diag(w) B^T, shape (N, N) (paper 004, eq. 3.4); off the diagonal L_ij = -l_ij."""
    B = incidence(formation.agents, formation.edges)
    return (B * weights) @ B.T


def own(formation: Formation, weights: Array) -> Array:
    """Stress matrix of weights that need not be alike both ways, shape (N, N): row i has what i gives its neighbours.

    Parameters
    ----------
    formation
        Whose.
    weights
        What i gives j and what j gives i over each edge i-j, shape (M, 2).
    """
    i, j = formation.ends.T
    L = np.zeros((formation.agents, formation.agents))
    L[i, j], L[j, i] = -weights.T
    L[np.diag_indices(formation.agents)] = -L.sum(axis=1)
    return L


def equilibrium(formation: Formation) -> Array:
    """Basis of the weights that balance every agent, shape (M, K): all w with B diag(w) B^T P = 0."""
    B = incidence(formation.agents, formation.edges)
    extent = B.T @ formation.nominal
    return null_space(np.concatenate([B * extent[:, d] for d in range(formation.dimension)]))


def solve(formation: Formation) -> Array:
    """Edge weights w, shape (M,), of the best-conditioned stabilising stress (paper 004, eq. 3.5); of large formations, of one.

    The semidefinite program maximises the smallest eigenvalue that an affine formation does not make zero. The paper bounds
    it by an arbitrary constant; here ||w|| <= 1 does, which also fixes the scale, so the answer is unique. The balance
    L P = 0 is not left to the solver: w is sought among the weights that keep it exactly. More than 40 agents get the sum of
    the stresses of their cliques (`composed`) instead, of largest eigenvalue 1, where that stabilises.

    Raises
    ------
    NotRigid
        When no stress is positive semidefinite of rank N - D - 1: the framework is not universally rigid (theorem 3.2). Or
        when its cliques do not hold together, and it is too large for the program.
    """
    weights, why = _solved(formation.nominal.tobytes(), formation.nominal.shape, formation.edges)
    if weights is None:
        raise NotRigid(why)
    return weights.copy()


@contextmanager
def _without_warnings() -> Iterator[None]:
    """What the modeller warns of, like an inaccurate solution or a solver it cannot import, is judged here, by the answer."""
    with _ONE_AT_A_TIME, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


@cache
def _solved(nominal: bytes, shape: tuple[int, int], edges: Edges) -> tuple[Array | None, str]:
    """The weights, or why there are none; a framework is solved once, however often it is planned."""
    formation = Formation(np.frombuffer(nominal).reshape(shape), edges, ())
    if formation.agents > _PROGRAM_FIRST:
        try:
            return composed.compose(formation), ""
        except NotRigid as error:
            if formation.agents > _PROGRAM_AT_ALL:
                return None, str(error)
    return _programmed(formation)


def _programmed(formation: Formation) -> tuple[Array | None, str]:
    basis = equilibrium(formation)
    affine = np.column_stack([formation.nominal, np.ones(formation.agents)])
    if np.linalg.matrix_rank(affine) <= formation.dimension:
        return None, f"the nodes do not span {formation.dimension} dimensions: they lie on a line or plane"
    Q = null_space(affine.T).T
    if not basis.shape[1] or not len(Q):
        return None, f"no stress but zero balances the framework{_too_few(formation)}"
    with _without_warnings():
        return _optimised(formation, basis, Q)


def _too_few(formation: Formation) -> str:
    """How many edges are missing at least, if they are too few for whatever nodes in general position.

    A framework that is to be universally rigid stays rigid without any one of its edges (Hendrickson).
    """
    agents, dimension, edges = formation.agents, formation.dimension, len(formation.edges)
    least = dimension * agents - dimension * (dimension + 1) // 2 + 1
    if agents < dimension + 2 or edges >= least:
        return ""
    return f"; {agents} nodes in general position need {least} edges at least, and it has {edges}"


def _optimised(formation: Formation, basis: Array, Q: Array) -> tuple[Array | None, str]:
    import cvxpy as cp  # takes seconds to import, and only planning needs it

    B = incidence(formation.agents, formation.edges)
    coordinates, least = cp.Variable(basis.shape[1]), cp.Variable()
    reduced = Q @ B @ cp.diag(basis @ coordinates) @ B.T @ Q.T
    reduced = (reduced + reduced.T) / 2
    problem = cp.Problem(cp.Maximize(least), [reduced >> least * np.eye(len(Q)), cp.norm(coordinates, 2) <= 1.0])
    try:
        problem.solve(solver=cp.CLARABEL)
    except cp.SolverError as error:
        return None, f"the solver found no stress that stabilises the framework: {error}"
    if problem.status not in (cp.OPTIMAL, cp.OPTIMAL_INACCURATE) or least.value < _RIGID:
        return None, (
            "the framework is not universally rigid: no stress is positive semidefinite of rank "
            f"N - D - 1 = {len(Q)} (solver: {problem.status}, smallest eigenvalue {least.value}){_too_few(formation)}"
        )
    weights: Array = basis @ coordinates.value
    return weights, ""


def stabilises(formation: Formation, up: Mask) -> Mask:
    """Whether the edges that are up (..., M) carry a stabilising stress, shape (...); solved once for each distinct set."""
    patterns, place = np.unique(up.reshape(-1, up.shape[-1]), axis=0, return_inverse=True)
    answers = np.array([_carries_stress(formation, pattern) for pattern in patterns], dtype=bool)
    return answers[place].reshape(up.shape[:-1])


def survives(formation: Formation, *, edge: tuple[int, int] | None = None, agent: int | None = None) -> bool:
    """Whether the framework still has a stabilising stress, and leaders that span, once an edge or an agent is lost."""
    edges = tuple(each for each in formation.edges if each != edge and agent not in each)
    if agent is None:
        return _rigid(replace(formation, edges=edges, weights=None))
    left = [other for other in range(1, formation.agents + 1) if other != agent]
    number = {other: place for place, other in enumerate(left, start=1)}
    leaders = tuple(number[leader] for leader in formation.leaders if leader != agent)
    among = formation.nominal[[leader - 1 for leader in formation.leaders if leader != agent]]
    spans = len(among) and np.linalg.matrix_rank(among - among.mean(axis=0)) == formation.dimension
    renamed = tuple((number[i], number[j]) for i, j in edges)
    nominal = formation.nominal[np.array(left) - 1]
    return bool(spans) and _rigid(Formation(nominal, renamed, leaders))


def _carries_stress(formation: Formation, up: Mask) -> bool:
    edges = tuple(edge for edge, works in zip(formation.edges, up.tolist(), strict=True) if works)
    return _rigid(replace(formation, edges=edges, weights=None))


def _rigid(formation: Formation) -> bool:
    try:
        solve(formation)
    except NotRigid:
        return False
    return True
