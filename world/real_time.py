"""The world's side of a run in real time: it senses when a tick begins, and flies what was commanded by its end."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

from analysis.models.arrays import Array
from netem.core.pace import Pace
from netem.core.plain import from_plain
from netem.faults.fault import Fault
from netem.processes.supervised import Supervisor, called
from netem.processes.wall_time import RealTime, WallTime, freeze_garbage
from netem.wire import messages
from netem.wire.carrier import Session
from netem.wire.session import HUB, WORLD
from world.books.kept import Kept
from world.brief import WorldBrief
from world.carrier import ProcessesActed, ZenohCarrier, entry_of
from world.physics.world import Scene

_START_S = 30.0  # which a process may take to start that is new while a run flies, on a busy machine


class TooLate(RuntimeError):
    """A process was later than a run in real time allows."""


class RealTimeCarrier(ZenohCarrier):
    """Carries the messages of a world whose time does not wait.

    Parameters
    ----------
    session, supervisor, brief, meanwhile
        As of a `ZenohCarrier`.
    """

    def __init__(
        self, session: Session, supervisor: Supervisor, brief: WorldBrief, meanwhile: Callable[[int], None]
    ) -> None:
        super().__init__(session, supervisor, brief, meanwhile)
        assert brief.pace is not None, "of a run in real time"
        self._pace: Pace = brief.pace
        self._newest: dict[int, messages.Act] = {}
        self._spoke: dict[int, int] = {}
        self._slept: set[int] = set()
        self._journaled = 0

    @property
    def clock(self) -> Iterator[int]:
        """The ticks of the run, which begins when this is first asked for the next."""
        freeze_garbage()
        self._wall = WallTime.soon(self._pace.factor)
        self._began = self._wall.began
        yield from RealTime(self._world.ticks, self._world.dt, self._wall)

    def carry(self, tick: int, scene: Scene, measured: Array) -> ProcessesActed:
        """Publish what is sensed; at the end of the tick, take what everybody has commanded last."""
        dt = self._world.dt
        late = (self._wall.now() - tick * dt) / self._pace.factor
        self._keep(Kept(tick, WORLD, late, int(late > dt / self._pace.factor)))
        self._supervisor.works(tick)
        self._move_processes(tick)
        self._publish(tick, scene, measured)
        self._meanwhile(tick)
        self._wall.wait_until((tick + 1) * dt)
        self._take_journals()
        self._take_acts(tick)
        acts = {agent: act for agent, act in self._newest.items() if not self.timeline.at(tick).idle[agent - 1]}
        return ProcessesActed(acts, self._reader.together(acts))

    def end(self) -> None:
        """The run is over: tell the medium, and wait for what it still has to tell."""
        super().end()
        while self._journaled < self._world.ticks:
            self._supervisor.waits(self._world.ticks, "its journal", lambda: (HUB,))
            self._take_journal(self._journal.next().data)

    def _await_moved(self, event: str) -> None:
        """Nobody waits for it."""

    def _move_processes(self, tick: int) -> None:
        super()._move_processes(tick)
        for agent in self.timeline.killed(tick):
            self._newest.pop(agent, None)
        for agent in self.timeline.resumed(tick):
            self._spoke[agent] = tick
            self._slept.add(agent)
        for agent in self.timeline.restarted(tick):
            self._spoke[agent] = tick + round(_START_S * self._pace.factor / self._world.dt)

    def _take_journals(self) -> None:
        for arrived in self._journal.waiting():
            self._take_journal(arrived.data)

    def _take_journal(self, data: bytes) -> None:
        journal = messages.unpack(messages.Journal, data)
        self._verdicts.check("journal", journal.seq)
        if journal.injected is not None:
            self.timeline = self.timeline.facing([from_plain(Fault, fault) for fault in journal.injected])
        self.entries[journal.k] = entry_of(journal, len(self._world.links))
        self._journaled = journal.k + 1
        if journal.punctuality is not None:
            self._keep(Kept(journal.k, HUB, journal.punctuality.late, journal.punctuality.missed))

    def _take_acts(self, tick: int) -> None:
        idle = self.timeline.at(tick).idle
        for arrived in self._acts.waiting():
            act = self.intake.take(arrived, tick, (), self._reader)
            if act is None or idle[act.src - 1]:  # what it said before it was stopped
                continue
            self._newest[act.src] = act
            self._spoke[act.src] = tick
            if act.src in self._slept:  # what it missed meanwhile is no fault of its own
                self._slept.remove(act.src)
            elif act.punctuality is not None:
                self._keep(Kept(act.k, called(act.src), act.punctuality.late, act.punctuality.missed))
        for agent in (np.flatnonzero(~idle) + 1).tolist():
            silent = (tick - self._spoke.get(agent, 0)) * self._world.dt / self._pace.factor
            if silent > self._pace.late:
                raise TooLate(
                    f"{called(agent)} has not acted for {silent:.3f} s; time.real.late is {self._pace.late:g} s"
                )

    def _keep(self, kept: Kept) -> None:
        self.kept.append(kept)
        if kept.late > self._pace.late:
            raise TooLate(
                f"{kept.process} was late by {kept.late:.3f} s in tick {kept.tick}; "
                f"time.real.late is {self._pace.late:g} s"
            )
