"""How far off a run was, in what matters of it: where agents are at rest or pursue a target, no formation is tracked."""

from __future__ import annotations

import numpy as np

from affinet.planning.plan import Plan
from analysis.metrics import localization
from analysis.metrics.errors import root_mean_square
from analysis.models.arrays import Array
from netem.core import channels
from netem.faults.timeline import Timeline
from world.books.history import Arrays, by_span
from world.books.localized import FirstMeasurements
from world.physics import sensors
from world.physics.world import World

Figures = dict[str, float | None]


def figures(values: Array) -> Figures:
    """Mean, last and largest of what there is in each tick, shape (T,); None for one that is no finite number."""
    if not len(values):
        return {"mean": None, "final": None, "max": None}
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that has diverged
        found = {"mean": values.mean(), "final": values[-1], "max": values.max()}
    return {name: float(value) if np.isfinite(value) else None for name, value in found.items()}


def errors(plan: Plan, timeline: Timeline, arrays: Arrays) -> dict[str, Figures]:
    """The errors that matter, in metres, of who finds out where it is, pursues a target, or flies outside; none of others.

    `edge_error` is that of estimated relative positions, where physics is not simulated and it is known where agents are.
    `localization_error` is that of the checker `localized`, in the ticks in which there is one; `goal_distance` how far agents
    are from their places about the target, `target_error` how far the target is from where they steer for: root mean squares.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        by_edge = _edge_errors(plan.world, arrays) if plan.may_have_gaps else {}
        if plan.localizes:
            off = _off_places(plan, timeline, arrays)
            return by_edge | {"localization_error": figures(off[~np.isnan(off)])}
        if plan.pursues:
            missed = _off_target(plan, arrays)
            return by_edge | {"goal_distance": figures(np.sqrt(arrays["error"])), "target_error": figures(missed)}
    return by_edge


def over_time(plan: Plan, timeline: Timeline, arrays: Arrays) -> tuple[str, Array]:
    """What matters of a run in each tick, shape (T,), with its name and unit."""
    with np.errstate(over="ignore", invalid="ignore"):
        if plan.localizes:
            return "localization error (m)", _off_places(plan, timeline, arrays)
        if plan.pursues:
            return "target error (m)", _off_target(plan, arrays)
    return "tracking error (m²)", arrays["error"]


def by_agent(plan: Plan, timeline: Timeline, arrays: Arrays) -> tuple[str, Array]:
    """How far off each agent is in each tick, shape (T, N), in metres, in what matters of the run, with its name."""
    ticks = len(arrays["error"])
    if plan.localizes:
        edges = _first_measured(plan, timeline, arrays).edges()
        found = localization.beside(arrays[channels.PLACE], edges) - localization.optimal(edges)
        return "localization error", _length(found)
    if plan.pursues:
        return "target error", _length(_off_the_target(plan, arrays))
    return "error", _length(arrays["position"][:ticks] - arrays["target"])


def _off_places(plan: Plan, timeline: Timeline, arrays: Arrays) -> Array:
    return localization.distance(arrays[channels.PLACE], _first_measured(plan, timeline, arrays).edges())


def _first_measured(plan: Plan, timeline: Timeline, arrays: Arrays) -> FirstMeasurements:
    return FirstMeasurements.of(plan.world, timeline, arrays["measured"], arrays["verdicts"][:, 0])


def _off_target(plan: Plan, arrays: Arrays) -> Array:
    off = _off_the_target(plan, arrays)
    return root_mean_square(off, np.asarray(~np.isnan(off).any(axis=-1)))


def _off_the_target(plan: Plan, arrays: Arrays) -> Array:
    off: Array = arrays["reference"][:, :, 0] - (arrays["target"] - plan.world.formation.nominal)
    return off


def _length(off: Array) -> Array:
    return np.asarray(np.linalg.norm(off, axis=-1), dtype=np.float64)


def _edge_errors(world: World, arrays: Arrays) -> dict[str, Figures]:
    off = np.concatenate([_edge_error(world, span) for span in by_span(arrays)])
    there = off[~np.isnan(off)]
    return {"edge_error": figures(there)} if len(there) else {}


def _edge_error(world: World, span: Arrays) -> Array:
    """How far off estimated relative positions are in each tick, shape (T,), in metres; NaN without any, or a truth."""
    ticks = len(span["error"])
    true = sensors.relative(span["position"][:ticks], world.links)[:, world.links.slots]
    off, known = span["estimate"] - true, span["known"] & ~np.isnan(true).any(axis=-1)
    agents, slots, dimension = off.shape[1:]
    return root_mean_square(off.reshape(ticks, agents * slots, dimension), known.reshape(ticks, agents * slots))
