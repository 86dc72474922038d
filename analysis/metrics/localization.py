"""Where agents are, from one set of relative measurements: the optimal answer, and how far from it one is (paper 003)."""

from __future__ import annotations

import numpy as np

from analysis.metrics.errors import root_mean_square
from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array
from analysis.models.jacobi import EdgeInformation, system, weights


def centred(place: Array, own: Array) -> Array:
    """Positions (..., N, D) relative to their weighted centroid (8), with the agents' weights Upsilon_ii (..., N, D, D)."""
    return place - centroid(place, own)[..., None, :]


def centroid(place: Array, own: Array) -> Array:
    """The weighted centroid (w^T (1 x I))^-1 w^T x of positions (..., N, D), shape (..., D), in metres; NaN without weights."""
    weighed, total = sum_over(product(own, place[..., None]), -3), sum_over(own, -3)
    counts = np.asarray(np.linalg.det(total) != 0.0)[..., None, None]
    solved = np.linalg.solve(np.where(counts, total, np.eye(total.shape[-1])), weighed)
    return np.asarray(np.where(counts, solved, np.nan)[..., 0], dtype=np.float64)


def optimal(edges: EdgeInformation) -> Array:
    """The optimal estimates relative to their weighted centroid (8), shape (..., N, D), in metres.

    They are those of (3)-(5) with any agent as the anchor; here the last. NaN where the edges do not join all agents.
    """
    matrix, eta = system(edges)
    own = weights(edges)
    dimension = own.shape[-1]
    inner, drawn = matrix[..., :-dimension, :-dimension], eta[..., :-dimension]
    joined = np.linalg.matrix_rank(inner, hermitian=True) == inner.shape[-1]
    solvable = np.where(joined[..., None, None], inner, np.eye(inner.shape[-1]))
    from_anchor = np.linalg.solve(solvable, drawn[..., None])[..., 0]
    place = np.concatenate([from_anchor, np.zeros((*from_anchor.shape[:-1], dimension))], axis=-1)
    relative = centred(place.reshape(*own.shape[:-1]), np.where(joined[..., None, None, None], own, np.eye(dimension)))
    return np.where(joined[..., None, None], relative, np.nan)


def beside(place: Array, edges: EdgeInformation) -> Array:
    """Estimated positions (..., N, D) moved onto the optimal ones, in metres: by the weighted centroid of what is between them.

    An agent that says nothing, NaN, counts for nothing, and keeps saying it; where edges do not join all, places stay.
    """
    off: Array = place - optimal(edges)
    told = np.asarray(~np.isnan(off).any(axis=-1))
    own = np.where(told[..., None, None], weights(edges), 0.0)
    between = centroid(np.where(told[..., None], off, 0.0), own)
    return np.asarray(place - np.nan_to_num(between)[..., None, :], dtype=np.float64)


def distance(place: Array, edges: EdgeInformation) -> Array:
    """How far agents are from the optimal estimates, root mean square, shape (...), in metres; both from the centroid (8).

    Parameters
    ----------
    place
        Estimated positions, shape (..., N, D), in metres; NaN of agents that say nothing, which do not count.
    edges
        What could be known.
    """
    off = beside(place, edges) - optimal(edges)
    return root_mean_square(off, np.asarray(~np.isnan(off).any(axis=-1)))


def anchored(edges: EdgeInformation, anchor: int) -> tuple[Array, Array]:
    """The optimal estimates with one agent at the origin, and their covariance (3), (4).

    Parameters
    ----------
    edges
        What is known; it has to join all agents.
    anchor
        The row of that agent.

    Returns
    -------
    Positions (..., N, D), in metres, and their covariance (..., N D, N D), in square metres; 0 of the anchor.
    """
    matrix, eta = system(edges)
    agents, dimension = edges.pull.shape[-2:]
    fixed = np.repeat(np.arange(agents) == anchor, dimension)
    # One of the anchor's own, and 0 between it and the others: the inverse is that of the others by themselves.
    inner = np.where(fixed[:, None] | fixed[None, :], np.diag(fixed.astype(np.float64)), matrix)
    inverse = np.linalg.inv(inner)
    covariance = np.where(fixed[:, None] | fixed[None, :], 0.0, inverse)
    place = product(covariance, eta[..., None])[..., 0]
    return place.reshape(*place.shape[:-1], agents, dimension), covariance


def spread(edges: EdgeInformation) -> Array:
    """The covariance of the optimal estimates relative to their weighted centroid (8), shape (..., N D, N D), in m2.

    It is that of (4) with any agent as the anchor, seen from the weighted centroid.
    """
    own = weights(edges)
    agents, dimension = own.shape[-3], own.shape[-1]
    to_centroid = np.linalg.solve(sum_over(own, -3), np.moveaxis(own, -3, -2).reshape(*own.shape[:-3], dimension, -1))
    seen_from = np.eye(agents * dimension) - np.tile(to_centroid, (agents, 1))
    covariance: Array = product(seen_from, anchored(edges, 0)[1], np.swapaxes(seen_from, -1, -2))
    return covariance


def place_error(place: Array, true: Array) -> Array:
    """How far estimated positions (..., N, D) are from the true ones, root mean square, shape (...), in metres.

    Both from their plain centroid, whatever weights an estimate was made with. NaN where any agent says nothing.
    """
    off = place - true
    apart = off - sum_over(off, -2)[..., None, :] / off.shape[-2]
    return root_mean_square(apart, np.ones(apart.shape[:-1], dtype=bool))


def place_nees(place: Array, true: Array, edges: EdgeInformation) -> Array:
    """Squared errors (..., N, D) normalised by the covariance that (4) makes of the edges, per agent, shape (...).

    For the optimal estimates of truthful covariances it is D in the mean: N - 1 agents are uncertain relative to the last,
    whichever that is, and where the origin lies does not matter.
    """
    off = (place - true).reshape(*place.shape[:-2], -1)
    squared = sum_over(off * product(system(edges)[0], off[..., None])[..., 0], -1)
    return np.asarray(squared / (place.shape[-2] - 1), dtype=np.float64)


def ringing(place: Array) -> Array:
    """The share of steps that go back on the step before, over agents and axes, of positions (..., T, N, D), shape (..., T).

    Nothing can go back in the first two moments.
    """
    moved = np.diff(place, axis=-3)
    back = (moved[..., 1:, :, :] * moved[..., :-1, :, :] < 0.0).mean(axis=(-2, -1))
    share: Array = np.concatenate([np.zeros((*back.shape[:-1], 2)), back], axis=-1)
    return share[..., : place.shape[-3]]
