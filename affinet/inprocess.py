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
from netem.links import Integers, Mask
from netem.medium import Delivery, Fate, Fates, InFlight, Medium
from world.history import History, Moment, Moments, gather

Broadcasts = Mapping[str, Fields]


class Swarm:
    """A run in this process."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._links = plan.world.links
        self._agents = plan.agents
        self._fields = self._agents.channels()
        self._medium = Medium(plan.scenario.seed, plan.channels, plan.profile, plan.timeline)
        self._said: dict[int, Broadcasts] = {}
        self.in_flight = InFlight()
        self.history = History(plan.world, len(plan.channels))

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
        fates = self._medium.judge(tick, self._offered(alive))
        seen = (fates[0] == Fate.DELIVERED)[links.slots] & links.present
        measured = np.where(seen[..., None], world.measure(tick, position)[links.slots], 0.0)
        state, self._said[tick] = self._agents.sense(state, measured, seen)
        self.in_flight, delivery = self._medium.deliver(tick, self.in_flight, fates)
        heard = {name: self._hear(name, delivery.sent[self._plan.channels.index(name)]) for name in self._fields}
        state, action = self._agents.act(state, tick, heard, position)
        self._forget(tick)
        return state, self._moment(position, alive, action, fates, delivery)

    def _offered(self, alive: Mask) -> Mask:
        speaks = alive[self._links.src - 1]
        return np.stack([speaks | (name == channels.SENSE) for name in self._plan.channels])

    def _hear(self, channel: str, sent: Integers) -> Heard:
        sent_to_slot = np.where(self._links.present, sent[self._links.slots], -1)
        fresh = sent_to_slot >= 0
        gathered = {name: self._gather(channel, name, sent_to_slot, fresh) for name in self._fields[channel]}
        return Heard(gathered, fresh)

    def _gather(self, channel: str, field: str, sent: Integers, fresh: Mask) -> Any:
        gathered = np.zeros(0)
        for number, tick in enumerate(np.unique(sent[fresh]).tolist() or [max(self._said)]):
            values = self._said[tick][channel][field][self._links.neighbours]
            chosen = (sent == tick).reshape(sent.shape + (1,) * (values.ndim - sent.ndim))
            gathered = np.where(chosen, values, np.zeros_like(values) if number == 0 else gathered)
        return gathered

    def _forget(self, tick: int) -> None:
        oldest = int(self.in_flight.rows[:, 1].min(initial=tick + 1))
        self._said = {sent: said for sent, said in self._said.items() if sent >= oldest}

    def _moment(self, position: Array, alive: Mask, action: Action, fates: Fates, delivery: Delivery) -> Moment:
        estimate = action.estimate
        real = self._links.present & alive[:, None]
        return Moment(
            position=position,
            velocity=np.where(alive[:, None], action.velocity, 0.0),
            estimate=np.where(real[..., None], estimate.relative, 0.0),
            known=estimate.known & real,
            psi=np.where(alive, estimate.psi, np.nan),
            fates=fates,
            late=len(delivery.late),
            dropped=delivery.dropped,
        )
