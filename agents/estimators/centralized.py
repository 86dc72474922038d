"""The centralized filter (paper 001, (9a)-(9g); paper 004, Algorithm 6): one Kalman filter that hears everything.

It is the clairvoyant the others are measured against. It follows the agents' positions from an origin that nobody knows, (6)
and (8) before they are multiplied by B^T: the edges it tells, B^T z, are those of (9), from a state a sixth of the size.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from agents.algebra.inputs import refuse_accelerations
from agents.algebra.kalman import normalised
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Centre, CentreEstimate, Estimator, refuse_negative
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import product
from analysis.models.arrays import Array, Mask
from analysis.models.reports import NIS
from netem.core.channels import CENTRE, INPUT


class Stateless(NamedTuple):
    """It remembers nothing: the centre does."""


class Whole(NamedTuple):
    """What it believes of all agents: positions (..., N, D), and what displaced them last, if disturbances persist.

    `covariance` is that of both, shape (..., N D, N D) or (..., 2 N D, 2 N D).
    """

    position: Array
    displaced: Array
    covariance: Array


@dataclass(frozen=True)
class CentralizedFilter(Estimator[Stateless]):
    """CRKF, or C-Edge-KF: a process of its own hears all measurements and inputs, past the medium, and tells everybody.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    """

    prior_position: float = 1.0

    def __post_init__(self) -> None:
        refuse_negative(prior_position=self.prior_position)

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Stateless:  # noqa: ARG002
        """Nothing to remember."""
        brief.sensor.require_positions()  # the centre measures by it
        return Stateless()

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Stateless,
        measured: Array,  # noqa: ARG002
        seen: Mask,  # noqa: ARG002
    ) -> tuple[Stateless, Mapping[str, Fields]]:
        """What is measured goes to the centre with every agent's measurements."""
        return state, {}

    def fuse(
        self,
        brief: Brief,
        state: Stateless,
        heard: Mapping[str, Heard],
        own: Own,  # noqa: ARG002
    ) -> tuple[Stateless, Estimate]:
        """What the centre tells."""
        refuse_accelerations(heard[INPUT])
        told = heard[CENTRE].fields
        known = np.broadcast_to(brief.present, told["relative"].shape[:-1])
        reports = {NIS: told["nis"]}
        return state, Estimate(told["relative"], known, told["covariance"], no_indicator(known), reports=reports)

    def centre(self, swarm: SwarmBrief) -> Centre[Whole]:
        """One filter for all agents."""
        return SwarmFilter(swarm, self.prior_position)


