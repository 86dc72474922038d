"""A world that is outside: what robots measure is heard of their driver, and what agents command it has them fly."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from analysis.models.arrays import Array
from netem.faults.conditions import Conditions
from netem.processes.supervised import Supervisor
from netem.wire import messages
from netem.wire.arrays import packed
from netem.wire.carrier import Session, await_heard
from netem.wire.intake import Intake
from netem.wire.keys import Keys
from netem.wire.sequence import Numbering
from netem.wire.session import DRIVER, WORLD
from world.books.kept import Kept
from world.brief import WorldBrief
from world.physics import sensors
from world.physics.world import Scene
from world.real_time import TooLate
from world.robots import OnRobot, Robots


class DrivenWorld:
    """The world of a run whose robots fly outside.

    Parameters
    ----------
    session, supervisor, brief
        Where, watched by whom, and of which swarm.
    intake, keep
        What becomes of wrong messages; and who is told how the driver keeps its time, in a run in real time.
    """

    def __init__(
        self,
        session: Session,
        supervisor: Supervisor,
        brief: WorldBrief,
        intake: Intake,
        keep: Callable[[Kept], None],
    ) -> None:
        keys, world = Keys(brief.run), brief.world
        self._world, self._supervisor, self._intake, self._keep = world, supervisor, intake, keep
        self._pace, self._in_real_time = brief.pace, brief.pace is not None
        self._agents = range(1, world.links.agents + 1)
        self._reader = Robots(
            keys,
            world.links,
            world.formation.dimension,
            brief.positioned,
            in_real_time=self._in_real_time,
            lost=supervisor.lost if self._in_real_time else None,
        )
        self._ear = session.hears_anybody(keys.measured("*"), world.links.agents)
        self._voices = {agent: session.says(keys.command(agent)) for agent in self._agents}
        self._numbers, self._heard = Numbering(), dict.fromkeys(self._agents, 0)
        self._measured = np.full((len(world.links), world.formation.dimension), np.nan)
        self._position = np.full((world.links.agents, world.formation.dimension), np.nan)

    def await_everybody(self) -> None:
        """Wait until the driver listens."""
        await_heard(self._voices.values())

    def begin(self) -> Scene:
        """The scene in tick 0, when there is news of all robots."""
        self._take_in(self._of_all(0))
        return self._world.begin()._replace(position=self._position, measured=np.full_like(self._measured, np.nan))

    def measure(self, tick: int, scene: Scene, now: Conditions) -> Array:
        """What was measured on the robots, shape (L, D), with sensors that fail; NaN where nothing was."""
        return self._world.astray(tick, scene, self._measured, now)

    def flown(self, tick: int, scene: Scene, commanded: Array, now: Conditions) -> Array:
        """The inputs that the robots are to fly when their agents command these, shape (N, D)."""
        return self._world.flown(tick, scene, commanded, now)

    def goal(self, tick: int, scene: Scene) -> Array:
        """Where every agent should be, shape (N, D)."""
        return self._world.goal(tick, scene)

    def step(self, tick: int, scene: Scene, measured: Array, flown: Array, now: Conditions) -> Scene:  # noqa: ARG002
        """The scene of the next tick: the driver is told what to fly, and says what comes of it."""
        self._command(tick, flown)
        self._take_in(self._since(tick + 1) if self._in_real_time else self._of_all(tick + 1))
        return scene._replace(position=self._position, measured=sensors.last(scene.measured, measured))

    def end(self) -> None:
        """The run is over: everybody is to stand still."""
        self._command(self._world.ticks, np.zeros_like(self._position), last=True)

    def _command(self, tick: int, flown: Array, *, last: bool = False) -> None:
        for agent, voice in self._voices.items():
            number = self._numbers.next(f"command {agent}")
            told = packed(flown[agent - 1])
            command = messages.Command(k=tick, src=WORLD, seq=number, agent=agent, input=told, last=last)
            voice.say(messages.pack(command))

    def _of_all(self, tick: int) -> list[OnRobot]:
        """News of each robot in a tick; nothing happens before."""
        awaited, news = set(self._agents), []
        self._supervisor.waits(tick, "what its robots measure", lambda: (DRIVER,))
        while awaited:
            said = self._intake.take(self._ear.next(), tick, awaited, self._reader)
            if said is not None:
                awaited.remove(said.agent)
                news.append(said)
        self._supervisor.works(tick)
        return news

    def _since(self, tick: int) -> list[OnRobot]:
        """News that has come by now."""
        read = (self._intake.take(arrived, tick, (), self._reader) for arrived in self._ear.waiting())
        news = [said for said in read if said is not None]
        self._heard |= {said.agent: max(said.tick, self._heard[said.agent]) for said in news}
        self._note_how_late(tick)
        return news

    def _note_how_late(self, tick: int) -> None:
        """How long ago that was of which the last of the robots speaks."""
        assert self._pace is not None, "of a run in real time"
        agent = min(self._heard, key=self._heard.__getitem__)
        behind = max(0, tick - 1 - self._heard[agent])  # the command of the tick before has only just been given
        silent = behind * self._pace.dt / self._pace.factor
        self._keep(Kept(tick - 1, DRIVER, silent, int(behind > 0)))
        if silent > self._pace.late:
            raise TooLate(
                f"the robot of agent {agent} has said nothing of what is measured after tick {self._heard[agent]}, "
                f"{silent:.3f} s ago; time.real.late is {self._pace.late:g} s"
            )

    def _take_in(self, news: Iterable[OnRobot]) -> None:
        """What was measured since the tick before, the newest of each link; who does not say where he is, is where he was."""
        self._measured, self._position = np.full_like(self._measured, np.nan), self._position.copy()
        for said in news:
            self._measured[said.links] = said.measured
            if said.position is not None:
                self._position[said.agent - 1] = said.position
