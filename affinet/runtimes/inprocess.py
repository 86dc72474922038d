"""Runtime 1: a whole swarm in this process, all agents as one batch.

The world, the medium and the agents are the ones the processes run; only the carrying of messages differs. The answers are
equal bit for bit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout

import numpy as np

from affinet.planning.plan import Plan
from affinet.runtimes.array_carrier import ArrayCarrier, BatchActed
from analysis.models.arrays import Array, Integers, chosen
from netem.core.clock import Lockstep
from netem.faults.timeline import Timeline
from netem.medium.entry import Entry
from netem.processes.user_code import UserCodeError
from world import flight
from world.books.history import UNTOLD, Moment, Moments, gather
from world.flight import FlownTick

BatchTick = FlownTick[BatchActed]


class InProcessSwarm:
    """A run in this process.

    Parameters
    ----------
    plan
        What to fly.

    Raises
    ------
    ScenarioError, PlanError
        When it needs several processes.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._carrier = ArrayCarrier(plan)

    @property
    def timeline(self) -> Timeline:
        """The faults of the run, as far as they are known by now."""
        return self._carrier.timeline

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return self._carrier.in_flight

    @property
    def under_way(self) -> Integers:
        """Messages under way on each link, shape (L,)."""
        return self._carrier.under_way

    def fly(
        self,
        watch: Callable[[Moments, Array], None],
        batch: int,
        book: Callable[[Entry, int], None] | None = None,
    ) -> None:
        """All ticks.

        Parameters
        ----------
        watch, batch
            Who sees so many ticks at a time, and where the last of them led.
        book
            Who is told what the medium did in each tick, and how many messages are under way after it, if anybody.

        Raises
        ------
        UserCodeError
            When estimator or law do something wrong; `watch` has seen the ticks before.
        """
        flown = list[tuple[BatchTick, Moment]]()
        # What estimators print goes where their processes' logs would have it, and not between what the command says.
        with np.errstate(over="ignore", invalid="ignore"), redirect_stdout(sys.stderr):
            try:
                for instant in self.ticks():
                    flown.append((instant, self.moment(instant)))
                    if book:
                        book(flown[-1][1].entry, self.in_flight)
                    if len(flown) == batch:
                        flown = self._show(watch, flown)
            except UserCodeError:
                self._show(watch, flown)
                raise
            self._show(watch, flown)

    def _show(
        self, watch: Callable[[Moments, Array], None], flown: list[tuple[BatchTick, Moment]]
    ) -> list[tuple[BatchTick, Moment]]:
        if flown:
            gathered = gather(self.timeline, flown[0][0].tick, [moment for _, moment in flown])
            watch(gathered, flown[-1][0].following.position)
        return []

    def ticks(self) -> Iterator[BatchTick]:
        """Tick after tick."""
        return flight.fly(self._plan.world, Lockstep(self._plan.world.ticks), self._carrier)

    def moment(self, instant: BatchTick) -> Moment:
        """What is written down of a tick."""
        estimate, awake = instant.acted.action.estimate, instant.acted.relayed.awake
        real = self._plan.world.links.present & awake[:, None]
        return Moment(
            position=instant.scene.position,
            target=self._plan.world.goal(instant.tick, instant.scene),
            measured=instant.measured,
            input=instant.input,
            estimate=np.where(real[..., None], estimate.relative, 0.0),
            known=estimate.known & real,
            covariance=np.where(real[..., None], estimate.spread, 0.0),
            psi=np.where(awake, estimate.psi, np.nan),
            feasible=np.where(awake, UNTOLD if estimate.feasible is None else estimate.feasible, UNTOLD),
            reports={name: chosen(~awake, np.nan, said) for name, said in estimate.reports.items()},
            entry=instant.acted.relayed.entry,
        )