@dataclass(frozen=True)
class SwarmFilter(Centre[Whole]):
    """One Kalman filter for a swarm.

    Parameters
    ----------
    swarm
        What it is made for.
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    """

    swarm: SwarmBrief
    prior_position: float

    def begin(self, batch: tuple[int, ...]) -> Whole:
        """Everybody at the same place, as far as is known (9a)-(9b)."""
        agents, dimension, Q = self.swarm.agents, self.swarm.dimension, self.swarm.process
        prior = self.prior_position * self.prior_position * np.eye(agents * dimension)
        if self.swarm.persistence:
            prior = np.block([[prior, np.zeros_like(Q)], [np.zeros_like(Q), Q]])
        still = np.zeros((*batch, agents, dimension))
        return Whole(still, still, np.broadcast_to(prior, (*batch, *prior.shape)).copy())

    def step(self, state: Whole, measured: Array, seen: Mask, inputs: Array) -> tuple[Whole, CentreEstimate]:
        """Predict all agents by their inputs (9c)-(9d), and correct them by every measurement (9e)-(9g)."""
        agents, dimension = state.position.shape[-2:]
        size = agents * dimension
        position, displaced, covariance = self._predicted(state, inputs)
        expected, doubt = self._edges(position), self._spread(covariance[..., :size, :size], agents, dimension)
        innovation = measured - expected
        R = np.where(seen[..., None, None], self.swarm.sensor.weight(measured, expected, doubt), np.eye(dimension))
        nis = normalised(innovation, np.asarray(np.linalg.inv(doubt + R)), seen)
        precision = np.where(seen[..., None, None], np.linalg.inv(R), 0.0)
        surprise = product(precision, innovation[..., None])
        pulled = product(self._incidence, surprise.reshape(*seen.shape[:-2], -1, dimension))
        # Of what displaced them, measurements say something through the positions alone.
        weighed = product(covariance[..., :size], self._information(precision))
        weighed = np.concatenate([weighed, np.zeros_like(covariance[..., size:])], axis=-1)
        solved = np.linalg.solve(np.eye(covariance.shape[-1]) + weighed, covariance)
        corrected = np.asarray(0.5 * (solved + np.swapaxes(solved, -1, -2)), dtype=np.float64)
        moved = product(corrected[..., :size], pulled.reshape(*pulled.shape[:-2], -1)[..., None])[..., 0]
        position = position + moved[..., :size].reshape(position.shape)
        if self.swarm.persistence:
            displaced = displaced + moved[..., size:].reshape(position.shape)
        spread = self._spread(corrected[..., :size, :size], agents, dimension)
        return Whole(position, displaced, corrected), CentreEstimate(self._edges(position), spread, nis)

    def _predicted(self, state: Whole, inputs: Array) -> Whole:
        """Positions a tick later, and what displaced them, which goes on if disturbances persist."""
        position, a, Q = state.position + self.swarm.dt * inputs, self.swarm.persistence, self.swarm.process
        if not a:
            return Whole(position, state.displaced, state.covariance + Q)
        carried = np.kron(np.array([[1.0, a], [0.0, a]]), np.eye(len(Q)))
        covariance = product(carried, state.covariance, carried.T) + np.kron(np.ones((2, 2)), (1.0 - a * a) * Q)
        return Whole(position + a * state.displaced, a * state.displaced, covariance)

    def _information(self, precision: Array) -> Array:
        """B (I (x) R^-1) B^T, shape (..., N D, N D), of edges with inverse covariances (..., N, n, D, D)."""
        agents, dimension = self.swarm.agents, precision.shape[-1]
        batch = precision.shape[:-4]
        pairs = product(self._pairs, precision.reshape(*batch, -1, dimension * dimension))
        blocks = pairs.reshape(*batch, agents, agents, dimension, dimension)
        return np.swapaxes(blocks, -3, -2).reshape(*batch, agents * dimension, agents * dimension)

    def _edges(self, position: Array) -> Array:
        relative: Array = position[..., :, None, :] - position[..., self.swarm.neighbours, :]
        return np.where(self.swarm.present[..., None], relative, 0.0)

    def _spread(self, covariance: Array, agents: int, dimension: int) -> Array:
        blocks = covariance.reshape(*covariance.shape[:-2], agents, dimension, agents, dimension)
        blocks = np.swapaxes(blocks, -3, -2)
        own, theirs = np.arange(agents)[:, None], self.swarm.neighbours
        mine, others = blocks[..., own, own, :, :], blocks[..., theirs, theirs, :, :]
        spread = mine + others - blocks[..., own, theirs, :, :] - blocks[..., theirs, own, :, :]
        return np.where(self.swarm.present[..., None, None], spread, 0.0)

    @cached_property
    def _incidence(self) -> Array:
        """B, shape (N, N n): +1 for who looks, -1 for who is looked at, 0 for padding."""
        agents, slots = self.swarm.neighbours.shape
        own, edges = np.repeat(np.arange(agents), slots), np.arange(agents * slots)
        B = np.zeros((agents, agents * slots))
        B[own, edges] = 1.0
        B[self.swarm.neighbours.ravel(), edges] -= 1.0
        return B * self.swarm.present.ravel()

    @cached_property
    def _pairs(self) -> Array:
        """What an edge adds to the information of each pair of agents, shape (N N, N n)."""
        B = self._incidence
        return (B[:, None, :] * B[None, :, :]).reshape(-1, B.shape[-1])
