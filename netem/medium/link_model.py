"""What one profile makes of the messages of a tick: which it loses, and how the others arrive.

The layers are independent: each says what it holds, a message passes when none holds it, and it is booked under the strongest
that does, in the order of `verdict.STRONGEST_FIRST`. To add a loss, see docs/extending.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels as channel_names
from netem.core.draws import Purpose, Seed, uniform
from netem.core.links import Links
from netem.impairments import delay
from netem.impairments.corrupt import Mark, Marks
from netem.impairments.profile import Profile
from netem.impairments.reach import squared_distances
from netem.medium.by_tick import ImpairmentsByTick, TickImpairments
from netem.medium.in_flight import MediumState, Verdicts
from netem.medium.own_losses import OwnLosses
from netem.medium.verdict import PASSED, Verdict, VerdictCodes, stronger

_SHARED_DRAW = 0

# Looking up the members of an enumeration costs as much as an operation on a small array.
_SILENT, _DELIVERED, _DELAYED = (np.uint8(kind) for kind in (Verdict.SILENT, Verdict.DELIVERED, Verdict.DELAYED))
_CLOSED, _RANGE, _JAMMED = (np.uint8(kind) for kind in (Verdict.CLOSED, Verdict.RANGE, Verdict.JAMMED))
_LISTED, _LOST, _OVERFLOW = (np.uint8(kind) for kind in (Verdict.LISTED, Verdict.LOST, Verdict.OVERFLOW))
_STALE = np.uint8(Mark.STALE)


class Memory(NamedTuple):
    """What a link model remembers from tick to tick.

    Parameters
    ----------
    debt
        Of the queues of limited links, in bits, shape (L,).
    chains
        States of the chains that step with the messages, shape (C', L) each.
    """

    debt: Array
    chains: tuple[Integers, ...]


class _Packets(NamedTuple):
    """What chains that step with the messages make of a tick: their states, the losses, and extra delay in seconds (C', L)."""

    states: tuple[Integers, ...]
    lost: Mask
    extra_s: Array


class LinkModel:
    """A profile over the links of a run.

    Parameters
    ----------
    seed
        Of the run.
    links, channels
        Names, sensing first; the rows and columns of every (C, L) array.
    profile
        What impairs the links.
    """

    def __init__(self, seed: Seed, links: Links, channels: Sequence[str], profile: Profile) -> None:
        self.profile = profile
        self._seed, self._links = links.seeds(seed), links
        self._shape = (len(channels), len(links))
        self._sensing = np.array([name == channel_names.SENSE for name in channels])
        self._comms = ~self._sensing[:, None]
        self._names = np.array([channel_names.code(name) for name in channels], dtype=np.int64)
        self._codes = np.array([_SHARED_DRAW]) if profile.coupled else self._names
        self._by_tick = ImpairmentsByTick(seed, links, profile, self._codes, self._sensing)
        self._own = [
            (OwnLosses(seed, links, profile.dt, own, self._codes), self._by_tick.on(own.sensing, own.comms))
            for own in profile.own
        ]
        self._packet_layers = [n for n, layer in enumerate(profile.chains) if layer.by_packet.any()]
        self._packet_lanes = 1 + max((profile.chains[n].lane for n in self._packet_layers), default=-1)
        orderly = [law.rows for law in profile.delays if law.ordered]
        self._ordered = np.logical_or.reduce([np.zeros(self._shape[1], dtype=bool), *orderly]) & self._comms
        self.keeps_order = bool(orderly)
        self._bits = np.where(self._sensing, 0.0, profile.message_bits)
        self._sender, self._receiver = links.src - 1, links.dst - 1
        self._corrupts, self._doubles = bool(profile.corrupt.any()), bool(profile.duplicate.any())
        self._unmarked, self._single = np.zeros(self._shape, dtype=np.uint8), np.full(self._shape, -1)

    def begin(self) -> Memory:
        """What it remembers before the first tick."""
        layers = [self.profile.chains[n] for n in self._packet_layers]
        draws = self._by_tick.draw(Purpose.CHAIN_START, np.zeros(1, dtype=np.int64), self._packet_lanes)[0]
        states = tuple(layer.begin(draws[..., layer.lane]) for layer in layers)
        return Memory(self.profile.rate.begin() if self.profile.rate else np.zeros(self._shape[1]), states)

    def rest(self, memory: Memory) -> Memory:
        """What it remembers after a tick in which it ruled no link."""
        rate = self.profile.rate
        return memory._replace(debt=rate.rest(memory.debt, self.profile.dt)) if rate else memory

    def judge(
        self,
        state: MediumState,
        memory: Memory,
        tick: int,
        offered: Mask,
        position: Array | None,
        imposed: VerdictCodes,
        delay_s: Array | None,
    ) -> tuple[Memory, Verdicts]:
        """The verdict on every message offered in a tick, as `Medium.judge` gives it.

        Parameters
        ----------
        state, memory, tick, offered, position
            The medium's state and the model's memory as the tick before left them, and what is offered in this one.
        imposed
            What the timeline holds: a reason, or PASSED, shape (C, L) or (L,).
        delay_s
            By which the timeline delays communication, shape (L,), in seconds, if it does.
        """
        impairments = self._by_tick.at(tick)
        packets = self._packet_chains(memory, tick, offered)
        reason = np.full(self._shape, PASSED)
        for kind, held in self._layers(state, tick, impairments, packets, position):
            np.copyto(reason, kind, where=held)
        if (imposed != PASSED).any():
            reason = stronger(reason, imposed)
        passed = offered & (reason == PASSED)
        extra_s = packets.extra_s if delay_s is None else packets.extra_s + delay_s
        by_message = delay_s is not None or bool(self._packet_layers)
        debt, overflow, due, waited_s = self._due(state, memory.debt, tick, impairments, extra_s, passed, by_message)
        if overflow is not None:
            np.copyto(reason, _OVERFLOW, where=overflow)
            passed &= ~overflow
        np.copyto(reason, _DELIVERED, where=passed)
        np.copyto(reason, _DELAYED, where=passed & (due > tick))
        np.copyto(reason, _SILENT, where=~offered)
        copy_due = self._copies(tick, impairments, passed, due, waited_s)
        verdicts = Verdicts(reason, due, self._marks(state, impairments, passed), copy_due)
        return Memory(debt, packets.states), verdicts

    def bit_draws(self, content: Integers, channel: Integers, link: Integers) -> Array:
        """Which number and which bit of corrupted messages flip: uniform, shape (m, 2), for rows of messages (m,)."""
        seed = self._seed if isinstance(self._seed, int) else self._seed[link]
        ends = {name: numbers[link] for name, numbers in self._links.ends.items()}
        return uniform(seed, Purpose.CORRUPTED_BIT, tick=content, **ends, channel=self._names[channel], lanes=2)

    def draw(self, purpose: Purpose, ticks: Integers) -> Array:
        """Uniform draws for every message of ticks (T,), shape (T, C', L); C' is 1 where channels share them."""
        return self._by_tick.draw(purpose, ticks, 1)[..., 0]

    def _layers(
        self, state: MediumState, tick: int, impairments: TickImpairments, packets: _Packets, position: Array | None
    ) -> Iterator[tuple[np.uint8, Mask]]:
        """The layers that change from tick to tick, and what each holds: the weakest first."""
        if self.profile.spatial and position is None:
            raise ValueError("loss by distance and jammed zones need the positions of the tick")
        yield _LOST, impairments.lost
        if packets.states:
            yield _LOST, packets.lost
        for own, on in self._own:
            yield _LOST, own.lost(tick, position) & on
        if len(self.profile.listed):
            yield _LISTED, self._listed(state.offered)
        if position is not None:
            for zone, on in zip(self.profile.zones, impairments.jams.tolist(), strict=True):
                if on:
                    yield _JAMMED, zone.jammed(self._receiver, position) & self._by_tick.on(zone.sensing, zone.comms)
            if self.profile.reaches:
                yield _RANGE, squared_distances(self._sender, self._receiver, position) > impairments.squared_limit
        if self.profile.schedules:
            yield _CLOSED, impairments.closed

    def _listed(self, offered: Integers) -> Mask:
        link, listed, sensing, comms = self.profile.listed.T
        number = offered[:1] if self.profile.coupled else offered  # one verdict for all: that on the sensing
        hit = (number[:, link] == listed) & np.where(self._sensing[:, None], sensing, comms).astype(bool)
        held = np.zeros(self._shape, dtype=bool)
        channel, row = np.nonzero(hit)
        held[channel, link[row]] = True
        return held

    def _packet_chains(self, memory: Memory, tick: int, offered: Mask) -> _Packets:
        lost = np.zeros(self._shape, dtype=bool)
        extra = np.zeros((len(self._codes), self._shape[1]))
        if not self._packet_layers:
            return _Packets((), lost, extra)
        moves = offered.any(axis=0, keepdims=True) if self.profile.coupled else offered
        draws = self._by_tick.draw(Purpose.PACKET_CHAIN, np.array([tick]), 2 * self._packet_lanes)[0]
        states = []
        for n, state in zip(self._packet_layers, memory.chains, strict=True):
            layer = self.profile.chains[n]
            on = self._by_tick.on(layer.sensing, layer.comms)
            lost |= layer.lost(state, draws[..., 2 * layer.lane]) & layer.by_packet & on
            extra += layer.adds(state) * (layer.by_packet & self._by_tick.acts(layer))
            _, following = layer.walk(state, draws[None, ..., 2 * layer.lane + 1])
            states.append(np.where(moves, following, state))
        return _Packets(tuple(states), lost, extra)

    def _due(
        self,
        state: MediumState,
        debt: Array,
        tick: int,
        impairments: TickImpairments,
        extra_s: Array,
        passed: Mask,
        by_message: bool,
    ) -> tuple[Array, Mask | None, Integers, Array]:
        """The queues' debt, what they refuse, when the others arrive, and what else makes them wait."""
        rate, overflow, wait = self.profile.rate, None, impairments.delay_ticks
        if by_message or rate:
            if rate:
                debt, overflow, queued = rate.admit(rate.rest(debt, self.profile.dt), self._bits, passed)
                extra_s = extra_s + queued
            wait = delay.ticks(impairments.delay_s + extra_s, self.profile.dt)
            wait = np.where(self._comms, np.maximum(wait, self.profile.least_delay), 0)
        due = tick + wait
        if self.keeps_order:
            due = np.where(self._ordered, np.maximum(due, state.last_due), due)
        return debt, overflow, due, extra_s

    def _marks(self, state: MediumState, impairments: TickImpairments, passed: Mask) -> Marks:
        if not self._corrupts:
            return self._unmarked
        return impairments.mark * (passed & ((impairments.mark != _STALE) | state.spoke))

    def _copies(
        self, tick: int, impairments: TickImpairments, passed: Mask, due: Integers, waited_s: Array
    ) -> Integers:
        if not self._doubles:
            return self._single
        wait = delay.ticks(impairments.copy_delay_s + waited_s, self.profile.dt)
        arrival = tick + np.maximum(wait, self.profile.least_delay)
        if self.keeps_order:
            arrival = np.where(self._ordered, np.maximum(arrival, due), arrival)
        return np.where(passed & impairments.copied, arrival, -1)
