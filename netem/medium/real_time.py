"""The relay of a run in real time: a tick is judged when it begins, and each message is delivered when it is due.

Verdicts are those of lockstep: the same draws for the same tick, link and channel. What differs is when a message is said and
how long it is under way, which are seconds here. A tick is written down once everybody has said what was to be said in it, or
after some ticks: what has not been said by then is `UNSAID`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Generic, NamedTuple, TypeVar

import numpy as np

from analysis.models.arrays import Array, Mask
from netem.core.links import Links
from netem.core.plain import to_plain
from netem.faults.conditions import Conditions
from netem.impairments.corrupt import Mark
from netem.medium.entry import Entry
from netem.medium.in_flight import Verdicts, Waits
from netem.medium.medium import Medium
from netem.medium.open_tick import OpenTick, Voice
from netem.medium.parcels import Parcel, Parcels
from netem.medium.relay import FaultedRelay
from netem.medium.verdict import Verdict, doom

Said = TypeVar("Said")

_SILENT, _DELIVERED, _DELAYED = int(Verdict.SILENT), int(Verdict.DELIVERED), int(Verdict.DELAYED)
_STALE = int(Mark.STALE)
_ROUNDING = 1e-9  # ticks by which a time that is a whole number of them may fall short of it


class Begun(NamedTuple):
    """A tick that begins.

    Parameters
    ----------
    awake
        Numbers of the agents that hear and speak.
    seen
        Links whose measurement reaches the agent that made it, shape (L,).
    """

    awake: list[int]
    seen: Mask


class RealTimeRelay(FaultedRelay, Generic[Said]):
    """Relays messages as they come.

    Parameters
    ----------
    medium
        What decides.
    links, channels
        Over which, and how many channels there are, sensing first.
    dt
        Tick, in seconds.
    grace
        For how many ticks more may be said in a tick that is over.
    """

    def __init__(self, medium: Medium, links: Links, channels: int, dt: float, grace: int) -> None:
        super().__init__(medium)
        self._links, self._dt, self._grace = links, dt, grace
        self._state = medium.begin()
        self._speaking = range(1, channels)
        self._outgoing: dict[int, list[int]] = defaultdict(list)
        for row, src in enumerate(links.src.tolist()):
            self._outgoing[src].append(row)
        self._receiver = links.dst.tolist()
        self._parcels = Parcels[Said]()
        self._conditions: Conditions | None = None
        self._holds: Sequence[bool] = [False] * len(links)
        self._open: dict[int, OpenTick] = {}
        self._last_said: dict[Voice, tuple[int, Said]] = {}
        self._last_due: dict[tuple[int, int], float] = {}
        self._offered = np.zeros((channels, len(links)), dtype=np.int64)
        self._freed: list[Parcel[Said]] = []
        self._freed_s = 0.0
        self._tick = -1
        self.in_flight = 0

    @property
    def next_s(self) -> float | None:
        """When the next message is due, in simulated seconds."""
        return self._freed[0].due_s if self._freed else self._parcels.next_s

    def begin(self, tick: int, position: Array | None, measured: Array | None = None) -> Begun:
        """A tick begins: judge what will be said in it.

        Parameters
        ----------
        tick
            Its number.
        position
            The agents', shape (N, D), in metres; only a spatial profile needs them.
        measured
            What sensors said, shape (L, D), NaN of those that said nothing; None where all said something.
        """
        self._freed_s = tick * self._dt
        conditions = self.timeline.at(tick)
        self._state, verdicts = self._medium.judge(self._state, tick, self._medium.offered(tick, measured), position)
        waits = self._state.waits or _of_recorded(verdicts, tick, self._dt)
        now = self._open[tick] = OpenTick(tick, verdicts, waits)
        awake = (np.flatnonzero(~conditions.idle) + 1).tolist()
        now.unsaid = {(agent, channel) for agent in awake for channel in self._speaking}
        injected = self._newly_injected()
        now.injected = None if injected is None else to_plain(list(injected))
        self._tick = tick
        if conditions is not self._conditions:
            self._face(conditions, now)
        return Begun(awake, verdicts.kind[0] == _DELIVERED)

    def say(self, agent: int, channel: int, tick: int, said_s: float, said: Said) -> bool:
        """An agent has said something on a channel of this row: send it on its way, if it is not too late for that.

        It is where the tick is written down already, or the agent has spoken of a later one.

        Parameters
        ----------
        agent, channel
            Who says it, and where.
        tick
            Of which it speaks.
        said_s
            When it was said, in simulated seconds.
        said
            What was said.
        """
        spoken = self._open.get(tick)
        if spoken is None or (agent, channel) not in spoken.unsaid:
            return False
        self._give_up_before(tick, (agent, channel))
        spoken.unsaid.discard((agent, channel))
        for link in self._outgoing[agent]:
            kind = spoken.kind[channel, link] = spoken.decided[channel][link]
            if kind in (_DELIVERED, _DELAYED):
                self._send(spoken, agent, channel, link, said_s, said)
        self._last_said[agent, channel] = (tick, said)
        return True

    def arriving(self, now_s: float) -> list[Parcel[Said]]:
        """What arrives by now, in simulated seconds."""
        due = self._parcels.due(now_s, self._holds.__getitem__)
        # What was held is due when it is let go.
        arrived, self._freed = (
            [parcel._replace(due_s=max(parcel.due_s, self._freed_s)) for parcel in self._freed] + due,
            [],
        )
        for parcel in arrived:
            self._arrive(parcel)
        return arrived

    def receiver(self, parcel: Parcel[Said]) -> int:
        """To whom it goes."""
        return self._receiver[parcel.link]

    def closed(self, *, all_of_them: bool = False) -> Iterator[Entry]:
        """What is to be written down of ticks that are over, in order.

        Parameters
        ----------
        all_of_them
            Whether nothing more is said in any tick.
        """
        for tick in sorted(self._open):
            past = self._tick - tick
            if not all_of_them and (not past or (self._open[tick].unsaid and past <= self._grace)):
                return
            yield self._close(self._open.pop(tick))

    def _face(self, conditions: Conditions, now: OpenTick) -> None:
        self._conditions, self._holds = conditions, conditions.holds.tolist()
        dropped, freed = self._parcels.under(doom(self._links, conditions).tolist(), self._holds)
        for parcel, why in dropped:
            now.dropped.append((parcel.origin, parcel.channel, parcel.link, why))
            self._last_due.pop((parcel.channel, parcel.link), None)
        for parcel in freed:
            now.released.append((parcel.origin, parcel.channel, parcel.link))
        self._freed += freed

    def _give_up_before(self, tick: int, voice: Voice) -> None:
        """Whoever speaks of a tick says nothing more of those before it."""
        for earlier in range(self._last_said[voice][0] + 1 if voice in self._last_said else 0, tick):
            if earlier in self._open:
                self._open[earlier].unsaid.discard(voice)

    def _send(self, spoken: OpenTick, agent: int, channel: int, link: int, said_s: float, said: Said) -> None:
        tick, mark = spoken.tick, spoken.marks[channel][link]
        before, what_before = self._last_said.get((agent, channel), (None, said))
        if mark == _STALE and before != tick - 1:  # it has nothing old to say
            mark = 0
        content, what = (tick - 1, what_before) if mark == _STALE else (tick, said)
        due_s = self._in_order(spoken, channel, link, said_s + spoken.wait_s[channel][link])
        spoken.kind[channel, link], spoken.mark[channel, link] = _DELAYED, mark
        spoken.due[channel, link] = max(self._tick_of(due_s), tick)
        self._parcels.put(Parcel(due_s, tick, link, channel, False, content, mark, said_s, spoken, what))
        if spoken.doubled[channel][link]:
            due_s = self._in_order(spoken, channel, link, said_s + spoken.copy_wait_s[channel][link])
            spoken.copy_due[channel, link] = max(self._tick_of(due_s), tick)
            self._parcels.put(Parcel(due_s, tick, link, channel, True, tick, 0, said_s, spoken, said))

    def _in_order(self, spoken: OpenTick, channel: int, link: int, due_s: float) -> float:
        if not spoken.ordered[channel][link]:
            return due_s
        due_s = max(due_s, self._last_due.get((channel, link), due_s))
        self._last_due[channel, link] = due_s
        return due_s

    def _tick_of(self, due_s: float) -> int:
        return int(due_s / self._dt + _ROUNDING)

    def _arrive(self, parcel: Parcel[Said]) -> None:
        now, spoken = self._open[self._tick], parcel.origin
        channel, link = parcel.channel, parcel.link
        in_time = not parcel.is_copy and parcel.sent == self._tick
        if not spoken.is_closed:
            (spoken.copy_due if parcel.is_copy else spoken.due)[channel, link] = self._tick
        if in_time:
            spoken.kind[channel, link] = _DELIVERED
        if not in_time or parcel.mark:
            now.apart.append((parcel.content, link, channel, parcel.mark))
            now.late += not in_time

    def _close(self, over: OpenTick) -> Entry:
        entry = over.close(self._offered)
        self._offered = self._offered + (over.kind != _SILENT)
        self.in_flight += int((over.kind == _DELAYED).sum()) + entry.copies - entry.late - len(entry.dropped)
        return entry


def _of_recorded(verdicts: Verdicts, tick: int, dt: float) -> Waits:
    due, copy_due = (np.asarray(ticks - tick, np.float64) * dt for ticks in (verdicts.due, verdicts.copy_due))
    return Waits(due, copy_due, np.zeros(verdicts.kind.shape, dtype=bool))
