"""What one profile makes of the messages of a tick: which it loses, and how the others arrive.

The layers are independent: each says what it holds, a message passes when none holds it, and it is booked under the strongest
that does, in the order of `verdict.STRONGEST_FIRST`: layers say it in `LinkModel.judge`, and `_decided` decides, message by
message. To add a loss, see docs/extending.md.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Integers, Mask
from netem.core import channels as channel_names
from netem.core.draws import Purpose, Seed, uniform
from netem.core.links import Links
from netem.impairments import delay
from netem.impairments.corrupt import Mark, Marks
from netem.impairments.profile import Profile
from netem.impairments.reach import squared_distances
from netem.medium.by_tick import ImpairmentsByTick, TickImpairments
from netem.medium.in_flight import MediumState, Verdicts, Waits
from netem.medium.own_losses import OwnLosses
from netem.medium.verdict import PASSED, Verdict, VerdictCodes, also_held, passed, stronger, strongest

_SHARED_DRAW = 0

# Looking up the members of an enumeration costs as much as an operation on a small array.
_SILENT, _DELIVERED, _DELAYED = (np.uint8(kind) for kind in (Verdict.SILENT, Verdict.DELIVERED, Verdict.DELAYED))
_RANGE, _JAMMED, _LISTED = (np.uint8(kind) for kind in (Verdict.RANGE, Verdict.JAMMED, Verdict.LISTED))
_LOST, _OVERFLOW = np.uint8(Verdict.LOST), np.uint8(Verdict.OVERFLOW)
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
        self._measured = self._sensing[:, None]
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
        self._ordered = np.logical_or.reduce([np.zeros(self._shape[1], dtype=bool), *orderly]) & ~self._measured
        self.keeps_order = bool(orderly)
        self._bits = np.where(self._sensing, 0.0, profile.message_bits)
        self._sender, self._receiver = links.src - 1, links.dst - 1
        self._spatial = profile.spatial
        self._listed_link, self._listed_number, sensing, comms = profile.listed.reshape(-1, 4).T
        self._listed_on = np.where(self._measured, sensing, comms).astype(bool)
        self._corrupts, self._doubles = bool(profile.corrupt.any()), bool(profile.duplicate.any())
        self._unmarked, self._single = np.zeros(self._shape, dtype=np.uint8), np.full(self._shape, -1)

    def begin(self) -> Memory:
        """What it remembers before the first tick."""
        layers = [self.profile.chains[n] for n in self._packet_layers]
        draws = self._by_tick.draw(Purpose.CHAIN_START, np.zeros(1, dtype=np.int64), self._packet_lanes)[0]
        states = tuple(layer.begin(draws[..., layer.lane]) for layer in layers)
        return Memory(self.profile.limits.begin() if self.profile.limits else np.zeros(self._shape[1]), states)

    def rest(self, memory: Memory, tick: int) -> Memory:
        """What it remembers after a tick in which it ruled no link."""
        rate = self.profile.limits
        return memory._replace(debt=rate.at(tick).rest(memory.debt, self.profile.dt)) if rate else memory

    def judge(
        self,
        state: MediumState,
        memory: Memory,
        tick: int,
        offered: Mask,
        position: Array | None,
        imposed: VerdictCodes,
        delay_s: Array | None,
    ) -> tuple[Memory, Verdicts, Waits]:
        """The verdict on every message offered in a tick, as `Medium.judge` gives it, and how long each waits.

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
        held, extra_s, chains = impairments.held, delay_s, memory.chains
        if self._packet_layers:
            chains, lost, slower_s = self._packet_chains(memory, tick, offered)
            held, extra_s = also_held(held, lost, _LOST), slower_s if delay_s is None else slower_s + delay_s
        for kind, where in self._layers(state, tick, impairments, position):
            held = also_held(held, where, kind)
        debt = memory.debt
        if self.profile.limits:
            rate = self.profile.limits.at(tick)
            passing = offered & (stronger(imposed, held) == PASSED)
            debt, overflow, queued_s = rate.admit(rate.rest(debt, self.profile.dt), self._bits, passing)
            held, extra_s = also_held(held, overflow, _OVERFLOW), queued_s if extra_s is None else extra_s + queued_s
        wait_s = impairments.delay_s if extra_s is None else impairments.delay_s + extra_s
        wait = self._wait(state, tick, impairments, None if extra_s is None else wait_s)
        kind, due = _decided(tick, self._measured, offered, imposed, held, wait)
        mark, copy_due, copy_s = self._unmarked, self._single, wait_s
        if self._corrupts:
            mark = _marked(self._measured, kind, impairments.mark, state.spoke)
        if self._doubles:
            copy_s = impairments.copy_delay_s if extra_s is None else impairments.copy_delay_s + extra_s
            copy_due = self._copies(tick, impairments.copied, kind, due, copy_s)
        return Memory(debt, chains), Verdicts(kind, due, mark, copy_due), Waits(wait_s, copy_s, self._ordered)

    def bit_draws(self, content: Integers, channel: Integers, link: Integers) -> Array:
        """Which number and which bit of corrupted messages flip: uniform, shape (m, 2), for rows of messages (m,)."""
        seed = self._seed if isinstance(self._seed, int) else self._seed[link]
        ends = {name: numbers[link] for name, numbers in self._links.ends.items()}
        return uniform(seed, Purpose.CORRUPTED_BIT, tick=content, **ends, channel=self._names[channel], lanes=2)

    def draw(self, purpose: Purpose, ticks: Integers) -> Array:
        """Uniform draws for every message of ticks (T,), shape (T, C', L); C' is 1 where channels share them."""
        return self._by_tick.draw(purpose, ticks, 1)[..., 0]

    def _layers(
        self, state: MediumState, tick: int, impairments: TickImpairments, position: Array | None
    ) -> Iterator[tuple[np.uint8, Mask]]:
        """The layers that time alone does not decide, and what each holds."""
        for own, on in self._own:
            yield _LOST, own.lost(tick, position) & on
        if len(self.profile.listed) and (hit := self._hit(state.offered)).any():
            yield _LISTED, self._listed(hit)
        if not self._spatial:
            return
        if position is None:
            raise ValueError("loss by distance and jammed zones need the positions of the tick")
        for zone, on in zip(self.profile.zones, impairments.jams.tolist(), strict=True):
            if on:
                yield _JAMMED, zone.jammed(self._receiver, position) & self._by_tick.on(zone.sensing, zone.comms)
        if self.profile.reaches:
            yield _RANGE, squared_distances(self._sender, self._receiver, position) > impairments.squared_limit

    def _hit(self, offered: Integers) -> Mask:
        """Which listed messages are offered now, by channel, shape (C, m)."""
        number = offered[:1] if self.profile.coupled else offered  # one verdict for all: that on the sensing
        return (number[:, self._listed_link] == self._listed_number) & self._listed_on

    def _listed(self, hit: Mask) -> Mask:
        held = np.zeros(self._shape, dtype=bool)
        channel, row = np.nonzero(hit)
        held[channel, self._listed_link[row]] = True
        return held

    def _packet_chains(self, memory: Memory, tick: int, offered: Mask) -> tuple[tuple[Integers, ...], Mask, Array]:
        """Of chains that step with messages: states after a tick, losses (C, L), extra delay in seconds (C', L)."""
        lost = np.zeros(self._shape, dtype=bool)
        extra = np.zeros((len(self._codes), self._shape[1]))
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
        return tuple(states), lost, extra

    def _wait(self, state: MediumState, tick: int, impairments: TickImpairments, seconds: Array | None) -> Integers:
        """Ticks that messages wait in the air if they are no measurements, shape (C, L) or (1, L).

        `seconds` are those that they wait, where it is not what time alone decides.
        """
        wait = impairments.delay_ticks
        if seconds is not None:
            wait = delay.ticks(seconds, self.profile.dt, self.profile.least_delay)
        if self.keeps_order:
            wait = np.where(self._ordered, np.maximum(wait, state.last_due - tick), wait)
        return wait

    def _copies(self, tick: int, copied: Mask, kind: VerdictCodes, due: Integers, seconds: Array) -> Integers:
        wait = delay.ticks(seconds, self.profile.dt, self.profile.least_delay)
        copy_due: Integers = _copied(tick, self._measured, kind, copied, wait, due, self._ordered)
        return copy_due


