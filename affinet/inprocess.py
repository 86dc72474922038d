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
from netem.medium import Fate, InFlight, Medium
from world.history import History, Moment

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
        self.history = History(
            plan.world.ticks, self._links, len(plan.channels), plan.world.formation.dimension
        )

    def fly(self, watch: Callable[[Moment], None]) -> None:
        """All ticks; `watch` sees every moment."""
        world, timeline = self._plan.world, self._medium.timeline
        batch = (self._links.agents,)
        position, state = world.start(), self._agents.init(batch)
        with np.errstate(over="ignore", invalid="ignore"):
            for tick in range(world.ticks):
                now = timeline.at(tick)
                if fresh := timeline.restarted(tick):
                    state = renew(state, self._agents.init(batch), np.isin(np.arange(1, batch[0] + 1), fresh))
                state, moment = self._tick(tick, position, state, now.dead)
                position = world.step(tick, position, moment.velocity, now.absent)
                self.history.append(moment, position)
                watch(moment)

    def _tick(self, tick: int, position: Array, state: AgentState, dead: Mask) -> tuple[AgentState, Moment]:
        world, links = self._plan.world, self._links
        fates = self._medium.judge(tick, self._offered(~dead))
        seen = (fates[0] == Fate.DELIVERED)[links.slots] & links.present
        measured = np.where(seen[..., None], world.measure(tick, position)[links.slots], 0.0)
        state, self._said[tick] = self._agents.sense(state, measured, seen)
        self.in_flight, delivery = self._medium.deliver(tick, self.in_flight, fates)
        heard = {name: self._hear(name, delivery.sent[self._plan.channels.index(name)]) for name in self._fields}
        state, action = self._agents.act(state, tick, heard, position)
        self._forget(tick)
        return state, self._moment(tick, position, dead, action, fates=fates, late=delivery.late[:, 1], dropped=delivery.dropped)

    def _offered(self, alive: Mask) -> Mask:
        speaks = alive[self._links.src - 1]
        return np.stack([speaks | (name == channels.SENSE) for name in self._plan.channels])

    def _hear(self, channel: str, sent: Integers) -> Heard:
        sent_to_slot = np.where(self._links.present, sent[self._links.slots], -1)
        fresh = sent_to_slot >= 0
        gathered = {
            name: self._gather(channel, name, sent_to_slot, fresh) for name in self._fields[channel]
        }
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

    def _moment(self, tick: int, position: Array, dead: Mask, action: Action, **air: Any) -> Moment:
        world, estimate = self._plan.world, action.estimate
        alive = ~dead
        known = estimate.known & alive[:, None]
        real = (self._links.present & alive[:, None])[..., None]
        return Moment(
            tick=tick,
            position=position,
            target=world.target(tick),
            error=world.error(tick, position, self._medium.timeline.at(tick).absent),
            velocity=np.where(alive[:, None], action.velocity, 0.0),
            estimate=np.where(real, estimate.relative, 0.0),
            known=known,
            psi=np.where(alive & np.isfinite(estimate.psi), estimate.psi, np.nan),
            **air,
        )
