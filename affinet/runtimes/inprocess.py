"""Runtime 1: a whole swarm in this process, all agents as one batch.

The world, the medium and the agents are the ones the processes run; only the carrying of messages differs, and that is
this file. The answers are equal bit for bit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import redirect_stdout
from typing import Any, NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from agents.agent import AgentAction, AgentState, chosen, renew
from agents.brief import Reading
from agents.centre.filter import Centre
from agents.exchange import Fields, Heard
from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels
from netem.core.plain import to_plain
from netem.faults import lie
from netem.faults.timeline import Conditions
from netem.impairments.corrupt import Mark, Marks, corrupted_fields
from netem.medium.in_flight import Delivery, Verdicts, out_of_the_ordinary
from netem.medium.medium import Medium
from netem.medium.verdict import Fate
from netem.processes.user_code import UserCodeError
from world.books.history import UNTOLD, ErrorMonitor, Moment, Moments, gather
from world.physics.world import Scene

Broadcasts = Mapping[str, Fields]


class FlownTick(NamedTuple):
    """A tick as it was flown.

    Parameters
    ----------
    tick
        Its number.
    scene, following
        Where the agents were, and where it led.
    measured
        What the sensors said, shape (L, D), in metres.
    input
        What the bodies flew, shape (N, D).
    action, verdicts, delivery
        What the agents decided and believed, and what the medium made of their messages.
    """

    tick: int
    scene: Scene
    following: Scene
    measured: Array
    input: Array
    action: AgentAction
    verdicts: Verdicts
    delivery: Delivery


class InProcessSwarm:
    """A run in this process.

    Parameters
    ----------
    plan
        What to fly.
    """

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self.timeline = plan.timeline
        self._links = plan.world.links
        self._agents = plan.agents
        self._fields = self._agents.channels()
        self._medium = Medium(plan.world.seed, plan.channels, plan.profiles, self.timeline, plan.recorded())
        self._said: dict[int, Broadcasts] = {}
        self._air = self._medium.begin()
        self._centre = plan.centre
        if self._centre:
            self._whole = self._centre.begin((plan.world.swarms,))

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return self._air.in_flight

    def fly(self, watch: Callable[[Moments, Array], None], batch: int) -> None:
        """All ticks; `watch` sees them, a batch at a time, and where the last of them led.

        Raises
        ------
        UserCodeError
            When estimator or law do something wrong; `watch` has seen the ticks before.
        """
        flown = list[tuple[FlownTick, Moment]]()
        # What estimators print goes where their processes' logs would have it, and not between what the command says.
        with np.errstate(over="ignore", invalid="ignore"), redirect_stdout(sys.stderr):
            try:
                for instant in self.ticks():
                    flown.append((instant, self.moment(instant)))
                    if len(flown) == batch:
                        flown = self._show(watch, flown)
            except UserCodeError:
                self._show(watch, flown)
                raise
            self._show(watch, flown)

    def _show(
        self, watch: Callable[[Moments, Array], None], flown: list[tuple[FlownTick, Moment]]
    ) -> list[tuple[FlownTick, Moment]]:
        if flown:
            gathered = gather(self.timeline, flown[0][0].tick, [moment for _, moment in flown])
            watch(gathered, flown[-1][0].following.position)
        return []

    def ticks(self) -> Iterator[FlownTick]:
        """Tick after tick; a swarm that diverges overflows, and whoever flies it knows."""
        world = self._plan.world
        agents = np.arange(1, self._links.agents + 1)
        fresh = self._agents.init(agents.shape)
        monitor = ErrorMonitor(world)
        scene, state = world.begin(), fresh
        for tick in range(world.ticks):
            self._fire(tick, monitor)
            timeline = self.timeline
            if cold := set(timeline.restarted(tick)) - set(timeline.remembering(tick)):
                state = renew(state, fresh, np.isin(agents, [*cold]))
            now = timeline.at(tick)
            measured = world.measure(tick, scene, now)
            try:
                state, action, verdicts, delivery = self._tick(tick, scene, measured, state)
            except UserCodeError as error:
                error.tick = tick
                raise
            flown = world.flown(scene, np.where(now.idle[:, None], 0.0, action.input), now)
            monitor.see(tick, scene, timeline)
            following = world.step(tick, scene, measured, flown, now)
            yield FlownTick(tick, scene, following, measured, flown, action, verdicts, delivery)
            scene = following

    def _fire(self, tick: int, monitor: ErrorMonitor) -> None:
        if triggers := self.timeline.due(monitor.errors):
            self.timeline = self._medium.timeline = self.timeline.fired(triggers, tick)

    def _tick(
        self, tick: int, scene: Scene, sensed: Array, before: AgentState
    ) -> tuple[AgentState, AgentAction, Verdicts, Delivery]:
        links, now = self._links, self.timeline.at(tick)
        air, verdicts = self._medium.judge(self._air, tick, self._offered(~now.idle), scene.position)
        seen = (verdicts.fate[0] == Fate.DELIVERED)[links.slots] & links.present
        measured = np.where(seen[..., None], sensed[links.slots], 0.0)
        motion = self._plan.world.odometry(scene)
        state, said = self._agents.sense(before, measured, seen, motion)
        self._said[tick] = self._as_told(said, now)
        self._air, delivery = self._medium.deliver(air, tick, verdicts)
        heard = {name: self._hear(name, delivery) for name in self._fields}
        if self._centre:
            heard[channels.CENTRE] = self._from_the_centre(
                self._centre, measured, seen, said[channels.INPUT]["velocity"]
            )
        sighting = self._plan.world.sighting(tick, scene)
        state, action = self._agents.act(state, self._reading(tick), heard, scene.position, motion, sighting)
        if now.idle.any():
            state = renew(state, before, now.idle)
        self._forget(tick)
        return state, action, verdicts, delivery

    def _from_the_centre(self, centre: Centre, measured: Array, seen: Mask, inputs: Array) -> Heard:
        def of_swarms(array: Any) -> Any:
            return array.reshape(self._plan.world.swarms, len(centre.neighbours), *array.shape[1:])

        self._whole, told = centre.step(self._whole, of_swarms(measured), of_swarms(seen), of_swarms(inputs))
        fields = {name: field.reshape(-1, *field.shape[2:]) for name, field in told._asdict().items()}
        return Heard(fields, seen)

    def _reading(self, tick: int) -> Reading:
        """What the clocks say; one reading for all, where they agree, spares looking up the manoeuvre for each."""
        clocks = self.timeline.clock(tick)
        return int(clocks[0]) if (clocks == clocks[0]).all() else clocks

    def _as_told(self, said: Broadcasts, now: Conditions) -> Broadcasts:
        for liar in now.liars if lie.CHANNEL in said else ():
            true, false = said[lie.CHANNEL], lie.told(said[lie.CHANNEL], liar)
            lies = np.isin(np.arange(1, self._links.agents + 1), liar.agents)
            said = {**said, lie.CHANNEL: {name: chosen(lies, false[name], true[name]) for name in true}}
        return said

    def _offered(self, awake: Mask) -> Mask:
        speaks = awake[self._links.src - 1]
        return np.stack([speaks | (name == channels.SENSE) for name in self._plan.channels])

    def _hear(self, channel: str, delivery: Delivery) -> Heard:
        row, links = self._plan.channels.index(channel), self._links
        content = np.where(links.present, delivery.newest[row, links.slots], -1)
        fresh = content >= 0
        spoken = np.unique(content[fresh]).tolist() or [max(self._said)]
        gathered = {name: self._gather(channel, name, content, spoken) for name in self._fields[channel]}
        mark = np.where(fresh, delivery.mark[row, links.slots], np.uint8(Mark.NONE))
        return Heard(self._corrupt(gathered, row, content, mark) if mark.any() else gathered, fresh)

    def _gather(self, channel: str, field: str, content: Integers, spoken: list[int]) -> Any:
        gathered = np.zeros(0)
        for number, tick in enumerate(spoken):
            values = self._said[tick][channel][field][self._links.neighbours]
            chosen = (content == tick).reshape(content.shape + (1,) * (values.ndim - content.ndim))
            gathered = np.where(chosen, values, np.zeros_like(values) if number == 0 else gathered)
        return gathered

    def _corrupt(self, fields: dict[str, Any], row: int, content: Integers, mark: Marks) -> dict[str, Any]:
        struck = np.nonzero(mark > Mark.STALE)
        link = self._links.slots[struck]
        draw = self._medium.bit_draws(content[struck], np.full(link.shape, row), link)
        whole = {name: field[struck] for name, field in fields.items()}
        wrong = corrupted_fields(whole, mark[struck], self._medium.bias(content[struck], link), draw)
        arriving = {name: field.copy() for name, field in fields.items()}
        for name, field in wrong.items():
            arriving[name][struck] = field
        return arriving

    def _forget(self, tick: int) -> None:
        """Drop what nobody will hear any more; a stale message says what was said the tick before it was sent."""
        oldest = self._air.oldest_sent(tick) - 1
        self._said = {sent: said for sent, said in self._said.items() if sent >= oldest}

    def moment(self, instant: FlownTick) -> Moment:
        """What is written down of a tick."""
        estimate, awake = instant.action.estimate, ~self.timeline.at(instant.tick).idle
        verdicts, delivery = instant.verdicts, instant.delivery
        real = self._links.present & awake[:, None]
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
            reports={name: self._of_the_awake(said, awake) for name, said in estimate.reports.items()},
            fates=verdicts.fate,
            odd=out_of_the_ordinary(instant.tick, verdicts),
            apart=delivery.apart,
            late=delivery.late,
            dropped=delivery.dropped,
            released=delivery.released,
            injected=to_plain(list(self._plan.injected)) if instant.tick == 0 and self._plan.injected else None,
        )

    @staticmethod
    def _of_the_awake(said: Array, awake: Mask) -> Array:
        return np.where(awake.reshape(-1, *(1,) * (said.ndim - 1)), said, np.nan)
