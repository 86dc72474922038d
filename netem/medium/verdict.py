"""What can become of a message, and what the timeline makes of it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from netem.core.links import Links
from netem.faults.fault import Verb
from netem.faults.timeline import Conditions

Fates = NDArray[np.uint8]

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
