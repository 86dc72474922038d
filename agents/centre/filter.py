"""The centralized filter (paper 001, (9a)-(9g); paper 004, Algorithm 6): one Kalman filter that hears everything.

It is the clairvoyant the others are measured against. It follows the agents' positions from an origin that nobody knows, (6)
and (8) before they are multiplied by B^T: the edges it tells, B^T z, are those of (9), from a state a sixth of the size.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from analysis.models.algebra import product
from analysis.models.arrays import Array, Integers, Mask
from analysis.models.sensor import Sensor


class Whole(NamedTuple):
    """What it believes of all agents: positions (..., N, D), and their covariance (..., N D, N D)."""

    position: Array
    covariance: Array


class CentreEstimate(NamedTuple):
    """What it tells every agent of its edges: relative positions (..., N, n, D) and their covariances (..., N, n, D, D)."""

    relative: Array
    covariance: Array


@dataclass(frozen=True)
class Centre:
    """The filter of a swarm.

    Parameters
    ----------
    dt
        Tick, in seconds.
    neighbours, present
        Rows of the agents in the slots, and which slots are real, shape (N, n).
    sensor
        What measures the edges.
    process
        Q of all agents together, shape (N D, N D), in square metres.
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    """

    dt: float
    neighbours: Integers
    present: Mask
    sensor: Sensor
    process: Array
    prior_position: float

    def begin(self, batch: tuple[int, ...]) -> Whole:
        """Everybody at the same place, as far as is known (9a)-(9b)."""
        agents, size = len(self.neighbours), len(self.process)
        prior = self.prior_position * self.prior_position * np.eye(size)
        return Whole(np.zeros((*batch, agents, size // agents)), np.broadcast_to(prior, (*batch, size, size)).copy())

    def step(self, state: Whole, measured: Array, seen: Mask, inputs: Array) -> tuple[Whole, CentreEstimate]:
        """Predict all agents by their inputs (9c)-(9d), and correct them by every measurement (9e)-(9g).

        Parameters
        ----------
        measured, seen
            Relative positions, shape (..., N, n, D), in metres, and which were made, shape (..., N, n).
        inputs
            What the agents flew from the tick before, shape (..., N, D), in metres per second.
        """
        agents, dimension = state.position.shape[-2:]
        position = state.position + self.dt * inputs
        covariance = state.covariance + self.process
        precision = np.where(seen[..., None, None], np.linalg.inv(self.sensor.spread(measured)), 0.0)
        surprise = product(precision, (measured - self._edges(position))[..., None])
        pulled = product(self._incidence, surprise.reshape(*seen.shape[:-2], -1, dimension))
        information = self._information(precision)
        solved = np.linalg.solve(np.eye(agents * dimension) + product(covariance, information), covariance)
        corrected = np.asarray(0.5 * (solved + np.swapaxes(solved, -1, -2)), dtype=np.float64)
        moved = product(corrected, pulled.reshape(*pulled.shape[:-2], -1)[..., None])[..., 0]
        whole = Whole(position + moved.reshape(position.shape), corrected)
        return whole, CentreEstimate(self._edges(whole.position), self._spread(corrected, agents, dimension))

    def _information(self, precision: Array) -> Array:
        """B (I (x) R^-1) B^T, shape (..., N D, N D), of edges with inverse covariances (..., N, n, D, D)."""
        agents, dimension = len(self.neighbours), precision.shape[-1]
        batch = precision.shape[:-4]
        pairs = product(self._pairs, precision.reshape(*batch, -1, dimension * dimension))
        blocks = pairs.reshape(*batch, agents, agents, dimension, dimension)
        return np.swapaxes(blocks, -3, -2).reshape(*batch, agents * dimension, agents * dimension)

    def _edges(self, position: Array) -> Array:
        relative: Array = position[..., :, None, :] - position[..., self.neighbours, :]
        return np.where(self.present[..., None], relative, 0.0)

    def _spread(self, covariance: Array, agents: int, dimension: int) -> Array:
        blocks = covariance.reshape(*covariance.shape[:-2], agents, dimension, agents, dimension)
        blocks = np.swapaxes(blocks, -3, -2)
        own, theirs = np.arange(agents)[:, None], self.neighbours
        mine, others = blocks[..., own, own, :, :], blocks[..., theirs, theirs, :, :]
        spread = mine + others - blocks[..., own, theirs, :, :] - blocks[..., theirs, own, :, :]
        return np.where(self.present[..., None, None], spread, 0.0)

    @cached_property
    def _incidence(self) -> Array:
        """B, shape (N, N n): +1 for who looks, -1 for who is looked at, 0 for padding."""
        agents, slots = self.neighbours.shape
        own, edges = np.repeat(np.arange(agents), slots), np.arange(agents * slots)
        B = np.zeros((agents, agents * slots))
        B[own, edges] = 1.0
        B[self.neighbours.ravel(), edges] -= 1.0
        return B * self.present.ravel()

    @cached_property
    def _pairs(self) -> Array:
        """What an edge adds to the information of each pair of agents, shape (N N, N n)."""
        B = self._incidence
        return (B[:, None, :] * B[None, :, :]).reshape(-1, B.shape[-1])
