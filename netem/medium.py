"""The medium: messages offered in a tick -> messages delivered in a tick, each with a verdict.

A loss is decided in `Medium.judge`, and nowhere else; it is counted in `Ledger`. The layers are independent: dead and
departed agents, scripted cuts, partitions and the stochastic profile each say which links they hold; a message passes when
none holds it, and is booked under the first that does, in the order of `Fate`. To add an impairment, write its pure file
beside `loss.py`, give it a `Fate`, and name it in `judge`.

Nothing here knows what a message says: the medium works on who offered what, over (channels, links).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from netem import channels as channel_names
from netem import delay, loss
from netem.draws import Purpose, Tape, uniform
from netem.links import Integers, Mask
from netem.profile import Profile
from netem.timeline import Conditions, Timeline, Verb

Fates = NDArray[np.uint8]

_SHARED_DRAW = 0


class Fate(IntEnum):
    """What became of a message; from DEAD on, the reason it was dropped, the strongest first."""

    SILENT = 0  # nothing was offered
    DELIVERED = 1
    DELAYED = 2  # under way, delivered or dropped in a later tick
    DEAD = 3
    DEPARTED = 4
    CUT = 5
    PARTITION = 6
    LOST = 7

    @property
    def label(self) -> str:
        """Its name in journals, tables and pictures."""
        return self.name.lower()


FATE_OF = {
    Verb.KILL: Fate.DEAD,
    Verb.DEPART: Fate.DEPARTED,
    Verb.CUT: Fate.CUT,
    Verb.PARTITION: Fate.PARTITION,
}
REASONS = tuple(fate for fate in Fate if fate >= Fate.DEAD)


@dataclass(frozen=True)
class InFlight:
    """Messages under way: rows of (due tick, sent tick, channel row, link row), shape (m, 4)."""

    rows: Integers = field(default_factory=lambda: np.empty((0, 4), dtype=np.int64))

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(frozen=True)
class Delivery:
    """What arrives in one exchange.

    Parameters
    ----------
    sent
        Tick in which the newest message arriving on (channel, link) was sent, -1 for none, shape (C, L).
    late
        Messages sent in earlier ticks, rows of (sent tick, link row, channel row) in that order, shape (m, 3).
    dropped
        Fates of messages that were under way when their receiver went, shape (d,).
    """

    sent: Integers
    late: Integers
    dropped: Fates


@dataclass(frozen=True)
class Ledger:
    """Every message accounted for: offered = delivered + dropped + in flight."""

    offered: int
    delivered: int
    dropped: dict[str, int]

    @classmethod
    def of(cls, fates: Fates, late: NDArray[np.int64], dropped: NDArray[np.int64]) -> Ledger:
        """The accounts of a run.

        Parameters
        ----------
        fates
            Verdicts on what was offered, shape (ticks, C, L).
        late
            Messages of earlier ticks that each tick delivered, shape (ticks,).
        dropped
            Messages under way that each tick dropped, by fate, shape (ticks, fates).
        """
        offered = np.bincount(fates.ravel(), minlength=len(Fate))
        lost = offered + dropped.sum(axis=0)
        return cls(
            offered=int(offered.sum() - offered[Fate.SILENT]),
            delivered=int(offered[Fate.DELIVERED] + late.sum()),
            dropped={reason.label: int(lost[reason]) for reason in REASONS if lost[reason]},
        )

    @property
    def outstanding(self) -> int:
        """Messages that must still be in flight for the accounts to close."""
        return self.offered - self.delivered - sum(self.dropped.values())


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
    """

    def __init__(self, seed: int, channels: Sequence[str], profile: Profile, timeline: Timeline) -> None:
        self.channels = tuple(channels)
        self.profile = profile
        self.timeline = timeline
        self.links = timeline.links
        self._sensing = np.array([name == channel_names.SENSE for name in self.channels])
        codes = [_SHARED_DRAW] if profile.coupled else [channel_names.code(name) for name in self.channels]
        self._last_conditions: Conditions | None = None
        self._last_standing: Fates = np.empty(0, dtype=np.uint8)
        self._loss = Tape(lambda ticks: self._loss_draws(seed, codes, ticks))

    def judge(self, tick: int, offered: Mask) -> Fates:
        """The verdict on every message offered in a tick.

        Parameters
        ----------
        tick
            Of the offer.
        offered
            True where a message was offered on (channel, link), shape (C, L).

        Returns
        -------
        Fates
            Shape (C, L).
        """
        lost = loss.lost(self.profile.availability, self._loss.at(tick))
        standing = self._standing(self.timeline.at(tick))
        passed = np.where(lost & (standing < Fate.DEAD), np.uint8(Fate.LOST), standing)
        return np.where(offered, passed, np.uint8(Fate.SILENT))

    def deliver(self, tick: int, in_flight: InFlight, fates: Fates) -> tuple[InFlight, Delivery]:
        """What arrives in this tick: the messages just passed, and those under way that are due.

        A cut or a loss acts on a message when it is offered; what is already under way still arrives, unless its
        receiver is dead or departed by then.
        """
        on_time = fates == Fate.DELIVERED
        sent = np.where(on_time, tick, -1)
        channel, link = np.nonzero(fates == Fate.DELAYED)
        if not len(in_flight) and not len(channel):
            return in_flight, Delivery(sent, np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.uint8))
        due = np.broadcast_to(self._due(tick), fates.shape)[channel, link]
        rows = np.concatenate([in_flight.rows, np.stack([due, np.full_like(due, tick), channel, link], axis=-1)])
        arriving, waiting = rows[rows[:, 0] == tick], rows[rows[:, 0] > tick]
        now = self.timeline.at(tick)
        receiver = self.links.dst[arriving[:, 3]] - 1
        gone = np.where(now.dead[receiver], Fate.DEAD, np.where(now.departed[receiver], Fate.DEPARTED, Fate.SILENT))
        late = arriving[gone == Fate.SILENT][:, [1, 3, 2]]
        late = late[np.lexsort((late[:, 2], late[:, 1], late[:, 0]))]
        np.maximum.at(sent, (late[:, 2], late[:, 1]), late[:, 0])
        return InFlight(waiting), Delivery(sent, late, gone[gone != Fate.SILENT].astype(np.uint8))

    def _standing(self, now: Conditions) -> Fates:
        """What the layers other than loss make of a message under the same conditions, shape (C, L)."""
        if now is not self._last_conditions:
            fates = np.where(self._due(0) > 0, np.uint8(Fate.DELAYED), np.uint8(Fate.DELIVERED))
            for reason, held in (
                (Fate.PARTITION, now.partitioned),
                (Fate.CUT, now.cut),
                (Fate.DEPARTED, self.links.touching(now.departed)),
                (Fate.DEAD, self.links.touching(now.dead)),
            ):
                fates[:, held] = reason
            self._last_conditions, self._last_standing = now, fates
        return self._last_standing

    def _due(self, tick: int) -> Integers:
        communicated = delay.due(tick, self.profile.delay_ticks, self.profile.least_delay)
        return np.where(self._sensing[:, None], tick, communicated)

    def _loss_draws(self, seed: int, codes: Sequence[int], ticks: Integers) -> NDArray[np.float64]:
        return uniform(
            seed,
            Purpose.LOSS,
            tick=ticks[:, None, None],
            src=self.links.src,
            dst=self.links.dst,
            channel=np.array(codes)[:, None],
        )[..., 0]
