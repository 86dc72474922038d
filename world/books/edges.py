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
    estimate, true, measured
        Relative positions, shape (..., S, N, n, D), in metres.
    covariance
        Upper triangles of the covariances of the estimates, shape (..., S, N, n, D (D + 1) / 2), in square metres.
    R
        Covariances of the measurements, shape (..., S, N, n, D, D), in square metres.
    known, seen
        Which are estimated, and which of these were measured in this tick, shape (..., S, N, n).
    """

    estimate: Array
    true: Array
    measured: Array
    covariance: Array
    R: Array
    known: Mask
    seen: Mask


def of_swarms(
    world: World,
    *,
    position: Array,
    measured: Array,
    verdicts: VerdictCodes,
    estimate: Array,
    covariance: Array,
    known: Mask,
) -> EdgesByTick:
    """Edges of all agents of a world, each agent in its swarm.

    Parameters
    ----------
    world
        Of the swarms.
    position
        Of all agents, shape (..., S N, D), in metres.
    measured, verdicts
        What the sensors said of every link, shape (..., L, D), in metres, and what became of it, shape (..., L).
    estimate, covariance, known
        As in `world.books.history.Moment`, shape (..., S N, n, *).
    """
    slots, swarms = world.links.slots, world.swarms

    def each(of_agents: Any, axis: int) -> Any:
        """Agents, on this axis from the end, apart by swarms."""
        shape = of_agents.shape
        return of_agents.reshape(*shape[:axis], swarms, shape[axis] // swarms, *shape[len(shape) + axis + 1 :])

    positions = world.sensor.says_positions  # innovations are of them
    said = each(measured[..., slots, :], -3)
    return EdgesByTick(
        estimate=each(estimate, -3),
        true=each(sensors.relative(position, world.links)[..., slots, :], -3),
        measured=said,
        covariance=each(covariance, -3),
        R=world.sensor.spread(said)
        if positions
        else np.broadcast_to(np.eye(said.shape[-1]), (*said.shape, said.shape[-1])),
        known=each(known, -2),
        seen=each(positions & known & (verdicts == Verdict.DELIVERED)[..., slots], -2),
    )
