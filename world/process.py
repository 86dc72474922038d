"""The world as a process (`python -m world`): it senses, waits for every agent to act, and steps."""

from __future__ import annotations

from collections.abc import Callable
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
from world.books.archive import Archive
from world.books.history import ARRAYS, UNTOLD, Moment, gather
from world.brief import WorldBrief
from world.carrier import ProcessesActed, ZenohCarrier
from world.flight import FlownTick
from world.real_time import RealTimeCarrier

if TYPE_CHECKING:
    from world.recording.logbook import RunWriter


class WorldNode:
    """The world of a run on the network.

    Parameters
    ----------
    session, supervisor, brief
        Where, watched by whom, and which world.
    archive, logbook
        Where it is written down.
    """

    def __init__(
        self, session: Session, supervisor: Supervisor, brief: WorldBrief, archive: Archive, logbook: RunWriter
    ) -> None:
        self._world, self._supervisor, self._archive, self._logbook = brief.world, supervisor, archive, logbook
        self._carrier, self._clock = _of_time(session, supervisor, brief, self._meanwhile)
        self._batch = brief.books.batch
        self._flown: dict[int, FlownTick[ProcessesActed]] = {}

    @property
    def uninstructed(self) -> int:
        """Messages that were lost though nobody ordered it."""
        return self._carrier.uninstructed

    def await_everybody(self) -> None:
        """Wait until the medium listens."""
        self._carrier.await_everybody()

    def run(self) -> None:
        """Fly all ticks, and write them down: also those before whatever ends the run early."""
        with system_errors.afterwards(self._write_down):
            for instant in flight.fly(self._world, self._clock, self._carrier):
                self._flown[instant.tick] = instant
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
            entry=self._carrier.entries[instant.tick],
        )

    def _write_down(self) -> None:
        first, entries = self._archive.ticks, self._carrier.entries
        following = first
        while following in self._flown and following in entries:
            following += 1
        if following == first:
            return
        kept, self._carrier.kept = self._carrier.kept, []
        self._logbook.write_kept(kept)
        timeline = self._carrier.timeline
        moments = gather(timeline, first, [self._moment(self._flown[tick]) for tick in range(first, following)])
        self._archive.extend(moments, self._flown[following - 1].following.position)
        self._logbook.write(moments, timeline)
        self._supervisor.tell("tick", k=self._archive.ticks, error=float(moments.error[-1]))
        for tick in range(first, following):  # at the end: a signal may come between any two lines
            del self._flown[tick], entries[tick]


def _of_time(
    session: Session, supervisor: Supervisor, brief: WorldBrief, meanwhile: Callable[[int], None]
) -> tuple[ZenohCarrier, Clock]:
    if brief.pace is None:
        return ZenohCarrier(session, supervisor, brief, meanwhile), Lockstep(brief.world.ticks)
    carrier = RealTimeCarrier(session, supervisor, brief, meanwhile)
    return carrier, carrier.clock


def _joined(supervisor: Supervisor, brief: WorldBrief) -> Session:
    return opened(client(brief.login), brief.login, supervisor.lost, in_real_time=brief.pace is not None)


def main() -> None:
    """Run the world until the last tick."""
    supervisor = Supervisor()
    brief = supervisor.brief(WorldBrief)
    # These take a second to import: the lifeline is to be watched by then.
    from netem.core.arrow import do_without_pandas
    from world.recording.logbook import RunWriter

    do_without_pandas()
    out = Path(brief.out)
    with supervisor.confessing(), _joined(supervisor, brief) as session:
        with (
            Archive(out / ARRAYS, brief.world, len(brief.channels), brief.reports) as archive,
            RunWriter(out, brief.run, brief.world, brief.channels, brief.reports, brief.books, brief.pace) as logbook,
        ):
            node = WorldNode(session, supervisor, brief, archive, logbook)
            node.await_everybody()
            supervisor.tell("ready")
            supervisor.await_order("go")
            with supervisor.confessing():
                node.run()
        supervisor.tell("done", uninstructed=node.uninstructed)
