"""The world as a process (`python -m world`): it senses, waits for every agent to act, and steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from netem.core.clock import Clock, Lockstep
from netem.processes import system_errors
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.repeating import opened
from netem.wire.session import client
from world import flight
from world.books.history import FILE as ARRAYS
from world.books.history import UNTOLD, History, Moment, gather
from world.brief import WorldBrief
from world.carrier import ProcessesActed, ZenohCarrier
from world.flight import FlownTick
from world.physics.world import Scene

if TYPE_CHECKING:
    from world.recording.logbook import RunWriter


class WorldNode:
    """The world of a run on the network.

    Parameters
    ----------
    session, supervisor, brief
        Where, watched by whom, and which world.
    logbook
        Where it is written down.
    """

    def __init__(self, session: Session, supervisor: Supervisor, brief: WorldBrief, logbook: RunWriter) -> None:
        self._world, self._supervisor, self._logbook = brief.world, supervisor, logbook
        self._carrier = ZenohCarrier(session, supervisor, brief, self._meanwhile)
        self._batch = brief.books.batch
        self._flown: list[tuple[Moment, Scene]] = []  # with where each tick led
        self.history = History(brief.world, len(brief.channels), brief.reports)

    @property
    def uninstructed(self) -> int:
        """Messages that were lost though nobody ordered it."""
        return self._carrier.uninstructed

    def await_everybody(self) -> None:
        """Wait until the medium listens."""
        self._carrier.await_everybody()

    def run(self, clock: Clock) -> None:
        """Fly all ticks, and write them down: also those before whatever ends the run early."""
        with system_errors.afterwards(self._write_down):
            for instant in flight.fly(self._world, clock, self._carrier):
                # Both at once: a signal may come between any two lines.
                self._flown.append((self._moment(instant), instant.following))
        self._carrier.end()

    def _meanwhile(self, tick: int) -> None:
        if tick % self._batch == 0:
            self._write_down()

    def _moment(self, instant: FlownTick[ProcessesActed]) -> Moment:
        acted, agents = instant.acted, range(1, self._world.links.agents + 1)
        everybody = [acted.acts.get(agent) for agent in agents]
        return Moment(
            position=instant.scene.position,
            target=self._world.goal(instant.tick, instant.scene),
            measured=instant.measured,
            input=instant.input,
            estimate=acted.done.estimate,
            known=acted.done.known,
            covariance=acted.done.covariance,
            psi=[np.nan if act is None else act.psi for act in everybody],
            feasible=[UNTOLD if act is None or act.feasible is None else int(act.feasible) for act in everybody],
            reports=acted.done.reports,
            entry=acted.entry,
        )

    def _write_down(self) -> None:
        if not self._flown:
            return
        flown, self._flown = self._flown, []
        timeline = self._carrier.timeline
        moments = gather(timeline, self.history.ticks, [moment for moment, _ in flown])
        self.history.extend(moments, flown[-1][1].position)
        self._logbook.write(moments, timeline)
        self._supervisor.tell("tick", k=self.history.ticks, error=float(moments.error[-1]))


def main() -> None:
    """Run the world until the last tick."""
    supervisor = Supervisor()
    brief = supervisor.brief(WorldBrief)
    # These take a second to import: the lifeline is to be watched by then.
    from netem.core.arrow import do_without_pandas
    from world.recording.logbook import RunWriter

    do_without_pandas()
    out = Path(brief.out)
    with supervisor.confessing(), opened(client(brief.login), brief.login, supervisor.lost) as session:
        last: list[Callable[[], None]] = []
        with (
            system_errors.afterwards(lambda: [step() for step in last]),
            RunWriter(out, brief.run, brief.world, brief.channels, brief.reports, brief.books) as logbook,
        ):
            node = WorldNode(session, supervisor, brief, logbook)
            node.await_everybody()
            supervisor.tell("ready")
            supervisor.await_order("go")
            # Where there are arrays the recording is whole: somebody killed here leaves no arrays, and it will be mended.
            last.append(partial(node.history.save, out / ARRAYS))
            with supervisor.confessing():
                node.run(Lockstep(brief.world.ticks))
        supervisor.tell("done", uninstructed=node.uninstructed)
