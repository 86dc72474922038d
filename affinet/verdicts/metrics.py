"""The metrics of a swarm in a tick, by name: for checkers, and for the figures and claims of studies.

A metric joins by its function in `analysis/metrics` and its line in `METRICS`: then `below("its name", ...)` checks it of a
run, and a study draws and judges it as a quantity.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from affinet.verdicts.evidence import Evidence
from analysis.metrics import consistency, errors
from analysis.models.arrays import Array, Mask
from analysis.models.reports import NIS
from world.books.edges import EdgesByTick, of_swarms
from world.physics.world import World


class Seen(NamedTuple):
    """What is looked at of S swarms, in a tick or in many.

    Parameters
    ----------
    position
        Of the agents, shape (..., S, N, D), in metres.
    present
        Who takes part, shape (..., S, N).
    nominal
        Their places in the formation, shape (N, D), in metres.
    edges
        Of all agents.
    """

    position: Array
    present: Mask
    nominal: Array
    edges: EdgesByTick


class Metric(NamedTuple):
    """What it is called, its unit, its value of each swarm, shape (..., S), and where there is something to take it of."""

    says: str
    unit: str
    of: Callable[[Seen], Array]
    there: Callable[[Seen], Mask]


def _somebody(seen: Seen) -> Mask:
    return np.asarray(seen.present.any(axis=-1))


def _some_edge(seen: Seen) -> Mask:
    return np.asarray(seen.edges.known.any(axis=(-2, -1)))


def _nis(seen: Seen) -> Array:
    return consistency.of_innovations(seen.edges.nis, seen.edges.seen).mean


METRICS: Mapping[str, Metric] = {
    "procrustes": Metric(
        "Procrustes error",
        "m",
        lambda seen: errors.procrustes_error(seen.position, seen.nominal, seen.present),
        _somebody,
    ),
    "estimation_error": Metric(
        "estimation error",
        "m",
        lambda seen: errors.estimation_error(seen.edges.estimate, seen.edges.true, seen.edges.known),
        _some_edge,
    ),
    "covariance_trace": Metric(
        "trace of the covariances",
        "m²",
        lambda seen: errors.covariance_trace(seen.edges.covariance, seen.nominal.shape[-1]),
        _some_edge,
    ),
    "nees": Metric(
        "normalised estimation error squared",
        "",
        lambda seen: (
            consistency.of_errors(seen.edges.estimate, seen.edges.true, seen.edges.covariance, seen.edges.known).mean
        ),
        _some_edge,
    ),
    "nis": Metric(
        "normalised innovation squared",
        "",
        _nis,
        lambda seen: ~np.isnan(_nis(seen)),  # NaN of an edge that is measured for the first time
    ),
}


_OF_POSITIONS = frozenset(
    {"procrustes", "estimation_error", "nees"}
)  # of a flight without a reference nobody knows them


def seen(world: World, present: Mask, verdicts: Any, of_agents: Mapping[str, Any]) -> Seen:
    """What is looked at of the swarms of a world.

    Parameters
    ----------
    world
        Of the swarms.
    present
        Which agents take part, shape (..., S N).
    verdicts
        What became of the measurements, shape (..., L).
    of_agents
        `position`, `estimate`, `covariance`, `known` and `nis`, as in `world.books.edges.of_swarms`.
    """
    size = world.formation.agents // world.swarms
    edges = of_swarms(world, present=present, verdicts=verdicts, **of_agents)

    def by_swarm(array: Any, axis: int) -> Any:
        return array.reshape(*array.shape[:axis], world.swarms, size, *array.shape[array.ndim + axis + 1 :])

    return Seen(by_swarm(of_agents["position"], -2), by_swarm(present, -1), world.formation.nominal[:size], edges)


def of_run(evidence: Evidence, name: str, span: range) -> Array:
    """A metric in each of these ticks of a run, shape (T,): NaN where nothing is there, infinite where it is no number."""
    part, arrays = slice(span.start, span.stop), evidence.arrays
    told: dict[str, Any] = {what: arrays[what][part] for what in ("estimate", "covariance")}
    told[NIS] = arrays[NIS][part] if NIS in arrays else None
    awake = (evidence.awake & evidence.present)[part, :, None]
    whole = told | {"position": evidence.position[part], "known": arrays["known"][part] & awake}
    looked_at = seen(evidence.plan.world, evidence.present[part], arrays["verdicts"][part, 0], whole)
    value, there = METRICS[name].of(looked_at)[..., 0], METRICS[name].there(looked_at)[..., 0]
    if name in _OF_POSITIONS:
        there = there & evidence.located[part]
    of_something: Array = np.where(there, np.where(np.isnan(value), np.inf, value), np.nan)
    return of_something
