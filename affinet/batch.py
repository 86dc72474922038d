"""Many runs of one plan, flown side by side: what comes of each, tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import reduce
from typing import Any

import numpy as np

from affinet.inprocess import Swarm
from affinet.plan import Plan
from affinet.side_by_side import side_by_side
from analysis import consistency, metrics
from netem.links import Mask
from world.edges import of_swarms
from world.formation import Array
from world.history import Moment

# As many as fit into a cache of a few megabytes together; more at once are not faster.
_AT_ONCE = 50


@dataclass(frozen=True)
class Runs:
    """What came of many runs.

    Parameters
    ----------
    seconds
        Of the ticks kept, shape (T,).
    error
        Tracking error (15) in those ticks, shape (R, T), in square metres; NaN or infinite where a run has diverged.
    mean_error
        Its mean over all ticks of each run, shape (R,).
    psi
        Convergence indicators (16) in those ticks, shape (R, T, N).
    procrustes, estimation_error, covariance_trace
        As in `analysis.metrics`, in those ticks, shape (R, T), in metres, metres and square metres.
    nees, nis
        Means over the edges, as in `analysis.consistency`, in those ticks, shape (R, T); NaN where no edge counts.
    """

    seconds: Array
    error: Array
    mean_error: Array
    psi: Array
    procrustes: Array
    estimation_error: Array
    covariance_trace: Array
    nees: Array
    nis: Array

    def together(self, other: Runs) -> Runs:
        """These runs and others of the same ticks."""
        joined = {
            field.name: np.concatenate([getattr(self, field.name), getattr(other, field.name)])
            for field in fields(self)
            if field.name != "seconds"
        }
        return Runs(self.seconds, **joined)


def fly_all(plan: Plan, seeds: Sequence[int], every: int) -> Runs:
    """The runs of a plan with each of these seeds.

    Parameters
    ----------
    plan, seeds
        What to fly, and with which draws.
    every
        Ticks from one that is kept to the next.

    Raises
    ------
    NotABatch
        When the plan cannot be flown side by side.
    """
    parts = [_fly(plan, seeds[first : first + _AT_ONCE], every) for first in range(0, len(seeds), _AT_ONCE)]
    return reduce(Runs.together, parts)


def _fly(plan: Plan, seeds: Sequence[int], every: int) -> Runs:
    together, size = side_by_side(plan, seeds), plan.world.formation.agents
    swarm = Swarm(together)
    errors: list[Array] = []
    kept: list[dict[str, Array]] = []

    def of_runs(array: Any) -> Any:
        return array.reshape(len(seeds), size, *array.shape[1:])

    with np.errstate(over="ignore", invalid="ignore"):  # of runs that diverge
        for instant in swarm.ticks():
            position, present = of_runs(instant.scene.position), of_runs(~swarm.timeline.at(instant.tick).absent)
            target = plan.world.target(instant.tick)
            errors.append(metrics.tracking_error(position, target, present))
            if instant.tick % every == 0:
                kept.append(_looked_at(together, present, swarm.moment(instant), of_runs))
        error = np.stack(errors, axis=1)
        mean_error = error.mean(axis=1)
    return Runs(
        seconds=np.arange(0, error.shape[1], every, dtype=np.float64) * plan.world.dt,
        error=error[:, ::every],
        mean_error=mean_error,
        **{name: np.stack([one[name] for one in kept], axis=1) for name in kept[0]},
    )


def _looked_at(plan: Plan, present: Mask, moment: Moment, of_runs: Callable[[Any], Any]) -> dict[str, Array]:
    """What is kept of a tick of all runs of a plan; `of_runs` splits what begins with all agents into (R, N)."""
    formation = plan.world.formation
    nominal = formation.nominal[: formation.agents // plan.world.swarms]
    edges = of_swarms(
        plan.world,
        position=moment.position,
        measured=moment.measured,
        fates=moment.fates[0],
        estimate=moment.estimate,
        covariance=moment.covariance,
        known=moment.known,
    )
    innovations = consistency.of_innovations(edges.estimate, edges.measured, edges.covariance, edges.R, edges.seen)
    return {
        "psi": of_runs(moment.psi),
        "procrustes": metrics.procrustes_error(of_runs(moment.position), nominal, present),
        "estimation_error": metrics.estimation_error(edges.estimate, edges.true, edges.known),
        "covariance_trace": metrics.covariance_trace(edges.covariance, formation.dimension),
        "nees": consistency.of_errors(edges.estimate, edges.true, edges.covariance, edges.known).mean,
        "nis": innovations.mean,
    }
