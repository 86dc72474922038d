"""The world as a process (`python -m world`): it senses, waits for every agent to act, and steps."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import zenoh

from analysis.models.arrays import Array
from netem.core.plain import from_plain
from netem.faults.fault import Fault
from netem.faults.timeline import Conditions, Timeline
from netem.processes import system_errors
from netem.processes.supervised import Supervisor, called
from netem.wire import messages
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering
from netem.wire.session import HUB, WORLD, await_subscribers, client
from world.acts import Acts
from world.books.history import FILE as ARRAYS
from world.books.history import UNTOLD, ErrorMonitor, History, Moment, gather
from world.brief import WorldBrief
from world.physics.world import Scene

if TYPE_CHECKING:
    from world.recording.logbook import RunWriter


class WorldNode:
    """The world of a run over Zenoh."""

    def __init__(self, session: zenoh.Session, supervisor: Supervisor, brief: WorldBrief) -> None:
        self._brief = brief
        self._world = brief.world
        self._supervisor = supervisor
        self._timeline = self._scripted = Timeline(brief.world.links, brief.faults, brief.triggers)
        keys = Keys(brief.run)
        dimension = brief.world.formation.dimension
        self._reader = Acts(keys, brief.world.links, dimension, brief.reports)
        self._acts = session.declare_subscriber(keys.act("*"), zenoh.handlers.FifoChannel(4096))
        self._journal = session.declare_subscriber(keys.journal, zenoh.handlers.FifoChannel(64))
        self._sense = session.declare_publisher(keys.sense)
        self._numbers = Numbering()
        self._heard = dict.fromkeys(range(1, brief.world.links.agents + 1), 0)
        self._awaited: set[int] = set()
        self._flown: list[tuple[Moment, Scene]] = []  # with where each tick led
        self._batch = brief.books.batch
        self._nobody = messages.Act(0, 0, 0, np.zeros(dimension), [], [], [], np.nan, None, {}, 0)
        self._monitor = ErrorMonitor(brief.world)
        self.uninstructed = 0
        self._unsaid = {name: np.full(shape, np.nan).tolist() for name, shape in brief.reports.items()}
        self.history = History(brief.world, len(brief.channels), brief.reports)

    def await_everybody(self) -> None:
        """Wait until the medium listens."""
        await_subscribers([self._sense])

    def run(self, logbook: RunWriter) -> None:
        """Fly all ticks, and write them down: also those before whatever ends the run early."""
        with system_errors.afterwards(partial(self._write_down, logbook)):
            self._fly(logbook)
        end = messages.Sense(self._world.ticks, WORLD, self._numbers.next("sense"), True, [], [], None, None, [])
        self._sense.put(messages.pack(end))

    def _fly(self, logbook: RunWriter) -> None:
        scene = self._world.begin()
        for tick in range(self._world.ticks):
            fired = self._fire(tick)
            self._move_processes(tick)
            measured = self._world.measure(tick, scene, self._timeline.at(tick))
            self._publish(tick, measured, scene, fired)
            if tick % self._batch == 0:  # while the agents work on this tick
                self._write_down(logbook)
            journal = self._read_journal(tick)
            acts = self._read_acts(tick)
            self._supervisor.works(tick)
            self._hear_of_faults(journal)
            now = self._timeline.at(tick)
            moment = self._moment(scene, measured, journal, acts, now)
            self._monitor.see(tick, scene, self._timeline)
            scene = self._world.step(tick, scene, measured, moment.input, now)
            self._flown.append((moment, scene))  # both at once: a signal may come between any two lines

    def _fire(self, tick: int) -> list[int]:
        fired = self._timeline.due(self._monitor.errors)
        if fired:
            self._scripted, self._timeline = (each.fired(fired, tick) for each in (self._scripted, self._timeline))
            self._supervisor.tell("fired", triggers=fired, k=tick)
        return fired

    def _move_processes(self, tick: int) -> None:
        timeline = self._timeline
        for event, agents in (
            ("kill", timeline.killed(tick)),
            ("restart", timeline.restarted(tick)),
            ("pause", timeline.paused(tick)),
            ("resume", timeline.resumed(tick)),
        ):
            if agents:
                self._supervisor.tell(event, agents=agents, remembering=timeline.remembering(tick), k=tick)
                self._supervisor.await_order(event)
        for agent in self._timeline.restarted(tick):
            self._reader.restart(agent)
            self._heard[agent] = 0

    def _publish(self, tick: int, measured: Array, scene: Scene, fired: list[int]) -> None:
        number, motion = self._numbers.next("sense"), self._world.odometry(scene)
        sense = messages.Sense(
            tick, WORLD, number, False, measured, scene.position, motion, self._sightings(tick, scene), fired
        )
        self._sense.put(messages.pack(sense))

    def _sightings(self, tick: int, scene: Scene) -> list[dict[str, Any]] | None:
        sighting = self._world.sighting(tick, scene)
        if sighting is None:
            return None
        agents = zip(*(field.tolist() for field in sighting), strict=True)
        return [dict(zip(sighting._fields, said, strict=True)) for said in agents]

    def _read_journal(self, tick: int) -> messages.Journal:
        self._supervisor.waits(tick, "its journal", lambda: (HUB,))
        journal = messages.unpack(messages.Journal, self._journal.recv().payload.to_bytes())
        if journal.k != tick:
            raise messages.WireError(f"the medium's journal is of tick {journal.k}, the world is in tick {tick}")
        return journal

    def _hear_of_faults(self, journal: messages.Journal) -> None:
        if journal.injected is not None:
            injected = [from_plain(Fault, fault) for fault in journal.injected]
            self._timeline = self._scripted.facing(injected)

    def _read_acts(self, tick: int) -> dict[int, messages.Act]:
        self._awaited = set((np.flatnonzero(~self._timeline.at(tick).idle) + 1).tolist())
        self._supervisor.waits(tick, "its act", self._idle)
        acts = {}
        while self._awaited:
            sample = self._acts.recv()
            act = self._reader.read(str(sample.key_expr), sample.payload.to_bytes(), tick, self._awaited)
            self._awaited.remove(act.src)
            acts[act.src] = act
        return acts

    def _idle(self) -> list[str]:
        return [called(agent) for agent in sorted(self._awaited)]

    def _moment(
        self, scene: Scene, measured: Array, journal: messages.Journal, acts: dict[int, messages.Act], now: Conditions
    ) -> Moment:
        self._account(journal, acts)
        everybody = [acts.get(agent, self._nobody) for agent in self._heard]
        believed = self._reader.beliefs(acts)
        return Moment(
            position=scene.position,
            target=self._world.goal(journal.k, scene),
            measured=measured,
            input=self._world.flown(scene, np.array([act.input for act in everybody]), now),
            estimate=believed.estimate,
            known=believed.known,
            covariance=believed.covariance,
            psi=[act.psi for act in everybody],
            feasible=[UNTOLD if act.feasible is None else int(act.feasible) for act in everybody],
            reports={
                name: [act.reports.get(name, unsaid) for act in everybody] for name, unsaid in self._unsaid.items()
            },
            fates=journal.fates,
            odd=journal.odd,
            apart=journal.apart,
            late=journal.late,
            dropped=journal.dropped,
            released=journal.released,
            injected=journal.injected,
        )

    def _write_down(self, logbook: RunWriter) -> None:
        if not self._flown:
            return
        flown, self._flown = self._flown, []
        moments = gather(self._timeline, self.history.ticks, [moment for moment, _ in flown])
        self.history.extend(moments, flown[-1][1].position)
        logbook.write(moments, self._timeline)
        self._supervisor.tell("tick", k=self.history.ticks, error=float(moments.error[-1]))

    def _account(self, journal: messages.Journal, acts: dict[int, messages.Act]) -> None:
        """What the agents say they heard must be what the medium says it delivered, message by message."""
        for agent, act in acts.items():
            self.uninstructed += abs(journal.handed[agent - 1] - (act.heard - self._heard[agent]))
            self._heard[agent] = act.heard


def main() -> None:
    """Run the world until the last tick."""
    supervisor = Supervisor()
    brief = supervisor.brief(WorldBrief)
    from world.recording.logbook import RunWriter  # takes a second to import: the lifeline is to be watched by then

    out = Path(brief.out)
    with supervisor.confessing(), zenoh.open(client(brief.login)) as session:
        node = WorldNode(session, supervisor, brief)
        last: list[Callable[[], None]] = []
        with (
            system_errors.afterwards(lambda: [step() for step in last]),
            RunWriter(out, brief.run, brief.world, brief.channels, brief.books) as logbook,
        ):
            node.await_everybody()
            supervisor.tell("ready")
            supervisor.await_order("go")
            # Where there are arrays the recording is whole: somebody killed here leaves no arrays, and it will be mended.
            last.append(partial(node.history.save, out / ARRAYS))
            with supervisor.confessing():
                node.run(logbook)
        supervisor.tell("done", uninstructed=node.uninstructed)
