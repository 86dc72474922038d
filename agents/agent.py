"""One agent, or a batch of them: sense -> broadcast -> hear -> act."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from agents.brief import DERIVATIVES, Brief, Gap, Own, Reading
from agents.estimate import Estimate
from agents.estimators.base import Estimator
from agents.exchange import Channels, Field, Fields, Heard
from agents.laws.base import Law
from agents.laws.leaders import hold_distances, pilot, pilot_of_accelerations, saturated
from agents.loading import capabilities, returned
from analysis.kernels.kernel import Plain, kernel
from analysis.models.affine import Manoeuvre
from analysis.models.arrays import Array, Integers, Mask, chosen
from analysis.models.pursuit import Sighting
from netem.core.channels import INPUT
from netem.loading.calling import Calling
from netem.loading.given import protect, readonly
from netem.loading.returned import array, pair


class AgentState(NamedTuple):
    """What an agent remembers from tick to tick; every array begins with the batch axes.

    Parameters
    ----------
    estimator, law
        The states of its algorithms.
    input
        Flown from its last tick on, shape (..., D).
    sensed
        The last tick in which it sensed, by the run's count and not by its clock, shape (...); -1 before the first.
    held
        Whether it was dead since, so that its body held, shape (...).
    """

    estimator: Any
    law: Any
    input: Array
    sensed: Integers
    held: Mask


class AgentAction(NamedTuple):
    """What an agent does in a tick: its input (..., D), a velocity, an acceleration ..., and the estimate behind it."""

    input: Array
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
    leaders
        What leaders do: fly the manoeuvre, or keep their distances from each other.
    leader_gain
        How hard a leader pulls toward its target, per second; or toward its distances, per second and square metre.
    limit
        The longest input its body takes, in metres per second, or per second squared; None for any.
    reports
        What the estimator reports, and the shape of each for one agent; None as long as nobody knows.

    Raises
    ------
    UserCodeError
        By all its methods: when estimator or law fail, or return something else than was asked of them.
    """

    brief: Brief
    estimator: Estimator[Any]
    law: Law[Any]
    leaders: Literal["pilot", "distances"]
    leader_gain: float
    limit: float | None
    reports: Mapping[str, tuple[int, ...]] | None = None

    def __post_init__(self) -> None:
        protect(self.brief)

    def channels(self) -> Channels:
        """Everything it broadcasts as arrays: for each channel, its fields."""
        moves = DERIVATIVES[: self.law.order]
        return {INPUT: {name: Field((self.brief.dimension,)) for name in moves}, **self._spoken}

    @cached_property
    def _spoken(self) -> Channels:
        with Calling(self.estimator, "channels"):
            return returned.declared(self.estimator.channels(self.brief))

    def init(self, batch: tuple[int, ...]) -> AgentState:
        """A fresh agent, or a batch of them."""
        with Calling(self.estimator, "init"):
            estimator = self.estimator.init(self.brief, batch)
            returned.fresh(estimator, batch)
        with Calling(self.law, "init"):
            law = self.law.init(self.brief, batch)
            returned.fresh(law, batch)
        still, never = np.zeros((*batch, self.brief.dimension)), np.full(batch, -1, dtype=np.int64)
        fresh = AgentState(estimator, law, still, never, held=np.zeros(batch, dtype=bool))
        protect(fresh)
        return fresh

    def revived(self, state: AgentState) -> AgentState:
        """What it remembers when its process is new and goes on from this state: its body has held since."""
        protect(state)
        return state._replace(held=np.ones_like(state.held))

    def sense(
        self,
        state: AgentState,
        tick: int,
        measured: Array,
        seen: Mask,
        motion: Array | None,
        flown: Array | None = None,
    ) -> tuple[AgentState, Mapping[str, Fields]]:
        """Take in the measurements (..., n, D) of the edges seen (..., n); say what to broadcast on each channel.

        Who has missed ticks since it sensed last is told so first.

        The input broadcast is the one now flying, of the tick before; with it go velocity and higher derivatives, the `motion`
        (..., m - 1, D) of integrators of an order m above 1. Bodies that measure a velocity where they are steered by one tell
        what they measure: it is not what they were told.

        Parameters
        ----------
        state
            What it remembers, as a method of this returned it.
        tick
            Its number in the run, whatever clocks say.
        measured, seen
            Relative positions, shape (..., n, D), in metres, and which there are, shape (..., n); nobody can write to them from
            now on.
        motion
            Velocity and higher derivatives, shape (..., m - 1, D), of integrators of an order m above 1.
        flown
            What is flown, shape (..., D), where that is not what was commanded.
        """
        state = self._caught_up(state, tick, motion, flown)
        protect((measured, seen))
        batch = seen.shape[:-1]
        with Calling(self.estimator, "sense"):
            told = self.estimator.sense(self.brief, state.estimator, measured, seen)
            estimator, said = pair(told, "the state, and what to broadcast")
            returned.state(state.estimator, estimator, batch)
            returned.said(self._spoken, said, batch)
        moves = [*([] if motion is None else np.moveaxis(motion, -2, 0)), state.input]
        moving = dict(zip(DERIVATIVES[: self.law.order], moves, strict=False))
        return AgentState(estimator, *state[1:]), {INPUT: moving, **said}

    def _caught_up(self, state: AgentState, tick: int, motion: Array | None, told_to_fly: Array | None) -> AgentState:
        """What it remembers, and knows of the ticks that it has missed."""
        estimator, law, told, sensed, held = state
        now, missed, flying, moved_on = _woken(sensed, held, told, tick)
        flying = flying if told_to_fly is None else told_to_fly
        if self._counts_missed_ticks and missed.any():
            within = flying if motion is None else motion[..., 0, :]
            before = np.where(held[..., None], told, within) if self.law.order == 1 else within
            with Calling(self.estimator, "missed"):
                lived = self.estimator.missed(self.brief, estimator, readonly(Gap(missed, before, within)))
                returned.state(estimator, lived, missed.shape)
            estimator = chosen(missed > 0, lived, estimator)
            protect(estimator)
        protect(flying)
        return AgentState(estimator, law, flying, now, moved_on)

    @cached_property
    def _counts_missed_ticks(self) -> bool:
        return capabilities.counts_missed_ticks(self.estimator)

    def act(
        self,
        state: AgentState,
        tick: Reading,
        heard: Mapping[str, Heard],
        position: Array | None,
        motion: Array | None,
        sighting: Sighting | None,
    ) -> tuple[AgentState, AgentAction]:
        """Estimate from what was heard, and steer.

        Parameters
        ----------
        state
            What it remembers.
        tick
            What its clock says.
        heard
            By channel; nobody can write to it from now on.
        position
            Its own, shape (..., D), in metres, of leaders and of those whose law wants it.
        motion
            Velocity and higher derivatives, shape (..., m - 1, D), of integrators of an order m above 1.
        sighting
            What its detector says of a target, if it pursues one.
        """
        brief = self.brief
        velocity, higher = (state.input, None) if motion is None else (motion[..., 0, :], motion[..., 1:, :])
        own = readonly(Own(velocity, state.input, tick, position, sighting, higher))
        protect(heard)
        estimator, estimate = self._fused(state, heard, own)
        law, steered = self._commanded(state, own, estimate, heard[INPUT])
        if self.leaders == "distances":
            held = hold_distances(brief, self.leader_gain, estimate)
            steered = np.where(brief.leader[..., None], held, steered)
        elif position is not None and brief.mission is not None:
            led = self._led(brief.mission, tick, position, own.velocity)
            steered = np.where(brief.leader[..., None], led, steered)
        if self.limit is not None:
            steered = saturated(steered, self.limit)
        protect(steered)
        return AgentState(estimator, law, steered, state.sensed, state.held), AgentAction(steered, estimate)

    def _fused(self, state: AgentState, heard: Mapping[str, Heard], own: Own) -> tuple[Any, Estimate]:
        batch, (slots, dimension) = state.input.shape[:-1], self.brief.relative.shape[-2:]
        with Calling(self.estimator, "fuse"):
            told = self.estimator.fuse(self.brief, state.estimator, heard, own)
            estimator, estimate = pair(told, "the state, and an Estimate")
            returned.state(state.estimator, estimator, batch)
            return estimator, returned.estimate(estimate, slots, dimension, batch, self.reports)

    def _commanded(self, state: AgentState, own: Own, estimate: Estimate, inputs: Heard) -> tuple[Any, Array]:
        batch = state.input.shape[:-1]
        with Calling(self.law, "command"):
            told = self.law.command(self.brief, state.law, own.tick, own, estimate, inputs)
            law, steered = pair(told, "the state, and the input")
            returned.state(state.law, law, batch)
            array("the input", steered, "D", (self.brief.dimension,), batch)
            return law, steered

    def _led(self, mission: Manoeuvre, tick: Reading, position: Array, velocity: Array) -> Array:
        if self.law.order == 1:
            return pilot(self.brief, mission, self.leader_gain, tick, position)
        return pilot_of_accelerations(self.brief, mission, self.leader_gain, tick, position, velocity)


@kernel("(),(),(D),()->(),(),(D),()", "l?dl->lld?")
def _woken(D: int) -> Plain:
    """In which tick it senses, how many it has missed, what it flies, and that its body holds no longer."""

    def plain(
        sensed: int,
        held: bool,
        told: Array,
        tick: int,
        now: Integers,
        missed: Integers,
        flying: Array,
        holds: Mask,
    ) -> None:
        now[0] = tick
        missed[0] = 0 if sensed < 0 else tick - sensed - 1
        for axis in range(D):
            flying[axis] = 0.0 if held else told[axis]
        holds[0] = False

    return plain
