"""The medium of a flight against one agent: the air is the run's, and others say what has the right form, no more."""

from __future__ import annotations

from typing import Any

import numpy as np

from affinet.conformance.record import Handed
from affinet.planning.plan import Plan
from agents.arrivals import forms_of
from analysis.models.arrays import Array
from netem.core import channels
from netem.faults.timeline import Timeline
from netem.medium.medium import Medium
from netem.medium.relay import Relay, Relayed
from netem.wire import messages
from netem.wire.arrays import Form, packed
from netem.wire.session import CENTRE, HUB
from world.physics.world import Scene


class Air:
    """What reaches one agent of a plan.

    Parameters
    ----------
    plan, agent
        What is flown, and who is under test.
    """

    def __init__(self, plan: Plan, agent: int) -> None:
        self._plan, self._row, self._links = plan, agent - 1, plan.world.links
        medium = Medium(plan.world.seed, plan.channels, plan.profiles, plan.timeline, plan.recorded())
        self._relay = Relay[None](medium)
        self._forms = forms_of(plan.agents.channels())
        self._mine = self._links.dst == agent

    @property
    def timeline(self) -> Timeline:
        """The faults of the flight."""
        return self._relay.timeline

    def decide(self, tick: int, scene: Scene) -> Relayed:
        """What arrives in a tick."""
        relayed = self._relay.decide(tick, scene.position)
        self._relay.keep(tick, None)
        self._relay.finish(tick)
        return relayed

    def sensed(self, relayed: Relayed, scene: Scene, measured: Array, seq: int) -> messages.SenseInbox:
        """The inbox with what it measures."""
        arrived, motion = relayed.seen & self._mine, self._plan.world.odometry(scene)
        return messages.SenseInbox(
            k=relayed.tick,
            src=HUB,
            seq=seq,
            clock=int(self.timeline.clock(relayed.tick)[self._row]),
            neighbours=self._links.src[arrived].tolist(),
            measured=packed(measured[arrived]),
            position=packed(scene.position[self._row]) if self._plan.positioned[self._row] else None,
            motion=None if motion is None else packed(motion[self._row]),
            sighting=None,
        )

    def heard(self, relayed: Relayed) -> list[Handed]:
        """The broadcasts that arrive, in order."""
        rows = [row for row in relayed.arriving.tolist() if self._mine[row[1]]]
        return [
            Handed(tick, int(self._links.src[link]), self._plan.channels[channel]) for tick, link, channel, _ in rows
        ]

    def said(self, handed: Handed) -> bytes:
        """A broadcast as it travels."""
        payload = {name: _plausible(form) for name, form in self._forms.get(handed.channel, {}).items()}
        if handed.channel == channels.MEASUREMENT:
            seen = self._links.src[self._links.dst == handed.agent].tolist()
            dimension = self._plan.world.formation.dimension
            payload = {"neighbours": seen, "measured": packed(np.zeros((len(seen), dimension)))}
        said = messages.Broadcast(
            k=handed.tick, src=handed.agent, channel=handed.channel, seq=handed.tick, payload=payload
        )
        return messages.pack(said)

    def told(self, tick: int, seq: int) -> bytes:
        """What a centre says of its edges: that they are as they should be."""
        relative = self._plan.brief_of(self._row).relative
        covariance = np.broadcast_to(np.eye(relative.shape[-1]), (*relative.shape, relative.shape[-1]))
        nis = np.full(len(relative), np.nan)
        told = messages.Told(
            k=tick, src=CENTRE, seq=seq, relative=packed(relative), covariance=packed(covariance), nis=packed(nis)
        )
        return messages.pack(told)


def _plausible(form: Form) -> Any:
    """Truths that hold, maps that leave all as it is, and vectors of zeros."""
    if form.truths:
        return packed(np.ones(form.shape), form.dtype)
    square = len(form.shape) == 2 and form.shape[0] == form.shape[1]
    return packed(np.eye(form.shape[0]) if square else np.zeros(form.shape))
