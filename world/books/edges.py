"""The edges of swarms as their agents have them, slot by slot: what was believed, what was measured, and what was true."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from analysis.models.arrays import Array, Mask
from netem.medium.verdict import Verdict, VerdictCodes
from world.physics import sensors
from world.physics.world import World


class EdgesByTick(NamedTuple):
    """In a tick of S swarms side by side, or in many; D dimensions, n slots.

    Parameters
    ----------
    estimate, true
        Relative positions, shape (..., S, N, n, D), in metres.
    covariance
        Upper triangles of the covariances of the estimates, shape (..., S, N, n, D (D + 1) / 2), in square metres.
    nis
        How far off the predictions of those measured were, as estimators say (`analysis.models.reports`), shape (..., S, N, n).
    known, seen
        Which are estimated, and which of these were measured in this tick by estimators that say so, shape (..., S, N, n).
    """

    estimate: Array
    true: Array
    covariance: Array
    nis: Array
    known: Mask
    seen: Mask


def of_swarms(
    world: World,
    *,
    present: Mask,
    position: Array,
    verdicts: VerdictCodes,
    estimate: Array,
    covariance: Array,
    known: Mask,
    nis: Array | None,
) -> EdgesByTick:
    """Edges of all agents of a world, each agent in its swarm.

    Parameters
    ----------
    world
        Of the swarms.
    present
        Which agents take part, shape (..., S N): an edge of another does not count.
    position
        Of all agents, shape (..., S N, D), in metres.
    verdicts
        What became of the measurement of every link, shape (..., L).
    estimate, covariance, known, nis
        As in `world.books.history.Moment`, shape (..., S N, n, *); the last, if the estimator reports it.
    """
    slots, swarms = world.links.slots, world.swarms

    def each(of_agents: Any, axis: int) -> Any:
        """Agents, on this axis from the end, apart by swarms."""
        shape = of_agents.shape
        return of_agents.reshape(*shape[:axis], swarms, shape[axis] // swarms, *shape[len(shape) + axis + 1 :])

    counted = known & present[..., :, None] & present[..., world.links.neighbours]
    # Of a direction an innovation has fewer axes than a position.
    reported = nis is not None and world.sensor.says_positions
    return EdgesByTick(
        estimate=each(estimate, -3),
        true=each(sensors.relative(position, world.links)[..., slots, :], -3),
        covariance=each(np.where(counted[..., None], covariance, 0.0), -3),
        nis=each(np.full(known.shape, np.nan) if nis is None else nis, -2),
        known=each(counted, -2),
        seen=each(reported & counted & (verdicts == Verdict.DELIVERED)[..., slots], -2),
    )
