"""Runtime 1: a whole swarm in this process, all agents as one batch.

The world, the medium and the agents are the ones the processes run; only the carrying of messages differs, and that is
this file. The answers are equal bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from affinet.plan import Plan
from agents.agent import Action, AgentState, renew
from agents.estimators.base import Fields, Heard
from analysis.affine import Array
from netem import channels
from netem.air import Delivery, Verdicts, out_of_the_ordinary
from netem.corrupt import Mark, Marks, corrupted_fields
from netem.fate import Fate
from netem.links import Integers, Mask
from netem.medium import Medium
from netem.plain import to_plain
from world.history import History, Moment, Moments, gather

Broadcasts = Mapping[str, Fields]


class Swarm:
    """A run in this process."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._links = plan.world.links
        self._agents = plan.agents
        self._fields = self._agents.channels()
        self._medium = Medium(plan.scenario.seed, plan.channels, plan.profile, plan.timeline, plan.recorded())
        self._said: dict[int, Broadcasts] = {}
        self._air = self._medium.begin()
        self.history = History(plan.world, len(plan.channels))

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return self._air.in_flight

    def fly(self, watch: Callable[[Moments], None], batch: int) -> None:
        """All ticks; `watch` sees them, a batch at a time."""
        world, timeline = self._plan.world, self._medium.timeline
        agents = np.arange(1, self._links.agents + 1)
        fresh = self._agents.init(agents.shape)
        position, state = world.start(), fresh
        moments: list[Moment] = []
        with np.errstate(over="ignore", invalid="ignore"):
            for tick in range(world.ticks):
                if restarted := timeline.restarted(tick):
                    state = renew(state, fresh, np.isin(agents, restarted))
                state, moment = self._tick(tick, position, state)
                position = world.step(tick, position, moment.velocity, timeline.at(tick).absent)
                moments.append(moment)
                if len(moments) == batch or tick == world.ticks - 1:
                    gathered = gather(world, timeline, tick + 1 - len(moments), moments)
                    self.history.extend(gathered, position)
                    watch(gathered)
                    moments = []

    def _tick(self, tick: int, position: Array, state: AgentState) -> tuple[AgentState, Moment]:
        world, links = self._plan.world, self._links
        alive = ~self._medium.timeline.at(tick).dead
        air, verdicts = self._medium.judge(self._air, tick, self._offered(alive), position)
        seen = (verdicts.fate[0] == Fate.DELIVERED)[links.slots] & links.present
        measured = np.where(seen[..., None], world.measure(tick, position)[links.slots], 0.0)
        state, self._said[tick] = self._agents.sense(state, measured, seen)
        self._air, delivery = self._medium.deliver(air, tick, verdicts)
        heard = {name: self._hear(name, delivery) for name in self._fields}
        state, action = self._agents.act(state, tick, heard, position)
        self._forget(tick)
        return state, self._moment(tick, position, alive, action, verdicts, delivery)

    def _offered(self, alive: Mask) -> Mask:
        speaks = alive[self._links.src - 1]
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
        wrong = corrupted_fields(whole, mark[struck], self._medium.profile.bias[link], draw)
        arriving = {name: field.copy() for name, field in fields.items()}
        for name, field in wrong.items():
            arriving[name][struck] = field
        return arriving

    def _forget(self, tick: int) -> None:
        """Drop what nobody will hear any more; a stale message says what was said the tick before it was sent."""
        oldest = self._air.oldest_sent(tick) - 1
        self._said = {sent: said for sent, said in self._said.items() if sent >= oldest}

    def _moment(
        self, tick: int, position: Array, alive: Mask, action: Action, verdicts: Verdicts, delivery: Delivery
    ) -> Moment:
        estimate = action.estimate
        real = self._links.present & alive[:, None]
        return Moment(
            position=position,
            velocity=np.where(alive[:, None], action.velocity, 0.0),
            estimate=np.where(real[..., None], estimate.relative, 0.0),
            known=estimate.known & real,
            psi=np.where(alive, estimate.psi, np.nan),
            fates=verdicts.fate,
            odd=out_of_the_ordinary(tick, verdicts),
            apart=delivery.apart,
            late=delivery.late,
            dropped=delivery.dropped,
            released=delivery.released,
            injected=to_plain(list(self._plan.injected)) if tick == 0 and self._plan.injected else None,
        )
