"""What filters of edges do not know: the edges, the neighbours' inputs that are not heard, and disturbances that last.

All are in one state, so that a doubt that lasts stays correlated from tick to tick: an input that is guessed wrong displaces
an edge in every tick until it is heard, and a disturbance that persists pushes it the same way again. Paper 004, sections 4.2.2
and 6.1, takes both for white.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel, scratch
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.small import inverse


class Belief(NamedTuple):
    """Of edges that are filtered together, m coordinates in all: mean (..., q, m), and covariance (..., r m, r m).

    Its rows are the edges, in metres; what displaced them last, in metres, if disturbances persist; and the neighbours' inputs
    of the last ticks, newest first, in metres per second. The covariance is that of the first r, which are in doubt.
    """

    mean: Array
    covariance: Array

    @property
    def edges(self) -> tuple[Array, Array]:
        """Mean (..., m) and covariance (..., m, m) of the edges alone."""
        size = self.mean.shape[-1]
        return self.mean[..., 0, :], self.covariance[..., :size, :size]

    @property
    def doubted(self) -> Array:
        """Mean of all that is in doubt, one after the other, shape (..., r m)."""
        rows = self.covariance.shape[-1] // self.mean.shape[-1]
        return self.mean[..., :rows, :].reshape(*self.mean.shape[:-2], -1)

    def corrected(self, doubted: Array, covariance: Array) -> Belief:
        """The belief with another mean (..., r m) and covariance (..., r m, r m) of what is in doubt."""
        size = self.mean.shape[-1]
        rows = covariance.shape[-1] // size
        left = doubted.reshape(*doubted.shape[:-1], rows, size)
        return Belief(np.concatenate([left, self.mean[..., rows:, :]], axis=-2), covariance)

    def placed(self, edges: Array) -> Belief:
        """The belief with edges elsewhere, shape (..., m)."""
        return self._replace(mean=np.concatenate([edges[..., None, :], self.mean[..., 1:, :]], axis=-2))


@dataclass(frozen=True)
class EdgeModel:
    """How edges move.

    Parameters
    ----------
    dt
        Tick, in seconds.
    coefficients
        Of the autoregressive model of inputs (6.5), the latest first; none takes neighbours for at rest.
    sigma_n
        Standard deviation of what drives it, per axis, in metres per second; with 0 its predictions are not doubted.
    persistence
        Correlation of a displacement with that of the tick before.
    """

    dt: float
    coefficients: tuple[float, ...]
    sigma_n: float
    persistence: float

    def begin(self, edges: Array, displaced: Array, shape: tuple[int, ...]) -> Belief:
        """Everybody at one place and at rest, with covariances of the edges and of what displaces them, both (m, m) or more.

        Parameters
        ----------
        edges, displaced
            Shapes (..., m, m).
        shape
            Leading axes of the belief.
        """
        size = edges.shape[-1]
        covariance = np.zeros((*shape, self._doubted * size, self._doubted * size))
        covariance[..., :size, :size] = edges
        if self.persistence:
            covariance[..., size : 2 * size, size : 2 * size] = displaced
        return Belief(np.zeros((*shape, self._newest + self._order, size)), covariance)

    def ahead(self, belief: Belief, displaced: Array) -> Belief:
        """A tick later, as far as the models of disturbances and inputs say; the edges have not moved yet.

        Parameters
        ----------
        belief
            After the tick before.
        displaced
            Covariance of what displaces the edges in a tick, shape (..., m, m), in square metres.
        """
        row, share = (1, 1.0 - self.persistence * self.persistence) if self.persistence else (0, 1.0)
        driven = self.sigma_n * self.sigma_n if self._guesses else 0.0
        turn = self._turn[: self._doubted, : self._doubted]
        covariance = _mixed(turn, belief.covariance, displaced, row, share, self._newest, driven)
        return Belief(product(self._turn, belief.mean), covariance)

    def hear(self, belief: Belief, inputs: Array, known: Mask) -> Belief:
        """The belief that knows the newest inputs (..., m), where they are `known` (..., m), and what they say of the rest."""
        size, row = belief.mean.shape[-1], self._newest
        mean, covariance = belief.mean.copy(), belief.covariance
        if self._guesses:
            newest = slice(row * size, (row + 1) * size)
            both = known[..., :, None] & known[..., None, :]
            S = np.where(both, covariance[..., newest, newest], np.eye(size))
            crossed = np.where(known[..., None, :], covariance[..., newest], 0.0)
            gain = product(crossed, inverse(S))
            surprise = np.where(known, inputs - mean[..., row, :], 0.0)
            mean += product(gain, surprise[..., None])[..., 0].reshape(mean.shape)
            covariance = covariance - product(gain, np.swapaxes(crossed, -1, -2))
            # What is known is exactly so.
            sure = np.zeros((*known.shape[:-1], covariance.shape[-1]), dtype=bool)
            sure[..., newest] = known
            covariance = np.where(sure[..., :, None] | sure[..., None, :], 0.0, covariance)
        mean[..., row, :] = np.where(known, inputs, mean[..., row, :])
        return Belief(mean, covariance)

    def move(self, belief: Belief, own: Array) -> Belief:
        """The edges a tick later, by the agent's own input and the newest of the neighbours', both (..., m)."""
        mean, covariance = belief.mean.copy(), belief.covariance
        mean[..., 0, :] += self.dt * (own - mean[..., self._newest, :])
        if self.persistence:
            mean[..., 0, :] += mean[..., 1, :]
        if self._doubted > 1:
            nothing = np.zeros((mean.shape[-1], mean.shape[-1]))
            mixes = self._move[: self._doubted, : self._doubted]
            covariance = _mixed(mixes, covariance, nothing, 0, 0.0, self._newest, 0.0)
        return Belief(mean, covariance)

    @property
    def _order(self) -> int:
        """How many inputs are remembered: the newest, whatever the model is."""
        return max(len(self.coefficients), 1)

    @property
    def _guesses(self) -> bool:
        return bool(self.coefficients) and self.sigma_n > 0.0

    @property
    def _newest(self) -> int:
        """The row of the newest inputs."""
        return 2 if self.persistence else 1

    @property
    def _doubted(self) -> int:
        return self._newest + (self._order if self._guesses else 0)

    @cached_property
    def _turn(self) -> Array:
        """What a tick makes of the rows, but for the motion."""
        rows = self._newest + self._order
        T = np.zeros((rows, rows))
        T[0, 0] = 1.0
        if self.persistence:
            T[1, 1] = self.persistence
        T[self._newest, self._newest : self._newest + len(self.coefficients)] = self.coefficients
        older = np.arange(self._newest + 1, rows)
        T[older, older - 1] = 1.0
        return T

    @cached_property
    def _move(self) -> Array:
        T = np.eye(self._newest + self._order)
        T[0, self._newest] = -self.dt
        if self.persistence:
            T[0, 1] = 1.0
        return T


@kernel("(R,R),(S,S),(M,M),(),(),(),()->(S,S)", "dddldld->d")
def _mixed(R: int, S: int, M: int) -> Plain:  # noqa: ARG001
    """(T (x) I) P (T (x) I)^T, more displaced by so much in one row, and driven in another."""

    def plain(
        T: Array,
        covariance: Array,
        displaced: Array,
        pushed: int,
        share: float,
        newest: int,
        driven: float,
        mixed: Array,
    ) -> None:
        once = scratch(R, 1)
        for one in range(M):
            for other in range(M):
                for row in range(R):
                    for column in range(R):
                        once[column, 0] = 0.0
                        for earlier in range(R):
                            once[column, 0] += T[row, earlier] * covariance[earlier * M + one, column * M + other]
                    for column in range(R):
                        summed = 0.0
                        for earlier in range(R):
                            summed += once[earlier, 0] * T[column, earlier]
                        mixed[row * M + one, column * M + other] = summed
                mixed[pushed * M + one, pushed * M + other] += share * displaced[one, other]
            if newest < R:
                mixed[newest * M + one, newest * M + one] += driven

    return plain
