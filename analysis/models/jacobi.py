"""Agents' relative measurements as a linear system, and how fast Jacobi over-relaxation solves it (paper 003).

An edge (i, j) is known by z_ij, an estimate of x_i - x_j, and the inverse covariance behind it, both the same from either end.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from analysis.models.algebra import product, sum_over
from analysis.models.arrays import Array


class EdgeInformation(NamedTuple):
    """What is known of the relative positions of agents, each edge from both ends: [i, j] is that of i from j.

    Parameters
    ----------
    information
        Inverse covariances, shape (..., N, N, D, D), in 1/m2; 0 where there is no edge.
    pull
        Inverse covariance times relative position, shape (..., N, N, D), in 1/m.
    """

    information: Array
    pull: Array


class Rates(NamedTuple):
    """Convergence rates (definition 4.2) on a graph: of the weighted centroid, and with an anchor."""

    centroid: float
    anchor: float


def together(relative: Array, information: Array) -> EdgeInformation:
    """Edges measured from either end, or from both: what i says of j counts for j as well, with its sign reversed.

    Parameters
    ----------
    relative
        y_ij of x_i - x_j, shape (..., N, N, D), in metres.
    information
        Inverse covariance of each, shape (..., N, N, D, D), in 1/m2; 0 where i did not measure j.
    """
    pull = product(information, relative[..., None])[..., 0]
    return EdgeInformation(information + np.swapaxes(information, -4, -3), pull - np.swapaxes(pull, -3, -2))


def weights(edges: EdgeInformation) -> Array:
    """Upsilon_ii of every agent, shape (..., N, D, D): what it counts in the weighted centroid (7)."""
    return sum_over(edges.information, -3)


def system(edges: EdgeInformation) -> tuple[Array, Array]:
    """Upsilon (..., N D, N D) and eta (..., N D) of (6)."""
    own = weights(edges)
    agents, dimension = own.shape[-3], own.shape[-1]
    blocks = np.eye(agents)[:, :, None, None] * own[..., :, None, :, :] - edges.information
    matrix = np.swapaxes(blocks, -3, -2).reshape(*own.shape[:-3], agents * dimension, agents * dimension)
    return matrix, sum_over(edges.pull, -2).reshape(*own.shape[:-3], agents * dimension)


def spectrum(edges: EdgeInformation) -> Array:
    """Eigenvalues of D^-1 Upsilon, in ascending order, shape (..., N D): real, D of them zero where all agents are joined."""
    return np.asarray(np.linalg.eigvalsh(_symmetric(edges)), dtype=np.float64)


def step(edges: EdgeInformation, kind: Literal["smooth", "fast"]) -> float:
    """The step h that the eigenvalues allow (section V): the fastest without ringing, or the fastest of all."""
    dimension = edges.pull.shape[-1]
    values = spectrum(edges)
    largest, smallest = float(values[-1]), float(values[dimension])
    return 1.0 / largest if kind == "smooth" else 2.0 / (smallest + largest)


def rates(edges: EdgeInformation, h: float, anchor: int) -> Rates:
    """rho_ess(M_JOR), and rho of M_JOR without the rows and columns of the anchor (a row of the arrays)."""
    dimension = edges.pull.shape[-1]
    moved = 1.0 - h * spectrum(edges)[dimension:]
    kept = np.delete(np.arange(len(edges.pull)), anchor)
    # Agents keep their weights Upsilon_ii: the anchor's own row and column alone are left out (definition 4.1).
    rows = (kept[:, None] * dimension + np.arange(dimension)).ravel()
    anchored = 1.0 - h * np.linalg.eigvalsh(_symmetric(edges)[np.ix_(rows, rows)])
    return Rates(float(np.abs(moved).max()), float(np.abs(anchored).max()))


def _symmetric(edges: EdgeInformation) -> Array:
    """D^-1/2 Upsilon D^-1/2, shape (..., N D, N D), which has the eigenvalues of D^-1 Upsilon."""
    matrix, _ = system(edges)
    values, vectors = np.linalg.eigh(weights(edges))
    root = product(vectors / np.sqrt(values)[..., None, :], np.swapaxes(vectors, -1, -2))
    agents, dimension = root.shape[-3], root.shape[-1]
    blocks = matrix.reshape(*matrix.shape[:-2], agents, dimension, agents, dimension)
    blocks = np.swapaxes(blocks, -3, -2)
    blocks = product(root[..., :, None, :, :], blocks, root[..., None, :, :, :])
    return np.swapaxes(blocks, -3, -2).reshape(matrix.shape)
