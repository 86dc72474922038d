"""What pushes agents about: displacements correlated between axes, between agents and in time (paper 004, section 4.2.2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array
from analysis.models.elementary import exp, whole_power

Shape = Literal["exponential", "squared-exponential"]


@dataclass(frozen=True)
class Kernel:
    """How disturbances of two agents are correlated, by the distance between them.

    Parameters
    ----------
    shape
        exp(-d / length), (4.13) and (4.14), or exp(-d^2 / (2 length^2)).
    length
        In metres; 2 gives (4.14).
    positions
        Whose distance counts: nominal positions, which agents know, or true ones, which change.
    """

    shape: Shape
    length: float
    positions: Literal["nominal", "true"]

    def correlation(self, position: Array) -> Array:
        """Q_A of agents at these positions (..., n, D), shape (..., n, n)."""
        difference = position[..., :, None, :] - position[..., None, :, :]
        distance = np.sqrt((difference * difference).sum(axis=-1))
        if self.shape == "exponential":
            correlated: Array = exp(-distance / self.length)
        else:
            correlated = exp(-0.5 * whole_power(distance / self.length, 2))
        return correlated


@dataclass(frozen=True)
class Disturbance:
    """Displacements in a tick, w ~ N(0, Q_A (x) Q_D) (4.11).

    Parameters
    ----------
    covariance
        Q_D of one agent's, shape (D, D), in square metres.
    kernel
        Of Q_A; None for independent agents.
    persistence
        Correlation of a displacement with that of the tick before, in [0, 1).
    """

    covariance: Array
    kernel: Kernel | None
    persistence: float

    def between(self, nominal: Array) -> Array:
        """Q_A as far as agents can know it: at nominal positions (n, D), shape (n, n)."""
        return np.eye(len(nominal)) if self.kernel is None else self.kernel.correlation(nominal)

    def root(self, nominal: Array) -> Array:
        """The square root of `between`, lower triangular, shape (n, n)."""
        return _root(self.between(nominal))

    @cached_property
    def still(self) -> bool:
        """Whether nothing is displaced."""
        return not self.covariance.any()

    def drawn(self, white: Array, root: Array) -> Array:
        """What is drawn for ticks, correlated as far as that is known ahead of them, shape (..., n, D), in metres.

        Parameters
        ----------
        white
            Standard normal draws, shape (..., n, D).
        root
            Of Q_A at nominal positions, shape (n, n).
        """
        drawn = product(white, _root(self.covariance).T)
        return product(root, drawn) if self.kernel is not None and self.kernel.positions == "nominal" else drawn

    def next(self, before: Array | None, drawn: Array, position: Array) -> Array:
        """The displacements of a tick, shape (R, n, D), in metres, of R swarms side by side.

        Parameters
        ----------
        before
            Those of the tick before, shape (R, n, D); None in the first.
        drawn
            What is drawn for the tick, shape (R, n, D), in metres.
        position
            Of the agents, shape (R, n, D), in metres.
        """
        if self.kernel is not None and self.kernel.positions == "true":
            drawn = product(_root(self.kernel.correlation(position)), drawn)
        if before is None or self.persistence == 0.0:
            return drawn
        return self.persistence * before + np.sqrt(1.0 - self.persistence * self.persistence) * drawn


def _root(covariance: Array) -> Array:
    """Lower triangular square roots of covariances that may be singular, shape (..., m, m)."""
    size = covariance.shape[-1]
    # Agents at one place are pushed alike: a hair of independence keeps the factor defined.
    hair = 1e-12 * np.einsum("...ii", covariance)[..., None, None] / size
    if not covariance.any():
        return np.zeros_like(covariance)
    return np.linalg.cholesky(covariance + hair * np.eye(size))
