"""What can become of a message, and the accounts that must close."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Integers
from netem.core.links import Links
from netem.faults.fault import Verb
from netem.faults.timeline import Conditions

Fates = NDArray[np.uint8]
Counts = Integers

# No layer holds the message: above every reason, so that the strongest reason is the smallest number.
PASSED = np.uint8(255)


class Fate(IntEnum):
    """What became of a message; from DEAD on, the reason it was dropped, the strongest first."""

    SILENT = 0  # nothing was offered
    DELIVERED = 1
    DELAYED = 2  # under way, delivered or dropped in a later tick
    DEAD = 3
    PAUSED = 4
    DEPARTED = 5
    CUT = 6
    PARTITION = 7
    SCRIPTED = 8
    DROPOUT = 9  # the sensor made no measurement
    CLOSED = 10
    RANGE = 11
    JAMMED = 12
    LISTED = 13
    LOST = 14
    OVERFLOW = 15

    @property
    def label(self) -> str:
        """Its name in journals, tables and pictures."""
        return self.name.lower()


FATE_OF = {
    Verb.KILL: Fate.DEAD,
    Verb.PAUSE: Fate.PAUSED,
    Verb.DEPART: Fate.DEPARTED,
    Verb.CUT: Fate.CUT,
    Verb.PARTITION: Fate.PARTITION,
    Verb.LOSE: Fate.SCRIPTED,
    Verb.DROPOUT: Fate.DROPOUT,
    Verb.DELAY: Fate.DELAYED,
}
REASONS = tuple(fate for fate in Fate if fate >= Fate.DEAD)


def standing(links: Links, now: Conditions) -> Fates:
    """What the timeline makes of a message offered on each link, shape (L,): a reason, or PASSED."""
    reason = np.full(len(links), PASSED)
    for fate, held in (
        (Fate.PARTITION, now.partitioned),
        (Fate.CUT, now.cut),
        (Fate.DEPARTED, links.touching(now.departed)),
        (Fate.DEAD, links.touching(now.dead)),
    ):
        reason[held] = fate
    return reason


def doom(links: Links, now: Conditions) -> Fates:
    """What the timeline makes of a message under way on each link, shape (L,): a reason to drop it, or PASSED."""
    receiver = links.dst - 1
    reason = np.full(len(links), PASSED)
    for fate, held in (
        (Fate.PARTITION, now.partition_drops),
        (Fate.CUT, now.cut_drops),
        (Fate.DEPARTED, now.departed[receiver]),
        (Fate.PAUSED, now.pause_drops),
        (Fate.DEAD, now.dead[receiver]),
    ):
        reason[held] = fate
    return reason


@dataclass(frozen=True)
class Ledger:
    """Every message accounted for: offered + copies = delivered + dropped + in flight."""

    offered: int
    copies: int
    delivered: int
    dropped: dict[str, int]

    @classmethod
    def of(cls, fates: Fates, copies: Counts, late: Counts, dropped: Counts) -> Ledger:
        """The accounts of a run.

        Parameters
        ----------
        fates
            Verdicts on what was offered, shape (ticks, C, L).
        copies
            Duplicates made in each tick, shape (ticks,).
        late
            Messages and copies that each tick delivered from under way, shape (ticks,).
        dropped
            Messages under way that each tick dropped, by fate, shape (ticks, fates).
        """
        offered = np.bincount(fates.ravel(), minlength=len(Fate))
        lost = offered + dropped.sum(axis=0)
        return cls(
            offered=int(offered.sum() - offered[Fate.SILENT]),
            copies=int(copies.sum()),
            delivered=int(offered[Fate.DELIVERED] + late.sum()),
            dropped={reason.label: int(lost[reason]) for reason in REASONS if lost[reason]},
        )

    @property
    def outstanding(self) -> int:
        """Messages that must still be in flight for the accounts to close."""
        return self.offered + self.copies - self.delivered - sum(self.dropped.values())
