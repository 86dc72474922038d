"""All agents of a run as one batch in this process, and the medium between them: what they say is carried as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from affinet.planning.programs import refuse_in_process
from agents.agent import AgentAction, AgentState
from agents.batch import beside_others, come_back, put_back
from agents.brief import DERIVATIVES, Reading
from agents.centre.checked import CheckedCentre
from agents.exchange import Fields, Heard
from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels
from netem.faults.timeline import Timeline
from netem.impairments.corrupt import Mark, Marks
from netem.loading.given import protect
from netem.medium import by_slot
from netem.medium.in_flight import Delivery
from netem.medium.medium import Medium
from netem.medium.picking import picked
from netem.medium.relay import Relay, Relayed, changed_on_the_way
from netem.processes.user_code import in_tick
from world.physics.world import Scene

Broadcasts = Mapping[str, Fields]


class BatchActed(NamedTuple):
    """What all agents decided and believed, and what the medium made of their messages."""

    input: Array
    action: AgentAction
    relayed: Relayed


class ArrayCarrier:
    """Carries a run's messages in this process.

    Parameters
    ----------
    plan
        What is flown.

    Raises
    ------
    PlanError
        When programs of a user's own are to fly some of it.
    """

    def __init__(self, plan: Plan) -> None:
        refuse_in_process(plan)
        self._world = plan.world
        self._links = plan.world.links
        self._may_have_gaps, self._knows_positions = plan.may_have_gaps, plan.knows_positions
        self._agents = plan.agents
        self._numbers = np.arange(1, self._links.agents + 1)
        self._fields = self._agents.channels()
        self._rows = [plan.channels.index(channel) for channel in self._fields]
        self._state = self._agents.init(self._numbers.shape)
        medium = Medium(plan.world.seed, plan.channels, plan.profiles, plan.timeline, plan.recorded())
        self._relay = Relay[Broadcasts](medium)
        self._centre = plan.centre
        if self._centre:
            self._whole = self._centre.begin((plan.world.swarms,))

    @property
    def timeline(self) -> Timeline:
        """The faults of the run, as far as they are known by now."""
        return self._relay.timeline

    @property
    def in_flight(self) -> int:
        """Messages under way."""
        return self._relay.in_flight

    @property
    def under_way(self) -> Integers:
        """Messages under way on each link, shape (L,)."""
        return self._relay.under_way

    def fire(self, tick: int, triggers: Sequence[int]) -> None:
        """From this tick on, what waited for these triggers holds."""
        self._relay.fire(triggers, tick)

    def carry(self, tick: int, scene: Scene, measured: Array) -> BatchActed:
        """One tick of everybody.

        Raises
        ------
        UserCodeError
            When estimator or law do something wrong: in which tick.
        """
        with in_tick(tick):
            return self._tick(tick, scene, measured)

    def _tick(self, tick: int, scene: Scene, sensed: Array) -> BatchActed:
        before = self._welcomed_back(tick)
        relayed = self._relay.decide(tick, scene.position, sensed if self._may_have_gaps else None)
        idle, living = relayed.conditions.idle, before
        some_idle = idle.any()
        if some_idle:
            living = beside_others(before, idle, tick)
        measured, seen = by_slot.sensed(sensed, relayed.seen, self._links)
        motion = self._world.odometry(scene)
        state, said = self._agents.sense(living, tick, measured, seen, motion, self._world.told(tick))
        told = {name: self._relay.as_told(tick, name, self._numbers, fields) for name, fields in said.items()}
        self._relay.keep(tick, told)
        heard = self._hear(tick, relayed.delivery)
        if self._centre:
            heard[channels.CENTRE] = self._from_the_centre(self._centre, measured, seen, self._steered(said))
        sighting = self._world.sighting(tick, scene)
        position = scene.position if self._knows_positions else None
        state, action = self._agents.act(state, self._reading(tick), heard, position, motion, sighting)
        self._state = put_back(idle, before, state) if some_idle else state
        self._relay.finish(tick)
        steered = np.where(idle[:, None], 0.0, action.input) if some_idle else action.input
        return BatchActed(steered, action, relayed)

    def _welcomed_back(self, tick: int) -> AgentState:
        if not (restarted := self.timeline.restarted(tick)):
            return self._state
        return come_back(self._agents, self._numbers, self._state, restarted, self.timeline.remembering(tick))

    def _from_the_centre(self, centre: CheckedCentre, measured: Array, seen: Mask, inputs: Array) -> Heard:
        def of_swarms(array: Any) -> Any:
            return array.reshape(self._world.swarms, centre.swarm.agents, *array.shape[1:])

        self._whole, told = centre.step(self._whole, of_swarms(measured), of_swarms(seen), of_swarms(inputs))
        fields = {name: field.reshape(-1, *field.shape[2:]) for name, field in told._asdict().items()}
        return Heard(fields, self._links.present)

    def _steered(self, said: Broadcasts) -> Array:
        """What all fly from the tick before, as they say it."""
        return said[channels.INPUT][DERIVATIVES[self._agents.law.order - 1]]

    def _reading(self, tick: int) -> Reading:
        """What the clocks say; one reading for all, where they agree, spares looking up the manoeuvre for each."""
        clocks = self.timeline.clock(tick)
        return int(clocks[0]) if (clocks == clocks[0]).all() else clocks

    def _hear(self, tick: int, delivery: Delivery) -> dict[str, Heard]:
        """What everybody hears on each channel."""
        arriving = _protected(by_slot.arriving(delivery.newest[self._rows], self._links, tick))
        marked, heard = delivery.mark.any(), {}
        for channel, row, fresh, age in zip(self._fields, self._rows, *arriving, strict=True):
            fields = self._gathered(tick, channel, fresh, age)
            if marked:
                mark = np.where(fresh, delivery.mark[row, self._links.slots], np.uint8(Mark.NONE))
                fields = self._changed(fields, row, tick - age, mark) if mark.any() else fields
            heard[channel] = Heard(fields, fresh, age)
        return heard

    def _gathered(self, tick: int, channel: str, fresh: Mask, age: Integers) -> dict[str, Any]:
        """What arrives of what was said, in one tick or in several."""
        spoken, said = [tick], fresh - 1
        if age.any():
            content = tick - age
            spoken = np.unique(content[fresh]).tolist()
            said = np.where(fresh, np.searchsorted(spoken, content), -1)
        broadcasts = [self._relay.said(one)[channel] for one in spoken]
        return {
            name: picked([one[name] for one in broadcasts], said, self._links.neighbours)
            for name in self._fields[channel]
        }

    def _changed(self, fields: dict[str, Any], row: int, content: Integers, mark: Marks) -> dict[str, Any]:
        struck = np.nonzero(changed_on_the_way(mark))
        link = self._links.slots[struck]
        whole = {name: field[struck] for name, field in fields.items()}
        wrong = self._relay.as_it_arrives(content[struck], np.full(link.shape, row), link, mark[struck], whole)
        arriving = {name: field.copy() for name, field in fields.items()}
        for name, field in wrong.items():
            arriving[name][struck] = field
        return arriving


def _protected(given: Any) -> Any:
    protect(given)
    return given
