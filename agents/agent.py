"""One agent, or a batch of them: sense -> broadcast -> hear -> act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from agents.brief import Array, Brief, Mask, Reading
from agents.controllers import Law, pilot
from agents.estimators.base import Channels, Estimate, Estimator, Field, Fields, Heard
from netem.channels import INPUT


class AgentState(NamedTuple):
    """What an agent remembers from tick to tick; every array begins with the batch axes."""

    estimator: Any
    law: Any
    velocity: Array


class Action(NamedTuple):
    """What an agent does in a tick: its input (..., D), in metres per second, and the estimate behind it."""

    velocity: Array
    estimate: Estimate


@dataclass(frozen=True)
class Agent:
    """The algorithms of an agent, as pure functions of its state and of what reached it.

    Parameters
    ----------
    brief
        Its place in the formation; with leading axes, the places of many.
    estimator, law
        What it runs.
    leader_gain
        How hard a leader pulls toward its target, per second.
    """

    brief: Brief
    estimator: Estimator[Any]
    law: Law[Any]
    leader_gain: float

    def channels(self) -> Channels:
        """Everything it broadcasts as arrays: for each channel, its fields."""
        dimension = self.brief.dimension
        return {INPUT: {"velocity": Field((dimension,))}, **self.estimator.channels(dimension)}

    def init(self, batch: tuple[int, ...]) -> AgentState:
        """A fresh agent, or a batch of them."""
        return AgentState(
            estimator=self.estimator.init(self.brief, batch),
            law=self.law.init(self.brief, batch),
            velocity=np.zeros((*batch, self.brief.dimension)),
        )

    def sense(self, state: AgentState, measured: Array, seen: Mask) -> tuple[AgentState, Mapping[str, Fields]]:
        """Take in the measurements (..., n, D) of the edges seen (..., n); say what to broadcast on each channel.

        The input broadcast is the one now flying, of the tick before.
        """
        estimator, said = self.estimator.sense(self.brief, state.estimator, measured, seen)
        return state._replace(estimator=estimator), {INPUT: {"velocity": state.velocity}, **said}

    def act(
        self, state: AgentState, tick: Reading, heard: Mapping[str, Heard], position: Array | None
    ) -> tuple[AgentState, Action]:
        """Estimate from what was heard, and steer; `tick` is what its clock says.

        Only leaders have their own `position` (..., D).
        """
        brief = self.brief
        estimator, estimate = self.estimator.fuse(brief, state.estimator, heard)
        law, velocity = self.law.command(brief, state.law, tick, state.velocity, estimate, heard[INPUT])
        if position is not None and brief.mission is not None:
            led = pilot(brief, brief.mission, self.leader_gain, tick, position)
            velocity = np.where(brief.leader[..., None], led, velocity)
        return AgentState(estimator, law, velocity), Action(velocity, estimate)


def renew(state: Any, fresh: Any, which: Mask) -> Any:
    """The state with the agents in `which` (batch axes) replaced by fresh ones."""
    if isinstance(state, tuple):
        return type(state)(*(renew(old, new, which) for old, new in zip(state, fresh, strict=True)))
    return chosen(which, fresh, state)


def chosen(which: Mask, one: Any, other: Any) -> Any:
    """Array `one` where `which` (batch axes) is true, the other elsewhere."""
    return np.where(which.reshape(which.shape + (1,) * (other.ndim - which.ndim)), one, other)
