"""What time alone decides of messages: losses of chains, traces and schedules, delays, duplicates and marks.

It depends on nothing that is offered, and so it is computed for many ticks at once. The chains and the correlated delays go
from tick to tick whether or not a message is sent.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from analysis.models.arrays import Array, Integers, Mask
from netem.core.draws import Purpose, Seed, uniform
from netem.core.links import Links
from netem.impairments import corrupt, delay
from netem.impairments.chain import ChainLayer
from netem.impairments.corrupt import Marks
from netem.impairments.profile import Profile
from netem.impairments.reach import Reach, ReachLaw
from netem.medium.verdict import PASSED, Verdict, VerdictCodes, also_held

_SPAN = 64

_CLOSED, _LOST = np.uint8(Verdict.CLOSED), np.uint8(Verdict.LOST)


class TickImpairments(NamedTuple):
    """Impairments of one tick, or of many with a leading axis.

    Parameters
    ----------
    held
        What holds a message: CLOSED where it is not the link's turn, LOST, or PASSED, shape (C, L), or (1, L) where all
        channels are alike.
    delay_s, delay_ticks
        What a message waits in the air if it is no measurement, in seconds and, no less than the least delay, in ticks, shape
        (C', L), or (1, L) where nothing waits.
    copied, copy_delay_s
        Messages that arrive twice if they are no measurements, and what their copies wait, in seconds, likewise.
    mark
        Corruption of what is no measurement, likewise.
    squared_limit
        Square of the distance up to which a message passes, in square metres, shape (C, L) or (1, L); infinite without.
    jams
        Whether each jammer is on, shape (zones,).
    """

    held: VerdictCodes
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
        self._still = _still(len(links), profile.least_delay)
        self._loss_lanes = max((2 * layer.lane + 1 + layer.moves for layer in profile.chains), default=0)
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
        profile = self._profile
        held, extra_s = self._chains(ticks)
        for trace_lost, on in self._traces(ticks):
            held = also_held(held, trace_lost & on, _LOST)
        for schedule in profile.schedules:
            closed = schedule.closed(ticks)[:, None] & self.on(schedule.sensing, schedule.comms)
            held = also_held(held, closed, _CLOSED)
        delay_s = self._delays(ticks, extra_s)
        copied, copy_s = self._copies(ticks, extra_s)
        return TickImpairments(
            held=held,
            delay_s=delay_s,
            delay_ticks=self._ticks(delay_s),
            copied=copied,
            copy_delay_s=copy_s,
            mark=self._marks(ticks),
            squared_limit=self._squared_limits(ticks),
            jams=self._jams(ticks),
        )

    def _jams(self, ticks: Integers) -> Mask:
        shares = np.array([zone.share for zone in self._profile.zones])
        if not len(shares):
            return self._still.jams
        jams: Mask = uniform(self._seed, Purpose.JAMMING, tick=ticks, lanes=len(shares)) < shares
        return jams

    def _chains(self, ticks: Integers) -> tuple[VerdictCodes, Array]:
        held, extra_s = self._still.held, self._still.delay_s
        draws = self.draw(Purpose.LOSS, ticks, self._loss_lanes)
        for n, layer in enumerate(self._profile.chains):
            by_time, on = ~layer.by_packet, self.on(layer.sensing, layer.comms)
            states = np.broadcast_to(self._states[n], draws.shape[:-1])
            if layer.moves:
                states, self._states[n] = layer.walk(self._states[n], draws[..., 2 * layer.lane + 1])
            held = also_held(held, layer.lost(states, draws[..., 2 * layer.lane]) & (by_time & on), _LOST)
            if layer.delays:
                extra_s = extra_s + layer.adds(states) * (by_time & self.acts(layer))
        return held, extra_s

    def _traces(self, ticks: Integers) -> list[tuple[Mask, Mask]]:
        traces = self._profile.traces
        if not traces:
            return []
        draw = self.draw(Purpose.TRACE, ticks, 1)[..., 0]
        return [(trace.lost(ticks, draw), self.on(trace.sensing, trace.comms)) for trace in traces]

    def _delays(self, ticks: Integers, extra_s: Array) -> Array:
        if not (self._profile.delays or self._profile.delay_traces):
            return extra_s
        draws = self.draw(Purpose.DELAY, ticks, 2)
        total = np.zeros(draws.shape[:-1])
        for n, law in enumerate(self._profile.delays):
            share = self._swelling(n, law.correlation, draws[..., 0]) if law.correlation else draws[..., 0]
            total += np.where(law.rows, law.quantile(share), 0.0)
        for trace in self._profile.delay_traces:
            total += trace.at(ticks)[:, None]
        return extra_s + np.where(draws[..., 1] < self._profile.reorder, 0.0, total)

    def _ticks(self, seconds: Array) -> Integers:
        if seconds is self._still.delay_s:
            return self._still.delay_ticks
        return delay.ticks(seconds, self._profile.dt, self._profile.least_delay)

    def _swelling(self, n: int, correlation: float, draw: Array) -> Array:
        """Uniform numbers again, but each like the one before it."""
        fresh, swell = ndtri(draw), np.empty(draw.shape)
        for row in range(len(draw)):
            swell[row] = self._swell[n]
            self._swell[n] = delay.correlated(self._swell[n], fresh[row], correlation)
        share: Array = ndtr(swell)
        return share

    def _copies(self, ticks: Integers, extra_s: Array) -> tuple[Mask, Array]:
        if not self._profile.duplicate.any():
            return self._still.copied, extra_s
        draws = self.draw(Purpose.DUPLICATE, ticks, 2)
        seconds = np.zeros(draws.shape[:-1])
        for law in self._profile.delays:
            seconds += np.where(law.rows, law.quantile(draws[..., 1]), 0.0)
        for trace in self._profile.delay_traces:
            seconds += trace.at(ticks)[:, None]
        return draws[..., 0] < self._profile.duplicate, seconds + extra_s

    def _marks(self, ticks: Integers) -> Marks:
        if not self._profile.corrupt.any():
            return self._still.mark
        return corrupt.marks(self._profile.corrupt, self.draw(Purpose.CORRUPTION, ticks, 1)[..., 0])

    def _squared_limits(self, ticks: Integers) -> Array:
        if not self._profile.reaches:
            return self._still.squared_limit
        limit = self._still.squared_limit
        for reach in self._profile.reaches:
            farthest = np.minimum(limit, self._limit(ticks, reach))
            limit = np.where(self.on(reach.sensing, reach.comms), farthest, limit)
        return limit * limit

    def _limit(self, ticks: Integers, reach: Reach) -> Array:
        """The distance in metres up to which each message passes, shape (T, C', L)."""
        if reach.law is ReachLaw.RAMP:
            return reach.limit(self.draw(Purpose.REACH, ticks, 1)[..., 0], np.zeros(1))
        spells, place = np.unique(ticks // reach.coherence, return_inverse=True)
        return reach.limit(np.zeros(1), self._shadows(spells))[place, None]

    def _shadows(self, spells: Integers) -> Array:
        """Standard normal, the same both ways, shape (S, L)."""
        src, dst = self._links.ends.values()
        low, high = np.minimum(src, dst), np.maximum(src, dst)
        draws = uniform(self._seed, Purpose.SHADOWING, tick=spells[:, None], src=low, dst=high)
        shadows: Array = ndtri(draws[..., 0])
        return shadows

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


def _still(links: int, least_delay: int) -> TickImpairments:
    """The ticks of an air without impairments; those of a profile share what it leaves as it is."""

    def always(value: Any) -> NDArray[Any]:
        return np.broadcast_to(np.full(links, value), (_SPAN, 1, links))

    return TickImpairments(
        held=always(PASSED),
        delay_s=always(0.0),
        delay_ticks=always(least_delay),
        copied=always(False),
        copy_delay_s=always(0.0),
        mark=always(np.uint8(0)),
        squared_limit=always(np.inf),
        jams=np.zeros((_SPAN, 0), dtype=bool),
    )
