"""What can become of a message, and what the timeline makes of it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from netem.core.links import Links
from netem.faults.fault import Verb
from netem.faults.timeline import Conditions

Fates = NDArray[np.uint8]

PASSED = np.uint8(255)  # no layer holds the message


class Fate(IntEnum):
    """What became of a message; from DEAD on, the reason it was dropped.

    The numbers stand in arrays and digests and never change: another reason takes the next one, and its place in
    `STRONGEST_FIRST`.
    """

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
STRONGEST_FIRST = (
    *(Fate.DEAD, Fate.PAUSED, Fate.DEPARTED, Fate.CUT, Fate.PARTITION, Fate.SCRIPTED, Fate.DROPOUT),
    *(Fate.CLOSED, Fate.RANGE, Fate.JAMMED, Fate.LISTED, Fate.LOST, Fate.OVERFLOW),
)
REASONS = tuple(fate for fate in Fate if fate >= Fate.DEAD)
BY_THE_AIR = (Fate.CLOSED, Fate.RANGE, Fate.JAMMED, Fate.LISTED, Fate.LOST, Fate.OVERFLOW)

_RANK = np.full(256, len(STRONGEST_FIRST), dtype=np.uint8)
_RANK[list(STRONGEST_FIRST)] = np.arange(len(STRONGEST_FIRST))


def stronger(one: Fates, other: Fates) -> Fates:
    """Of two reasons, or PASSED, the one under which a message is booked that both hold, elementwise."""
    return np.where(_RANK[one] <= _RANK[other], one, other)


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
