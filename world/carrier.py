"""The world's side of a run over processes: what is sensed goes to the medium, what agents do and the verdicts come back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array
from netem.core.plain import from_plain
from netem.faults.fault import Fault
from netem.faults.timeline import Timeline
from netem.medium.entry import Entry
from netem.processes.supervised import Supervisor, called
from netem.wire import messages
from netem.wire.arrays import CODE, WHOLE, numbers, packed
from netem.wire.carrier import Session, await_heard
from netem.wire.intake import Intake
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering, Sequences
from netem.wire.session import HUB, WORLD
from netem.wire.wrong import WireError, Wrong
from world.acts import Acts, Done
from world.books.kept import Kept
from world.brief import WorldBrief
from world.physics.world import Scene

_COLUMNS = {"odd": 5, "apart": 4, "dropped": 5, "released": 4}  # of what a journal lists


class ProcessesActed(NamedTuple):
    """What came back from all agents.

    Parameters
    ----------
    acts
        What those who are awake said, by number.
    done
        The arrays in it, of all.
    """

    acts: Mapping[int, messages.Act]
    done: Done

    @property
    def input(self) -> Array:
        """What they steer, shape (N, D)."""
        return self.done.input


class ZenohCarrier:
    """Carries the messages of a world over the network.

    Parameters
    ----------
    session, supervisor, brief
        Where, watched by whom, and of which world.
    meanwhile
        What to do in a tick while the agents work on it.

    Attributes
    ----------
    entries
        What became of the messages of ticks; whoever has written it down takes it out.
    kept
        How everybody kept their time, in a run in real time; likewise.
    intake
        What becomes of wrong messages.
    """

    def __init__(
        self, session: Session, supervisor: Supervisor, brief: WorldBrief, meanwhile: Callable[[int], None]
    ) -> None:
        keys, world = Keys(brief.run), brief.world
        self._world, self._supervisor, self._meanwhile = world, supervisor, meanwhile
        self.timeline = Timeline(world.links, brief.faults, brief.triggers)
        self.intake = Intake(brief.trust)
        supervisor.counts(lambda: self.intake.refused)
        dimension = world.formation.dimension
        self._reader = Acts(
            keys,
            world.links,
            dimension,
            brief.reports,
            brief.trust.foreign,
            brief.limit,
            in_real_time=brief.pace is not None,
            lost=None if brief.pace is None else supervisor.lost,
        )
        self._acts = session.hears_anybody(keys.act("*"), world.links.agents)
        self._verdicts = Sequences("the medium's")
        self._journal = session.hears(keys.journal, 64)
        self._sense = session.says(keys.sense)
        self._numbers = Numbering()
        self._fired: Sequence[int] = ()
        self._began: float | None = None
        self._awaited: set[int] = set()
        self.entries: dict[int, Entry] = {}
        self.kept: list[Kept] = []
        self.uninstructed = 0

    def await_everybody(self) -> None:
        """Wait until the medium listens."""
        await_heard([self._sense])

    def fire(self, tick: int, triggers: Sequence[int]) -> None:
        """From this tick on, what waited for these triggers holds; the medium and the launcher are told."""
        self._fired = triggers
        self.timeline = self.timeline.fired(triggers, tick)
        self._supervisor.tell("fired", triggers=triggers, k=tick)

    def carry(self, tick: int, scene: Scene, measured: Array) -> ProcessesActed:
        """Publish what is sensed; wait for the verdicts, and for everybody's act."""
        self._move_processes(tick)
        self._publish(tick, scene, measured)
        self._meanwhile(tick)
        journal = self._read_journal(tick)
        self._reader.expect(journal.handed)
        acts = self._read_acts(tick)
        self._supervisor.works(tick)
        if journal.injected is not None:
            self.timeline = self.timeline.facing([from_plain(Fault, fault) for fault in journal.injected])
        self._account(acts)
        self.entries[tick] = entry_of(journal, len(self._world.links))
        return ProcessesActed(acts, self._reader.together(acts))

    def end(self) -> None:
        """The run is over: tell the medium."""
        nothing = np.empty((0, self._world.formation.dimension))
        self._say(self._world.ticks, last=True, measured=nothing, position=nothing)

    def _move_processes(self, tick: int) -> None:
        timeline = self.timeline
        for event, agents in (
            ("kill", timeline.killed(tick)),
            ("restart", timeline.restarted(tick)),
            ("pause", timeline.paused(tick)),
            ("resume", timeline.resumed(tick)),
        ):
            if agents:
                self._supervisor.tell(event, agents=agents, remembering=timeline.remembering(tick), k=tick)
                self._await_moved(event)
        for agent in timeline.restarted(tick):
            self._reader.restart(agent)

    def _await_moved(self, event: str) -> None:
        self._supervisor.await_order(event)

    def _publish(self, tick: int, scene: Scene, measured: Array) -> None:
        fired, self._fired = list(self._fired), ()
        self._say(
            tick,
            measured=measured,
            position=scene.position,
            motion=self._world.odometry(scene),
            sightings=self._sightings(tick, scene),
            flown=self._world.told(tick),
            fired=fired,
        )

    def _say(
        self,
        tick: int,
        *,
        measured: Array,
        position: Array,
        motion: Array | None = None,
        sightings: list[messages.Sighted] | None = None,
        flown: Array | None = None,
        fired: Sequence[int] = (),
        last: bool = False,
    ) -> None:
        sense = messages.Sense(
            k=tick,
            src=WORLD,
            seq=self._numbers.next("sense"),
            last=last,
            measured=packed(measured),
            position=packed(position),
            motion=None if motion is None else packed(motion),
            sightings=sightings,
            fired=list(fired),
            flown=None if flown is None else packed(flown),
            began=self._began,
        )
        self._sense.say(messages.pack(sense))

    def _sightings(self, tick: int, scene: Scene) -> list[messages.Sighted] | None:
        sighting = self._world.sighting(tick, scene)
        if sighting is None:
            return None
        return [
            messages.Sighted(position=packed(position), done=bool(done), by=int(by), method=int(method))
            for position, done, by, method in zip(*sighting, strict=True)
        ]

    def _read_journal(self, tick: int) -> messages.Journal:
        self._supervisor.waits(tick, "its journal", lambda: (HUB,))
        journal = messages.unpack(messages.Journal, self._journal.next().data)
        self._verdicts.check("journal", journal.seq)
        if journal.k != tick:
            wrong = Wrong.PAST if journal.k < tick else Wrong.FUTURE
            raise WireError(f"the medium's journal is of tick {journal.k}, the world is in tick {tick}", wrong)
        if len(journal.handed) != self._world.links.agents:
            says = f"expected a number for each of {self._world.links.agents} agents, got {len(journal.handed)}"
            raise WireError(f"the medium: Journal: handed: {says} (see docs/protocol.md)", Wrong.SHAPE)
        return journal

    def _read_acts(self, tick: int) -> dict[int, messages.Act]:
        self._awaited = set((np.flatnonzero(~self.timeline.at(tick).idle) + 1).tolist())
        self._supervisor.waits(tick, "its act", self._idle)
        acts = {}
        while self._awaited:
            act = self.intake.take(self._acts.next(), tick, self._awaited, self._reader)
            if act is not None:
                self._awaited.remove(act.src)
                acts[act.src] = act
        return acts

    def _idle(self) -> list[str]:
        return [called(agent) for agent in sorted(self._awaited)]

    def _account(self, acts: Mapping[int, messages.Act]) -> None:
        """Whoever has heard less than it was handed is counted: the transport has lost it, or the agent is wrong."""
        for agent, act in acts.items():
            if unheard := self._reader.unheard(act):
                self.intake.note(agent, Wrong.UNHEARD, unheard)
                self.uninstructed += unheard


def entry_of(journal: messages.Journal, links: int) -> Entry:
    """What became of the messages of a tick, as the medium tells it, over so many links.

    Raises
    ------
    WireError
        When one of its arrays is of another form.
    """
    return Entry(
        verdicts=numbers(journal.verdicts, "the medium: Journal: verdicts", (-1, links), CODE),
        late=journal.late,
        injected=journal.injected,
        **{
            name: numbers(getattr(journal, name), f"the medium: Journal: {name}", (-1, columns), WHOLE)
            for name, columns in _COLUMNS.items()
        },
    )
