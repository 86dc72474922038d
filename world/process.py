"""The world as a process (`python -m world`): it senses, waits for every agent to act, and steps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from netem.core.clock import Clock, Lockstep
from netem.faults.timeline import Timeline
from netem.medium.entry import Entry
from netem.processes import system_errors
from netem.processes.background import Background
from netem.processes.supervised import Supervisor
from netem.wire.carrier import Session
from netem.wire.repeating import opened
from netem.wire.session import client
from world import flight
from world.books.archive import Archive
from world.books.history import ARRAYS, UNTOLD, Moment, gather
from world.books.kept import Kept
from world.brief import WorldBrief
from world.carrier import ProcessesActed, ZenohCarrier
from world.driven import DrivenWorld
from world.flight import FlownTick
from world.real_time import RealTimeCarrier

if TYPE_CHECKING:
    from world.recording.logbook import RunWriter


Later = Callable[[Callable[[], None]], None]
Written = tuple[FlownTick[ProcessesActed], Entry]


class WorldNode:
    """The world of a run on the network.

    Parameters
    ----------
    session, supervisor, brief
        Where, watched by whom, and which world.
    archive, logbook, later
        Where it is written down; and what calls something now, or as soon as there is time for it.
    """

    def __init__(
        self,
        session: Session,
        supervisor: Supervisor,
        brief: WorldBrief,
        archive: Archive,
        logbook: RunWriter,
        later: Later,
    ) -> None:
        self._world, self._supervisor, self._archive, self._logbook = brief.world, supervisor, archive, logbook
        self._carrier, self._clock = _of_time(session, supervisor, brief, self._meanwhile)
        self._outside: DrivenWorld | None = None
        if brief.is_outside:
            self._outside = DrivenWorld(
                session, supervisor, brief, self._carrier.intake, lambda kept: self._carrier.kept.append(kept)
            )
        self._batch, self._later = brief.books.batch, later
        self._due = 0
        self._flown: dict[int, FlownTick[ProcessesActed]] = {}

    @property
    def uninstructed(self) -> int:
        """Messages that were lost though nobody ordered it."""
        return self._carrier.uninstructed

    def await_everybody(self) -> None:
        """Wait until the medium listens."""
        self._carrier.await_everybody()
        if self._outside is not None:
            self._outside.await_everybody()

    def run(self) -> None:
        """Fly all ticks, and write them down: also those before whatever ends the run early."""
        with system_errors.afterwards(self._write_down):
            for instant in flight.fly(self._outside or self._world, self._clock, self._carrier):
                self._flown[instant.tick] = instant
            if self._outside is not None:
                self._outside.end()
            self._carrier.end()

    def _meanwhile(self, _tick: int) -> None:
        if self._due + self._batch - 1 in self._carrier.entries:
            self._write_down()

    def _write_down(self) -> None:
        entries, timeline, kept = self._carrier.entries, self._carrier.timeline, self._carrier.kept
        due: list[Written] = []
        while (tick := self._due + len(due)) in self._flown and tick in entries:
            due.append((self._flown[tick], entries[tick]))
        if not due:
            return
        self._later(partial(self._write, due, kept, timeline))
        # At the end: a signal may come between any two lines.
        self._carrier.kept = []
        for tick in range(self._due, self._due + len(due)):
            del self._flown[tick], entries[tick]
        self._due += len(due)

    def _write(self, due: Sequence[Written], kept: Sequence[Kept], timeline: Timeline) -> None:
        first = due[0][0].tick
        if first < self._archive.ticks:  # a signal came before it was noted that they are written
            return
        self._logbook.write_kept(kept)
        moments = gather(timeline, first, [self._moment(flown, entry) for flown, entry in due])
        self._archive.extend(moments, due[-1][0].following.position)
        self._logbook.write(moments, timeline)
        self._supervisor.tell("tick", k=self._archive.ticks, error=float(moments.error[-1]))

    def _moment(self, flown: FlownTick[ProcessesActed], entry: Entry) -> Moment:
        acted, agents = flown.acted, range(1, self._world.links.agents + 1)
        everybody = [acted.acts.get(agent) for agent in agents]
        return Moment(
            position=flown.scene.position,
            target=self._world.goal(flown.tick, flown.scene),
            measured=flown.measured,
            input=flown.input,
            estimate=acted.done.estimate,
            known=acted.done.known,
            covariance=acted.done.covariance,
            psi=[np.nan if act is None else act.psi for act in everybody],
            feasible=[UNTOLD if act is None or act.feasible is None else int(act.feasible) for act in everybody],
            reports=acted.done.reports,
            entry=entry,
        )


def _of_time(
    session: Session, supervisor: Supervisor, brief: WorldBrief, meanwhile: Callable[[int], None]
) -> tuple[ZenohCarrier, Clock]:
    if brief.pace is None:
        return ZenohCarrier(session, supervisor, brief, meanwhile), Lockstep(brief.world.ticks)
    carrier = RealTimeCarrier(session, supervisor, brief, meanwhile)
    return carrier, carrier.clock


def _joined(supervisor: Supervisor, brief: WorldBrief) -> Session:
    return opened(client(brief.login), brief.login, supervisor.lost, in_real_time=brief.pace is not None)


@contextmanager
def _pace_of_writing(brief: WorldBrief) -> Iterator[Later]:
    """In real time what is written must not keep the next tick waiting; in lockstep it is written while agents compute."""
    if brief.pace is None:
        yield lambda call: call()
        return
    with Background() as background:
        yield background.later


def main() -> None:
    """Run the world until the last tick."""
    supervisor = Supervisor()
    brief = supervisor.brief(WorldBrief)
    # These take a second to import: the lifeline is to be watched by then.
    from netem.core.arrow import do_without_pandas
    from world.recording.logbook import RunWriter

    do_without_pandas()
    out = Path(brief.out)
    with (
        supervisor.confessing(),
        _joined(supervisor, brief) as session,
        Archive(out / ARRAYS, brief.world, len(brief.channels), brief.reports) as archive,
        RunWriter(out, brief.run, brief.world, brief.channels, brief.reports, brief.books, brief.pace) as logbook,
    ):
        with supervisor.confessing(), _pace_of_writing(brief) as later:
            node = WorldNode(session, supervisor, brief, archive, logbook, later)
            node.await_everybody()
            supervisor.tell("ready")
            supervisor.await_order("go")
            node.run()
        supervisor.tell("done", uninstructed=node.uninstructed)
