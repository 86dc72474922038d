"""Many runs of one plan, flown side by side: what comes of each, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import reduce
from typing import Any

import numpy as np

from affinet.inprocess import Swarm
from affinet.plan import Plan
from affinet.side_by_side import side_by_side
from analysis import metrics
from world.formation import Array
from world.history import Moments

# As many as fit into a cache of a few megabytes together; more at once are not faster.
_AT_ONCE = 50
_TICKS_AT_ONCE = 50


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
    """

    seconds: Array
    error: Array
    mean_error: Array
    psi: Array
    procrustes: Array
    estimation_error: Array
    covariance_trace: Array

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
    runs, formation, links = len(seeds), plan.world.formation, plan.world.links
    seen: list[dict[str, Array]] = []

    def see(moments: Moments, _: Array) -> None:
        def of_runs(array: Any) -> Any:
            return array.reshape(len(array), runs, formation.agents, *array.shape[2:])

        position = of_runs(moments.position)
        present = of_runs(swarm.timeline.present(moments.ticks.tolist()))
        kept = slice(-moments.first % every, None, every)
        estimate, known, triangles = (
            of_runs(array[kept]) for array in (moments.estimate, moments.known, moments.covariance)
        )
        seen.append(
            {
                "error": metrics.tracking_error(position, of_runs(moments.target), present),
                "psi": of_runs(moments.psi)[kept],
                "procrustes": metrics.procrustes_error(position[kept], formation.nominal, present[kept]),
                "estimation_error": metrics.estimation_error(estimate, position[kept], links.neighbours, known),
                "covariance_trace": metrics.covariance_trace(triangles, formation.dimension),
            }
        )

    swarm = Swarm(side_by_side(plan, seeds))
    swarm.fly(see, _TICKS_AT_ONCE)
    by_run = {name: np.moveaxis(np.concatenate([part[name] for part in seen]), 0, 1) for name in seen[0]}
    error = by_run.pop("error")
    with np.errstate(over="ignore", invalid="ignore"):  # of runs that have diverged
        mean_error = error.mean(axis=1)
    return Runs(
        seconds=np.arange(0, error.shape[1], every, dtype=np.float64) * plan.world.dt,
        error=error[:, ::every],
        mean_error=mean_error,
        **by_run,
    )
