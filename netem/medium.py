"""The medium: messages offered in a tick -> messages delivered in a tick, each with a verdict.

A loss is decided in `Medium.judge`, and nowhere else; `Ledger` counts it and `journal.py` writes it down. The layers are
independent: each says what it holds, a message passes when none holds it, and it is booked under the strongest that does, in
the order of `Fate`. To add an impairment, write its pure file beside `loss.py`. If time alone decides it, add it to
`weather.py`; if it loses messages, give it a `Fate` and name it in `judge`.

Nothing here knows what a message says: the medium works on who offered what, over (channels, links).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from netem import channels as channel_names
from netem import delay
from netem.air import Air, Delivery, Verdicts, deliver
from netem.corrupt import Mark, Marks
from netem.draws import Array, Purpose, Tape, uniform
from netem.fate import PASSED, Fate, Fates, doom, standing
from netem.links import Integers, Links, Mask
from netem.profile import Profile
from netem.reach import squared_distances
from netem.timeline import Conditions, Timeline
from netem.weather import Forecast, Weather

_SHARED_DRAW = 0

# Looking up the members of an enumeration costs as much as an operation on a small array.
_SILENT, _DELIVERED, _DELAYED = (np.uint8(fate) for fate in (Fate.SILENT, Fate.DELIVERED, Fate.DELAYED))
_SCRIPTED, _CLOSED, _RANGE = (np.uint8(fate) for fate in (Fate.SCRIPTED, Fate.CLOSED, Fate.RANGE))
_JAMMED, _LISTED, _LOST = (np.uint8(fate) for fate in (Fate.JAMMED, Fate.LISTED, Fate.LOST))
_OVERFLOW = np.uint8(Fate.OVERFLOW)
_STALE = np.uint8(Mark.STALE)


class Verdicted(Protocol):
    """A source of verdicts that were decided before: `journal.Recorded`."""

    def verdicts(self, tick: int, offered: Mask) -> Verdicts:
        """On the messages of a tick."""


def recorded(path: Path | None, links: Links, channels: Sequence[str]) -> Verdicted | None:
    """The verdicts in a journal, if there is one, for a run over these links and channels."""
    if path is None:
        return None
    from netem import journal  # pyarrow takes a while to import, and only a replay reads journals

    return journal.Recorded(journal.read(path), links, channels)


class _Under(NamedTuple):
    """What the timeline makes of messages offered, and of messages under way, link by link (L,); whether it loses any."""

    standing: Fates
    doom: Fates
    holds: Mask
    scripted: bool


class _Packets(NamedTuple):
    """What chains that step with the messages make of a tick: their states, the losses, and extra delay in seconds (C', L)."""

    states: tuple[Integers, ...]
    lost: Mask
    extra_s: Array


class Medium:
    """The air of one run: a profile, a timeline, and a seed.

    Parameters
    ----------
    seed
        Of the run.
    channels
        Names, sensing first; the rows of every (C, L) array.
    profile, timeline
        What impairs the links.
    recorded
        The verdicts of an earlier run, which then stand in place of all models.
    """

    def __init__(
        self,
        seed: int,
        channels: Sequence[str],
        profile: Profile,
        timeline: Timeline,
        recorded: Verdicted | None = None,
    ) -> None:
        self.profile = profile
        self.timeline = timeline
        self._seed = seed
        self._recorded = recorded
        self._links = timeline.links
        self._shape = (len(channels), len(self._links))
        self._sensing = np.array([name == channel_names.SENSE for name in channels])
        self._comms = ~self._sensing[:, None]
        self._names = np.array([channel_names.code(name) for name in channels], dtype=np.int64)
        self._codes = np.array([_SHARED_DRAW]) if profile.coupled else self._names
        self._forecast = Forecast(seed, self._links, profile, self._codes, self._sensing)
        self._packet_layers = [n for n, layer in enumerate(profile.chains) if layer.by_packet.any()]
        self._packet_lanes = 1 + max((profile.chains[n].lane for n in self._packet_layers), default=-1)
        orderly = [law.rows for law in profile.delays if law.ordered]
        self._ordered = np.logical_or.reduce([np.zeros(self._shape[1], dtype=bool), *orderly]) & self._comms
        self._keeps_order = bool(orderly)
        self._bits = np.where(self._sensing, 0.0, profile.message_bits)
        self._sender, self._receiver = self._links.src - 1, self._links.dst - 1
        self._corrupts, self._doubles = bool(profile.corrupt.any()), bool(profile.duplicate.any())
        self._unmarked, self._single = np.zeros(self._shape, dtype=np.uint8), np.full(self._shape, -1)
        self._scripted = Tape(lambda ticks: self._forecast.draw(Purpose.SCRIPTED_LOSS, ticks, 1)[..., 0])
        self._conditions: Conditions | None = None
        self._cached: _Under

    def begin(self) -> Air:
        """The air before the first tick."""
        layers = [self.profile.chains[n] for n in self._packet_layers]
        draws = self._forecast.draw(Purpose.CHAIN_START, np.zeros(1, dtype=np.int64), self._packet_lanes)[0]
        states = tuple(layer.begin(draws[..., layer.lane]) for layer in layers)
        debt = self.profile.rate.begin() if self.profile.rate else np.zeros(self._shape[1])
        return Air.empty(self._shape, debt, states)

    def judge(self, air: Air, tick: int, offered: Mask, position: Array | None) -> tuple[Air, Verdicts]:
        """The verdict on every message offered in a tick.

        Parameters
        ----------
        air
            As the tick before left it.
        tick
            Of the offer.
        offered
            True where a message was offered on (channel, link), shape (C, L).
        position
            The agents', shape (N, D), in metres; only a spatial profile needs them.
        """
        if self._recorded:
            return air._replace(offered=air.offered + offered), self._recorded.verdicts(tick, offered)
        weather, now = self._forecast.at(tick), self.timeline.at(tick)
        packets = self._packet_chains(air, tick, offered)
        reason = np.full(self._shape, PASSED)
        for fate, held in self._layers(air, tick, weather, packets, position):
            np.copyto(reason, fate, where=held)
        reason = np.minimum(reason, self._under(now).standing)
        passed = offered & (reason == PASSED)
        debt, overflow, due, waited_s = self._due(air, tick, weather, packets.extra_s, passed)
        if overflow is not None:
            np.copyto(reason, _OVERFLOW, where=overflow)
            passed &= ~overflow
        np.copyto(reason, _DELIVERED, where=passed)
        np.copyto(reason, _DELAYED, where=passed & (due > tick))
        np.copyto(reason, _SILENT, where=~offered)
        copy_due = self._copies(tick, weather, passed, due, waited_s)
        verdicts = Verdicts(reason, due, self._marks(air, weather, passed), copy_due)
        last_due = np.where(passed, np.maximum(due, copy_due), air.last_due) if self._keeps_order else air.last_due
        return Air(air.under_way, air.offered + offered, offered, last_due, debt, packets.states), verdicts

    def deliver(self, air: Air, tick: int, verdicts: Verdicts) -> tuple[Air, Delivery]:
        """What arrives in this tick: the messages just passed, and those under way that are due."""
        under = self._under(self.timeline.at(tick))
        return deliver(air, tick, verdicts, under.doom, under.holds)

    @property
    def ahead(self) -> bool:
        """Whether a tick can be judged before it is known where the agents are."""
        return bool(self._recorded) or not self.profile.spatial

    def bit_draws(self, content: Integers, channel: Integers, link: Integers) -> Array:
        """Which number and which bit of corrupted messages flip: uniform, shape (m, 2), for rows of messages (m,)."""
        src, dst = self._links.src[link], self._links.dst[link]
        names = self._names[channel]
        return uniform(self._seed, Purpose.CORRUPTED_BIT, tick=content, src=src, dst=dst, channel=names, lanes=2)

    def _under(self, now: Conditions) -> _Under:
        """What these conditions mean for the links; they stay the same for many ticks."""
        if now is not self._conditions:
            links = self._links
            self._conditions, self._cached = (
                now,
                _Under(standing(links, now), doom(links, now), now.holds, bool(now.loss.any())),
            )
        return self._cached

    def _layers(
        self, air: Air, tick: int, weather: Weather, packets: _Packets, position: Array | None
    ) -> Iterator[tuple[np.uint8, Mask]]:
        """The layers that change from tick to tick, and what each holds: the weakest first."""
        yield _LOST, weather.lost
        if packets.states:
            yield _LOST, packets.lost
        if len(self.profile.listed):
            yield _LISTED, self._listed(air.offered)
        if self.profile.spatial:
            if position is None:
                raise ValueError("loss by distance and jammed zones need the positions of the tick")
            for zone, on in zip(self.profile.zones, weather.jams.tolist(), strict=True):
                if on:
                    yield _JAMMED, zone.jammed(self._receiver, position) & self._forecast.on(zone.sensing, zone.comms)
            if self.profile.reaches:
                yield _RANGE, squared_distances(self._sender, self._receiver, position) > weather.squared_limit
        if self.profile.schedules:
            yield _CLOSED, weather.closed
        if self._under(self.timeline.at(tick)).scripted:
            yield _SCRIPTED, self._scripted.at(tick) < self.timeline.at(tick).loss

    def _listed(self, offered: Integers) -> Mask:
        link, listed, sensing, comms = self.profile.listed.T
        number = offered[:1] if self.profile.coupled else offered  # one verdict for all: that on the sensing
        hit = (number[:, link] == listed) & np.where(self._sensing[:, None], sensing, comms).astype(bool)
        held = np.zeros(self._shape, dtype=bool)
        channel, row = np.nonzero(hit)
        held[channel, link[row]] = True
        return held

    def _packet_chains(self, air: Air, tick: int, offered: Mask) -> _Packets:
        lost = np.zeros(self._shape, dtype=bool)
        extra = np.zeros((len(self._codes), self._shape[1]))
        if not self._packet_layers:
            return _Packets((), lost, extra)
        moves = offered.any(axis=0, keepdims=True) if self.profile.coupled else offered
        draws = self._forecast.draw(Purpose.PACKET_CHAIN, np.array([tick]), 2 * self._packet_lanes)[0]
        states = []
        for n, state in zip(self._packet_layers, air.packet_states, strict=True):
            layer = self.profile.chains[n]
            on = self._forecast.on(layer.sensing, layer.comms)
            lost |= layer.lost(state, draws[..., 2 * layer.lane]) & layer.by_packet & on
            extra += layer.adds(state) * (layer.by_packet & self._forecast.acts(layer))
            _, following = layer.walk(state, draws[None, ..., 2 * layer.lane + 1])
            states.append(np.where(moves, following, state))
        return _Packets(tuple(states), lost, extra)

    def _due(
        self, air: Air, tick: int, weather: Weather, extra_s: Array, passed: Mask
    ) -> tuple[Array, Mask | None, Integers, Array]:
        """The queues' debt, what they refuse, when the others arrive, and what queues and packet chains let them wait."""
        rate, overflow, debt, wait = self.profile.rate, None, air.debt, weather.delay_ticks
        if self._packet_layers or rate:
            if rate:
                debt, overflow, queued = rate.admit(rate.rest(debt, self.profile.dt), self._bits, passed)
                extra_s = extra_s + queued
            wait = delay.ticks(weather.delay_s + extra_s, self.profile.dt)
            wait = np.where(self._comms, np.maximum(wait, self.profile.least_delay), 0)
        due = tick + wait
        if self._keeps_order:
            due = np.where(self._ordered, np.maximum(due, air.last_due), due)
        return debt, overflow, due, extra_s

    def _marks(self, air: Air, weather: Weather, passed: Mask) -> Marks:
        if not self._corrupts:
            return self._unmarked
        return weather.mark * (passed & ((weather.mark != _STALE) | air.spoke))

    def _copies(self, tick: int, weather: Weather, passed: Mask, due: Integers, waited_s: Array) -> Integers:
        if not self._doubles:
            return self._single
        wait = delay.ticks(weather.copy_delay_s + waited_s, self.profile.dt)
        arrival = tick + np.maximum(wait, self.profile.least_delay)
        if self._keeps_order:
            arrival = np.where(self._ordered, np.maximum(arrival, due), arrival)
        return np.where(passed & weather.copied, arrival, -1)
