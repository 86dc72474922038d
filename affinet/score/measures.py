"""What is measured of one run for a score."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from affinet.score.card import Task
from affinet.verdicts import measures
from affinet.verdicts.evidence import Evidence
from affinet.verdicts.metrics import of_run
from analysis.models.arrays import Array

_END = 0.1  # of a run, over which it is seen whether the swarm is lost
_BITS = 8.0  # of a byte


class Measured(NamedTuple):
    """Of one run.

    Parameters
    ----------
    error
        Root mean square of the error that matters, over agents and ticks, in metres: of the formation, of places, of the
        target; infinite where it is no number.
    lost
        Whether the swarm was lost at the end.
    recovery
        How many seconds after the last fault ended the error stayed below what counts as recovered; infinite where it never
        did; NaN where no fault ended.
    nees
        Mean normalised estimation error squared, over the dimension: 1 where covariances are right; NaN where there is none.
    estimation
        Root mean square of the errors of an estimated edge, in metres; NaN where none is estimated.
    delivered
        Which share of the messages offered arrived.
    vacuous
        Whether a fault of it touched nothing.
    """

    error: float
    lost: bool
    recovery: float
    nees: float
    estimation: float
    delivered: float
    vacuous: bool


class Load(NamedTuple):
    """What an agent says: messages a second, and bytes a second as a rate limit counts them."""

    messages: float
    bytes: float


def of(run: Evidence, task: Task) -> Measured:
    """What is measured of a run of a task; one that failed, as a number in it is none, was as bad as can be."""
    with np.errstate(over="ignore", invalid="ignore"):  # of one that has diverged
        error = np.full(run.ticks, np.inf) if run.outcome.verdict == "fail" else _error(run)
        end = error[-max(1, round(_END * run.ticks)) :]
        return Measured(
            error=_root_mean_square(error[~np.isnan(error)]),
            lost=not _root_mean_square(end) <= task.lost,
            recovery=_recovery(run, error, task.recovered),
            nees=_mean(of_run(run, "nees", range(run.ticks))) / run.plan.world.formation.dimension,
            estimation=_estimation(run),
            delivered=_delivered(run),
            vacuous=run.outcome.verdict == "vacuous",
        )


def load_of(plan: Plan) -> Load:
    """What each agent says in a second, to all who hear it."""
    said = plan.profiles[0].message_bits[1:]
    return Load(len(said) / plan.world.dt, float(said.sum()) / _BITS / plan.world.dt)


def _error(run: Evidence) -> Array:
    """Of what matters, in each tick, shape (T,), in metres; NaN where it is not known."""
    _, values = measures.over_time(run.plan, run.timeline, run.arrays)
    return values if run.plan.localizes or run.plan.pursues else np.sqrt(values)


def _root_mean_square(values: Array) -> float:
    mean = float((values * values).mean()) if len(values) else np.nan
    return float(np.sqrt(mean)) if np.isfinite(mean) else np.inf


def _mean(values: Array) -> float:
    there = values[~np.isnan(values)]
    return float(there.mean()) if len(there) else np.nan


def _recovery(run: Evidence, error: Array, level: float) -> float:
    ends = [fault.end for fault in run.timeline.faults if fault.end is not None and fault.end < run.ticks]
    if not ends:
        return np.nan
    after = error[max(ends) :]
    above = np.flatnonzero(~(after < level))
    if not len(above):
        return 0.0
    return np.inf if above[-1] == len(after) - 1 else float(above[-1] + 1) * run.dt


def _estimation(run: Evidence) -> float:
    """Of the errors of all edges together, by how many there are."""
    together = of_run(run, "estimation_error", range(run.ticks))
    edges = (run.arrays["known"] & (run.awake & run.present)[..., None]).sum(axis=(1, 2))
    there = (edges > 0) & ~np.isnan(together)
    return _root_mean_square(together[there] / np.sqrt(edges[there])) if there.any() else np.nan


def _delivered(run: Evidence) -> float:
    booked = run.outcome.messages
    return float(booked["delivered"] / booked["offered"]) if booked["offered"] else np.nan
