"""Many runs of one plan, flown side by side: what comes of each, tick by tick."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from affinet.inprocess import Swarm
from affinet.plan import Plan
from affinet.side_by_side import side_by_side
from analysis.metrics import tracking_error
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
    """

    seconds: Array
    error: Array
    mean_error: Array
    psi: Array


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
    return Runs(
        parts[0].seconds,
        np.concatenate([part.error for part in parts]),
        np.concatenate([part.mean_error for part in parts]),
        np.concatenate([part.psi for part in parts]),
    )


def _fly(plan: Plan, seeds: Sequence[int], every: int) -> Runs:
    runs, agents = len(seeds), plan.world.formation.agents
    errors: list[Array] = []
    indicators: list[Array] = []

    def see(moments: Moments, _: Array) -> None:
        def of_runs(array: Any) -> Any:
            return array.reshape(len(array), runs, agents, *array.shape[2:])

        present = swarm.timeline.present(moments.ticks.tolist())
        errors.append(tracking_error(of_runs(moments.position), of_runs(moments.target), of_runs(present)))
        indicators.append(of_runs(moments.psi)[-moments.first % every :: every])

    swarm = Swarm(side_by_side(plan, seeds))
    swarm.fly(see, _TICKS_AT_ONCE)
    error = np.concatenate(errors).T
    with np.errstate(over="ignore", invalid="ignore"):  # of runs that have diverged
        mean_error = error.mean(axis=1)
    return Runs(
        seconds=np.arange(0, error.shape[1], every, dtype=np.float64) * plan.world.dt,
        error=error[:, ::every],
        mean_error=mean_error,
        psi=np.moveaxis(np.concatenate(indicators), 0, 1),
    )
