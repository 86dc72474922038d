"""Classes of maps that a formation may be told to keep to, and how each is fitted (paper 000, section IV, Table III).

The stricter the class, the fewer neighbours determine a map of it. Feasibility is a rank test on the nominal H, never on Y.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, Protocol

import numpy as np

from agents.algebra import geometry
from agents.algebra.geometry import SINGULAR, Fit, spans
from analysis.kernels.kernel import Plain, kernel, scratch
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.small import inverse, rotation

Constraint = Literal["affine", "scaling", "rotation", "similarity"]

# Infinitesimal rotations, by the number of dimensions: shape (q, D, D).
_GENERATORS = {
    2: np.array([[[0.0, -1.0], [1.0, 0.0]]]),
    3: np.array(
        [
            [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]],
            [[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
            [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
        ]
    ),
}


class Maps(Protocol):
    """A class of maps."""

    def feasible(self, gram: Array) -> Mask:
        """Whether neighbours of this H H^T (..., D, D) determine a map, shape (...)."""

    def fit(self, relative: Array, measured: Array, seen: Mask) -> Fit:
        """The map from the edges seen.

        Parameters
        ----------
        relative, measured
            p_ij and y_ij, shape (..., n, D), in metres; the latter 0 where not seen.
        seen
            Shape (..., n).
        """

    def nearest(self, theta: Array) -> Array:
        """The maps of this class nearest to any maps (..., D, D)."""

    def covariance(self, shape: Fit, relative: Array, R: Array) -> Array:
        """Covariance of the geometric estimates Theta p_ij, shape (..., n, D, D), in square metres.

        Parameters
        ----------
        shape
            The map, and the H H^T of the neighbours behind it.
        relative
            p_ij, shape (..., n, D), in metres.
        R
            Of one relative measurement, shape (D, D), in square metres.
        """


class Affine:
    """Any matrix: at least D neighbours, not in a line (plane) with the agent."""

    def feasible(self, gram: Array) -> Mask:
        """Rank H = D (Remark 1)."""
        return geometry.regular(gram)

    def fit(self, relative: Array, measured: Array, seen: Mask) -> Fit:
        """Least squares (10)."""
        return Fit(*_affine(relative, measured, seen))

    def nearest(self, theta: Array) -> Array:
        """Every map is one."""
        return theta

    def covariance(self, shape: Fit, relative: Array, R: Array) -> Array:
        """(p_ij^T (H H^T)^-1 p_ij) R, which is (12) with one R for all edges and an identity of size N_i,k (errata)."""
        covariance: Array = _affine_covariance(shape.gram, relative, R)
        return covariance


@kernel("(n,D),(n,D),(n)->(D,D),(),(D,D)", "dd?->d?d")
def _affine(D: int) -> Plain:
    def plain(relative: Array, measured: Array, seen: Mask, theta: Array, feasible: Mask, gram: Array) -> None:
        crossed, inverse = scratch(D, D), scratch(D, D)
        for i in range(D):
            for j in range(D):
                crossed[i, j] = gram[i, j] = 0.0
        for edge in range(len(seen)):
            if seen[edge]:
                for i in range(D):
                    for j in range(D):
                        crossed[i, j] += measured[edge, i] * relative[edge, j]
                        gram[i, j] += relative[edge, i] * relative[edge, j]
        feasible[0] = spans(gram, inverse)
        for i in range(D):
            for j in range(D):
                theta[i, j] = 0.0
                if feasible[0]:
                    for k in range(D):
                        theta[i, j] += crossed[i, k] * inverse[k, j]

    return plain


@kernel("(D,D),(n,D),(D,D)->(n,D,D)", "ddd->d")
def _affine_covariance(D: int) -> Plain:
    def plain(gram: Array, relative: Array, R: Array, covariance: Array) -> None:
        inverse = scratch(D, D)
        spans(gram, inverse)
        for edge in range(len(relative)):
            leverage = 0.0
            for i in range(D):
                for j in range(D):
                    leverage += relative[edge, i] * inverse[i, j] * relative[edge, j]
            for i in range(D):
                for j in range(D):
                    covariance[edge, i, j] = leverage * R[i, j]

    return plain


class Scaling:
    """A factor for each coordinate (13): one neighbour will do that differs from the agent in every coordinate."""

    def feasible(self, gram: Array) -> Mask:
        """Whether some neighbour differs from the agent in each coordinate."""
        excited = _diagonal(gram)
        return np.all(excited > SINGULAR * excited.mean(axis=-1, keepdims=True), axis=-1)

    def fit(self, relative: Array, measured: Array, seen: Mask) -> Fit:
        """Least squares, coordinate by coordinate."""
        gram = geometry.gram(relative, seen)
        feasible = self.feasible(gram)
        factors = _diagonal(geometry.cross(relative, measured, seen)) / np.where(
            feasible[..., None], _diagonal(gram), 1.0
        )
        return _fitted(factors[..., None] * geometry.identity(relative.shape[-1]), feasible, gram)

    def nearest(self, theta: Array) -> Array:
        """The diagonal."""
        return theta * geometry.identity(theta.shape[-1])

    def covariance(self, shape: Fit, relative: Array, R: Array) -> Array:
        """That of a linear fit, exactly: factors d and e covary by R_de (H H^T)_de / ((H H^T)_dd (H H^T)_ee)."""
        excited = np.where(self.feasible(shape.gram)[..., None], _diagonal(shape.gram), 1.0)
        factors = R * shape.gram / (excited[..., :, None] * excited[..., None, :])
        return factors[..., None, :, :] * (relative[..., :, None] * relative[..., None, :])


class Rotation:
    """A turn without reflection: one neighbour will do in the plane, two in space that are not in line with the agent.

    In space one neighbour leaves the turn about its edge open, whatever section IV-B says (errata).
    """

    def feasible(self, gram: Array) -> Mask:
        """Rank H >= D - 1; with the determinant fixed, the last direction follows from the others."""
        scale = np.einsum("...ii", gram) / gram.shape[-1]
        second: Mask = np.linalg.eigvalsh(gram)[..., 1] > SINGULAR * scale
        return second

    def fit(self, relative: Array, measured: Array, seen: Mask) -> Fit:
        """U V^T of Y H^T, with the determinant fixed to +1 (Table III and errata)."""
        gram = geometry.gram(relative, seen)
        return _fitted(rotation(geometry.cross(relative, measured, seen)), self.feasible(gram), gram)

    def nearest(self, theta: Array) -> Array:
        """The rotation in it."""
        return rotation(theta)

    def covariance(self, shape: Fit, relative: Array, R: Array) -> Array:
        """To first order, in the tangent space of the rotations."""
        turns = _turns(shape.theta)
        return _spread(turns, _least_squares(turns, shape.gram, self.feasible(shape.gram)), shape.gram, relative, R)


class Similarity:
    """A rotation and one scale, feasible where a rotation is; its determinant is s^D."""

    def feasible(self, gram: Array) -> Mask:
        """Rank H >= D - 1."""
        return Rotation().feasible(gram)

    def fit(self, relative: Array, measured: Array, seen: Mask) -> Fit:
        """The rotation of Table III, times the mean ratio of the singular values of Y to those of H that are not zero."""
        turn = Rotation().fit(relative, measured, seen)
        H, Y = _singular_values(np.where(seen[..., None], relative, 0.0)), _singular_values(measured)
        counts = SINGULAR * (H * H).sum(axis=-1, keepdims=True) / relative.shape[-1] < H * H
        ratios = np.where(counts, Y, 0.0) / np.where(counts, H, 1.0)
        scale = ratios.sum(axis=-1) / np.maximum(counts.sum(axis=-1), 1)
        return turn._replace(theta=scale[..., None, None] * turn.theta)

    def nearest(self, theta: Array) -> Array:
        """The rotation in it, scaled by least squares."""
        turn = rotation(theta)
        scale = np.maximum((turn * theta).sum(axis=(-2, -1)) / theta.shape[-1], 0.0)
        return scale[..., None, None] * turn

    def covariance(self, shape: Fit, relative: Array, R: Array) -> Array:
        """To first order, with the scale as it is fitted.

        A mean of ratios, unlike least squares, weighs all directions of H alike: it moves by tr(Theta^T V Phi^T) / rank H.
        Neighbours almost in line therefore make it, and this covariance, large.
        """
        turns, turn = _turns(shape.theta), rotation(shape.theta)
        values, vectors = np.linalg.eigh(shape.gram)
        counts = values > SINGULAR * values.mean(axis=-1, keepdims=True)
        inverted = np.where(counts, 1.0, 0.0) / np.where(counts, values, 1.0)
        pseudo = product(vectors * inverted[..., None, :], np.swapaxes(vectors, -1, -2))
        rank = np.maximum(counts.sum(axis=-1), 1)[..., None, None]
        read = _least_squares(turns, shape.gram, self.feasible(shape.gram))
        return _spread(
            np.concatenate([turns, turn[..., None, :, :]], axis=-3),
            np.concatenate([read, (product(turn, pseudo) / rank)[..., None, :, :]], axis=-3),
            shape.gram,
            relative,
            R,
        )


MAPS: Mapping[Constraint, Maps] = {
    "affine": Affine(),
    "scaling": Scaling(),
    "rotation": Rotation(),
    "similarity": Similarity(),
}


def _fitted(theta: Array, feasible: Mask, gram: Array) -> Fit:
    return Fit(np.where(feasible[..., None, None], theta, 0.0), feasible, gram)


def _diagonal(matrix: Array) -> Array:
    return np.einsum("...ii->...i", matrix)


def _singular_values(matrix: Array) -> Array:
    # LAPACK raises where a diverging swarm has overflown.
    finite = np.isfinite(matrix).all(axis=(-2, -1), keepdims=True)
    return np.asarray(np.linalg.svd(np.where(finite, matrix, 0.0), compute_uv=False), dtype=np.float64)


def _turns(theta: Array) -> Array:
    """The directions K_q Theta in which the rotation of a map can move, shape (..., q, D, D)."""
    directions: Array = product(_GENERATORS[theta.shape[-1]], rotation(theta)[..., None, :, :])
    return directions


def _least_squares(directions: Array, gram: Array, feasible: Mask) -> Array:
    """W_q, shape (..., q, D, D): to first order the parameter along T_q moves by sum_j (W_q h_j)^T v_j."""
    T = _flat(directions)
    normal = product(T, np.swapaxes(_flat(product(directions, gram[..., None, :, :])), -1, -2))
    solved: Array = product(inverse(np.where(feasible[..., None, None], normal, np.eye(T.shape[-2]))), T)
    return solved.reshape(directions.shape)


def _spread(directions: Array, read: Array, gram: Array, relative: Array, R: Array) -> Array:
    """G_ij C G_ij^T, shape (..., n, D, D), with G_ij = [T_q p_ij] and C the covariance of the parameters read by W_q."""
    noise = product(R, read, gram[..., None, :, :])
    C = product(_flat(read), np.swapaxes(_flat(noise), -1, -2))
    q, dimension = directions.shape[-3:-1]
    columns = np.moveaxis(directions, -1, -3)
    G = product(relative, columns.reshape(*columns.shape[:-2], q * dimension))
    G = G.reshape(*G.shape[:-1], q, dimension)
    covariance: Array = product(np.swapaxes(G, -1, -2), C[..., None, :, :], G)
    return covariance


def _flat(matrices: Array) -> Array:
    return matrices.reshape(*matrices.shape[:-2], -1)