@kernel("(),(),(),(),(),()->(),()", "l??BBl->Bl")
def _decided() -> Plain:
    def plain(
        tick: int,
        measured: bool,
        offered: bool,
        imposed: int,
        held: int,
        wait: int,
        verdict: VerdictCodes,
        due: Integers,
    ) -> None:
        reason = strongest(imposed, held)
        due[0] = tick if measured else tick + wait
        if not offered:
            verdict[0] = _SILENT
        elif reason != PASSED:
            verdict[0] = reason
        else:
            verdict[0] = _DELAYED if due[0] > tick else _DELIVERED

    return plain


@kernel("(),(),(),()->()", "?BB?->B")
def _marked() -> Plain:
    def plain(measured: bool, verdict: int, mark: int, spoke: bool, marked: Marks) -> None:
        marked[0] = mark if passed(verdict) and not measured and (spoke or mark != _STALE) else 0

    return plain


@kernel("(),(),(),(),(),(),()->()", "l?B?ll?->l")
def _copied() -> Plain:
    def plain(
        tick: int, measured: bool, verdict: int, copied: bool, wait: int, due: int, ordered: bool, copy_due: Integers
    ) -> None:
        copy_due[0] = -1
        if copied and passed(verdict) and not measured:
            copy_due[0] = max(tick + wait, due) if ordered else tick + wait

    return plain
