"""What time alone decides of messages: losses of chains, traces and schedules, delays, duplicates and marks.

It depends on nothing that is offered, and so it is computed for many ticks at once. The chains and the correlated delays go
from tick to tick whether or not a message is sent.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from analysis.models.arrays import Array, Integers, Mask
from netem.core.draws import Purpose, Seed, uniform
from netem.core.links import Links
from netem.impairments import corrupt, delay
from netem.impairments.chain import ChainLayer
from netem.impairments.corrupt import Marks
from netem.impairments.profile import Profile
from netem.impairments.reach import Reach, ReachLaw

_SPAN = 64


class TickImpairments(NamedTuple):
    """Impairments of one tick, or of many with a leading axis.

    Parameters
    ----------
    closed, lost
        Links whose turn it is not, and losses, shape (C, L), or (1, L) where all channels are alike.
    delay_s, delay_ticks
        What a message waits in the air, shape (C, L), in seconds and, no less than the least delay, in ticks.
    copied, copy_delay_s
        Messages that arrive twice, and what their copies wait, in seconds, shape (C, L).
    mark
        Corruption, shape (C, L).
    squared_limit
        Square of the distance up to which a message passes, in square metres, shape (C, L) or (1, L); infinite without.
    jams
        Whether each jammer is on, shape (zones,).
    """

    closed: Mask
    lost: Mask
    delay_s: Array
    delay_ticks: Integers
    copied: Mask
    copy_delay_s: Array
    mark: Marks
    squared_limit: Array
    jams: Mask


class ImpairmentsByTick:
    """The impairments of a run, tick by tick.

    Parameters
    ----------
    seed
        Of the run.
    links, profile
        Whose impairments they are.
    codes
        The channels' words in the counters of draws, shape (C',).
    sensing
        Which channels are sensing, shape (C,).
    """

    def __init__(self, seed: Seed, links: Links, profile: Profile, codes: Integers, sensing: Mask) -> None:
        self._seed, self._links, self._profile = links.seeds(seed), links, profile
        self._codes = codes
        self._sensing, self._comms = sensing, ~sensing[:, None]
        self._rows: TickImpairments
        self._rewind()

    def at(self, tick: int) -> TickImpairments:
        """The impairments of a tick; cheap when ticks are asked for in order."""
        block, row = divmod(tick, _SPAN)
        if block < self._block:
            self._rewind()
        while self._block < block:
            self._block += 1
            self._rows = self._next(np.arange(self._block * _SPAN, (self._block + 1) * _SPAN))
        return TickImpairments(*(field[row] for field in self._rows))

    def _rewind(self) -> None:
        self._block = -1
        first = np.zeros(1, dtype=np.int64)
        draws = self.draw(Purpose.CHAIN_START, first, self._lanes)[0]
        self._states = [layer.begin(draws[..., layer.lane]) for layer in self._profile.chains]
        self._swell = [ndtri(self.draw(Purpose.DELAY_START, first, 1)[0, ..., 0])] * len(self._profile.delays)

    @property
    def _lanes(self) -> int:
        return 1 + max((layer.lane for layer in self._profile.chains), default=-1)

    def _next(self, ticks: Integers) -> TickImpairments:
        profile, shape = self._profile, (len(ticks), len(self._codes), len(self._links))
        lost, extra_s = self._chains(ticks)
        for trace_lost, on in self._traces(ticks):
            lost = lost | (trace_lost & on)
        delay_s = extra_s + self._delays(ticks)
        copied, copy_s = self._copies(ticks, shape)
        mark = np.zeros(shape, dtype=np.uint8)
        if profile.corrupt.any():
            mark = corrupt.marks(profile.corrupt, self.draw(Purpose.CORRUPTION, ticks, 1)[..., 0])
        jam_draws = self._jam_draws(ticks)
        return TickImpairments(
            closed=self._closed(ticks),
            lost=lost,
            delay_s=np.where(self._comms, delay_s, 0.0),
            delay_ticks=self._ticks(delay_s),
            copied=copied & self._comms,
            copy_delay_s=np.where(self._comms, copy_s + extra_s, 0.0),
            mark=np.where(self._comms, mark, np.uint8(0)),
            squared_limit=self._squared_limits(ticks),
            jams=jam_draws < np.array([zone.share for zone in profile.zones]),
        )

    def _jam_draws(self, ticks: Integers) -> Array:
        zones = len(self._profile.zones)
        return uniform(self._seed, Purpose.JAMMING, tick=ticks, lanes=zones) if zones else np.empty((len(ticks), 0))

    def _chains(self, ticks: Integers) -> tuple[Mask, Array]:
        layers = self._profile.chains
        lost = np.zeros((len(ticks), 1, len(self._links)), dtype=bool)
        extra = np.zeros((len(ticks), len(self._codes), len(self._links)))
        draws = self.draw(Purpose.LOSS, ticks, 2 * self._lanes)
        for n, layer in enumerate(layers):
            by_time, on = ~layer.by_packet, self.on(layer.sensing, layer.comms)
            states, self._states[n] = layer.walk(self._states[n], draws[..., 2 * layer.lane + 1])
            lost = lost | (layer.lost(states, draws[..., 2 * layer.lane]) & by_time & on)
            extra += layer.adds(states) * (by_time & self.acts(layer))
        return lost, extra

    def _traces(self, ticks: Integers) -> list[tuple[Mask, Mask]]:
        traces = self._profile.traces
        if not traces:
            return []
        draw = self.draw(Purpose.TRACE, ticks, 1)[..., 0]
        return [(trace.lost(ticks, draw), self.on(trace.sensing, trace.comms)) for trace in traces]

    def _closed(self, ticks: Integers) -> Mask:
        closed = np.zeros((len(ticks), 1, len(self._links)), dtype=bool)
        for schedule in self._profile.schedules:
            closed = closed | (schedule.closed(ticks)[:, None] & self.on(schedule.sensing, schedule.comms))
        return closed

    def _delays(self, ticks: Integers) -> Array:
        total = np.zeros((len(ticks), len(self._codes), len(self._links)))
        if not self._profile.delays:
            return total
        draws = self.draw(Purpose.DELAY, ticks, 2)
        for n, law in enumerate(self._profile.delays):
            share = self._swelling(n, law.correlation, draws[..., 0]) if law.correlation else draws[..., 0]
            total += np.where(law.rows, law.quantile(share), 0.0)
        return np.where(draws[..., 1] < self._profile.reorder, 0.0, total)

    def _swelling(self, n: int, correlation: float, draw: Array) -> Array:
        """Uniform numbers again, but each like the one before it."""
        fresh, swell = ndtri(draw), np.empty(draw.shape)
        for row in range(len(draw)):
            swell[row] = self._swell[n]
            self._swell[n] = delay.correlated(self._swell[n], fresh[row], correlation)
        share: Array = ndtr(swell)
        return share

    def _copies(self, ticks: Integers, shape: tuple[int, ...]) -> tuple[Mask, Array]:
        if not self._profile.duplicate.any():
            return np.zeros(shape, dtype=bool), np.zeros(shape)
        draws = self.draw(Purpose.DUPLICATE, ticks, 2)
        seconds = np.zeros(shape)
        for law in self._profile.delays:
            seconds += np.where(law.rows, law.quantile(draws[..., 1]), 0.0)
        return draws[..., 0] < self._profile.duplicate, seconds

    def _squared_limits(self, ticks: Integers) -> Array:
        limit = np.full((len(ticks), 1, len(self._links)), np.inf)
        for reach in self._profile.reaches:
            draw = self.draw(Purpose.REACH, ticks, 1)[..., 0] if reach.law is ReachLaw.RAMP else np.zeros(1)
            shadow = self._shadows(ticks, reach) if reach.law is ReachLaw.LOG_DISTANCE else np.zeros(1)
            limit = np.where(self.on(reach.sensing, reach.comms), np.minimum(limit, reach.limit(draw, shadow)), limit)
        return limit * limit

    def _shadows(self, ticks: Integers, reach: Reach) -> Array:
        """Standard normal, the same both ways and for a spell of ticks, shape (T, 1, L)."""
        src, dst = self._links.ends.values()
        low, high = np.minimum(src, dst), np.maximum(src, dst)
        spells, place = np.unique(ticks // reach.coherence, return_inverse=True)
        shadows: Array = ndtri(uniform(self._seed, Purpose.SHADOWING, tick=spells[:, None], src=low, dst=high))
        return shadows[place, None, :, 0]

    def _ticks(self, seconds: Array) -> Integers:
        whole = np.maximum(delay.ticks(seconds, self._profile.dt), self._profile.least_delay)
        return np.where(self._comms, whole, 0)

    def acts(self, layer: ChainLayer) -> Mask:
        """On which rows of what is drawn a chain delays messages, shape (C', 1): one row for all stands for communication."""
        shared = len(self._codes) < len(self._sensing)
        return np.array([[layer.comms]]) if shared else self.on(layer.sensing, layer.comms)

    def on(self, sensing: bool, comms: bool) -> Mask:
        """The channels on which something acts, shape (C, 1), or (1, 1) where all channels are alike."""
        return np.array([[sensing]]) if sensing == comms else np.where(self._comms, comms, sensing)

    def draw(self, purpose: Purpose, ticks: Integers, lanes: int) -> Array:
        """Uniform draws for every message of ticks (T,), shape (T, C', L, lanes); C' is 1 where channels share them."""
        if not lanes:
            return np.empty((len(ticks), len(self._codes), len(self._links), 0))
        return uniform(
            self._seed,
            purpose,
            tick=ticks[:, None, None],
            **self._links.ends,
            channel=self._codes[:, None],
            lanes=lanes,
        )
