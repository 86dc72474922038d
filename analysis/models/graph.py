"""The functional graph of a run: what the links that delivered make of the nominal graph (paper 000, section II).

Link j -> i, of `src` j and `dst` i, is heard in a tick when what j sent reached i. Agents are numbered from 1, no link
stands twice, and ticks may be any leading axes unless a docstring names the axis T.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import prod

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers, Mask

Edges = Integers | Sequence[tuple[int, int]]

# Of eigenvalues to their mean, and of singular values to the largest: below this they are zero.
_SINGULAR = 1e-9


def adjacency(heard: Mask, src: Integers, dst: Integers, agents: int) -> Mask:
    """Who heard whom.

    Parameters
    ----------
    heard
        Links that delivered, shape (..., L).
    src, dst
        Agent numbers, shape (L,).
    agents
        N.

    Returns
    -------
    Mask
        Shape (..., N, N); [i - 1, j - 1] where i heard j.
    """
    matrix = np.zeros((*heard.shape[:-1], agents, agents), dtype=np.bool_)
    matrix[..., dst - 1, src - 1] = heard
    return matrix


def mutual(adjacency: Mask) -> Mask:
    """Pairs that heard each other, shape (..., N, N)."""
    return adjacency & np.swapaxes(adjacency, -1, -2)


def undirected(heard: Mask, src: Integers, dst: Integers, edges: Edges) -> Mask:
    """Undirected edges that worked both ways, shape (..., E).

    Parameters
    ----------
    heard
        Links that delivered, shape (..., L).
    src, dst
        Agent numbers, shape (L,).
    edges
        Agent numbers, shape (E, 2); an edge that lacks a link never works.
    """
    i, j = _ends(edges)
    agents = max(int(ends.max(initial=0)) for ends in (src, dst, i, j))
    return mutual(adjacency(heard, src, dst, agents))[..., i - 1, j - 1]


def joint(heard: Mask, window: int) -> Mask:
    """Links that delivered at least once in the last ticks, shape (..., T, L).

    Parameters
    ----------
    heard
        Shape (..., T, L).
    window
        How many ticks, the current one included; the first ticks have fewer.

    Raises
    ------
    ValueError
        When the window holds no tick.
    """
    if window < 1:
        raise ValueError(f"a window of {window} ticks holds none: it must be at least 1")
    until = np.cumsum(heard, axis=-2)
    before = np.zeros_like(until)
    before[..., window:, :] = until[..., :-window, :]
    return until > before


def age(sent: Integers, ticks: Integers | None = None) -> Array:
    """Age of information of each link, in ticks: how long ago the newest message that has arrived was sent.

    Parameters
    ----------
    sent
        Tick in which the newest message that arrived in each tick was sent, -1 where none arrived, shape (..., T, L).
    ticks
        The ticks of the rows, shape (T,); 0, 1, ... unless given.

    Returns
    -------
    Array
        Shape (..., T, L); NaN until a message arrives. A message overtaken by a newer one does not make it older.
    """
    newest = np.maximum.accumulate(sent, axis=-2)
    now = np.arange(sent.shape[-2]) if ticks is None else ticks
    return np.where(newest >= 0, now[:, None] - newest, np.nan)


def algebraic_connectivity(adjacency: Mask, present: Mask | None = None) -> Array:
    """Second smallest eigenvalue of the unweighted Laplacian of the mutual graph (N, N), shape (...); 0 for one agent.

    Parameters
    ----------
    adjacency
        Shape (..., N, N).
    present
        Which agents take part, shape (..., N); all by default. The others have no edges.
    """
    agents, ticks = adjacency.shape[-1], adjacency.shape[:-2]
    if agents < 2:
        return np.zeros(ticks)
    there = np.broadcast_to(True if present is None else present, (*ticks, agents))
    pairs = mutual(adjacency).reshape(prod(ticks), agents**2)
    graphs, tick = _distinct(np.concatenate([pairs, there.reshape(prod(ticks), agents)], axis=-1))
    edges = graphs[:, :-agents].reshape(-1, agents, agents).astype(np.float64)
    # The degree of who takes no part lies above every eigenvalue of the others.
    degree = np.where(graphs[:, -agents:], edges.sum(axis=-1), agents + 1.0)
    second = np.linalg.eigvalsh(degree[..., None] * np.eye(agents) - edges)[:, 1]
    return np.maximum(second, 0.0)[tick].reshape(ticks)


def connected(adjacency: Mask) -> Mask:
    """Whether the mutual graph (N, N) is connected, shape (...)."""
    return np.all(reached(mutual(adjacency))[..., 0], axis=-1)


def rooted(adjacency: Mask, leaders: Integers | Sequence[int]) -> Mask:
    """Whether every agent is reached, along links heard (N, N), from one leader or another, shape (...).

    Parameters
    ----------
    adjacency
        Shape (..., N, N).
    leaders
        Agent numbers; without any, nobody is reached.
    """
    roots = np.asarray(leaders, dtype=np.int64) - 1
    return np.all(np.any(reached(adjacency)[..., roots], axis=-1), axis=-1)


def feasible(heard: Mask, src: Integers, dst: Integers, nominal: Array) -> Mask:
    """Agents whose neighbours heard determine an affine map, shape (..., N): rank H = D (paper 000, Remark 1).

    Parameters
    ----------
    heard
        Links that delivered, or edges seen, shape (..., L).
    src, dst
        Agent numbers, shape (L,).
    nominal
        Nominal positions, shape (N, D), in metres.
    """
    return regular(grams(adjacency(heard, src, dst, len(nominal)), nominal))


def grams(sees: Mask, nominal: Array) -> Array:
    """H H^T of the neighbours that every agent sees, shape (..., N, D, D), in square metres.

    Parameters
    ----------
    sees
        Shape (..., N, N); [i - 1, j - 1] where i sees j.
    nominal
        Nominal positions, shape (..., N, D), in metres.
    """
    dimension = nominal.shape[-1]
    relative = nominal[..., :, None, :] - nominal[..., None, :, :]
    products = (relative[..., :, None] * relative[..., None, :]).reshape(*relative.shape[:-1], dimension**2)
    flat = product(sees[..., None, :].astype(np.float64), products)[..., 0, :]
    return flat.reshape(*flat.shape[:-1], dimension, dimension)


def regular(gram: Array) -> Mask:
    """Whether rank H = D, shape (...), from H H^T (..., D, D)."""
    scale = np.einsum("...ii", gram) / gram.shape[-1]
    return np.linalg.eigvalsh(gram)[..., 0] > _SINGULAR * scale


def stress_dimension(edges_up: Mask, edges: Edges, nominal: Array) -> Integers:
    """Dimension of the space of equilibrium stresses on the edges up, shape (...): 0 where no stress can stabilise.

    It is their number less the rank of their rows of the rigidity matrix. More than 0 is necessary, not sufficient: the
    stress must also be positive semidefinite of rank N - D - 1 (paper 004, theorem 3.2).

    Parameters
    ----------
    edges_up
        Shape (..., E).
    edges
        Agent numbers, shape (E, 2).
    nominal
        Nominal positions, shape (N, D), in metres.
    """
    i, j = _ends(edges)
    rows = np.arange(len(i))
    rigidity = np.zeros((len(i), *nominal.shape))
    rigidity[rows, i - 1] = nominal[i - 1] - nominal[j - 1]
    rigidity[rows, j - 1] = nominal[j - 1] - nominal[i - 1]
    patterns, tick = _distinct(edges_up.reshape(prod(edges_up.shape[:-1]), len(i)))
    singular = np.linalg.svd(patterns[..., None] * rigidity.reshape(len(i), nominal.size), compute_uv=False)
    rank = (singular > _SINGULAR * singular.max(axis=-1, keepdims=True, initial=0.0)).sum(axis=-1)
    return (patterns.sum(axis=-1) - rank)[tick].reshape(edges_up.shape[:-1])


def _distinct(patterns: Mask) -> tuple[Mask, Integers]:
    """The rows (m, k) without those that stand there again, and which of them each row is, shape (m,)."""
    bits = np.zeros((len(patterns), patterns.shape[1] // 8 + 1), dtype=np.uint8)
    packed = np.packbits(patterns, axis=-1)
    bits[:, : packed.shape[1]] = packed
    _, first, row = np.unique(bits.view(f"V{bits.shape[1]}")[:, 0], return_index=True, return_inverse=True)
    return patterns[first], row


def _ends(edges: Edges) -> tuple[Integers, Integers]:
    i, j = np.asarray(edges, dtype=np.int64).reshape(-1, 2).T
    return i, j


def reached(adjacency: Mask) -> Mask:
    """Who is reached, in any number of steps, from whom, shape (..., N, N); everybody from itself."""
    agents = adjacency.shape[-1]
    reach = (adjacency | np.eye(agents, dtype=np.bool_)).astype(np.float64)
    for _ in range((agents - 1).bit_length()):
        reach = np.minimum(product(reach, reach), 1.0)
    return reach > 0.0
