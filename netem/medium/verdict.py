"""What can become of a message, and what the timeline makes of it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from analysis.kernels.kernel import Part, Plain, kernel
from analysis.models.arrays import Mask
from netem.core.links import Links
from netem.faults.conditions import Conditions
from netem.faults.fault import Verb

VerdictCodes = NDArray[np.uint8]

PASSED = np.uint8(255)  # no layer holds the message


class Verdict(IntEnum):
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
    UNSAID = 16  # in real time: whoever was to say it did not, or not in time

    @property
    def label(self) -> str:
        """Its name in journals, tables and pictures."""
        return self.name.lower()


VERDICT_OF = {
    Verb.KILL: Verdict.DEAD,
    Verb.PAUSE: Verdict.PAUSED,
    Verb.DEPART: Verdict.DEPARTED,
    Verb.CUT: Verdict.CUT,
    Verb.PARTITION: Verdict.PARTITION,
    Verb.LOSE: Verdict.SCRIPTED,
    Verb.DROPOUT: Verdict.DROPOUT,
    Verb.DELAY: Verdict.DELAYED,
}
STRONGEST_FIRST = (
    *(
        Verdict.DEAD,
        Verdict.PAUSED,
        Verdict.DEPARTED,
        Verdict.CUT,
        Verdict.PARTITION,
        Verdict.SCRIPTED,
        Verdict.DROPOUT,
    ),
    *(Verdict.CLOSED, Verdict.RANGE, Verdict.JAMMED, Verdict.LISTED, Verdict.LOST, Verdict.OVERFLOW),
    Verdict.UNSAID,
)
REASONS = tuple(kind for kind in Verdict if kind >= Verdict.DEAD)
COUNTED = (Verdict.DELIVERED, Verdict.DELAYED, *REASONS)  # of what was offered
BY_THE_AIR = (Verdict.CLOSED, Verdict.RANGE, Verdict.JAMMED, Verdict.LISTED, Verdict.LOST, Verdict.OVERFLOW)

# Looking up the members of an enumeration costs as much as an operation on a small array.
_DELIVERED, _DELAYED = int(Verdict.DELIVERED), int(Verdict.DELAYED)

_RANK = np.full(256, len(STRONGEST_FIRST), dtype=np.uint8)
_RANK[list(STRONGEST_FIRST)] = np.arange(len(STRONGEST_FIRST))


@Part
def passed(verdict: int) -> bool:
    """Whether the medium let a message pass, now or later."""
    return verdict in (_DELIVERED, _DELAYED)


@Part
def strongest(one: int, other: int) -> int:
    """Of two reasons, or PASSED, the one under which a message is booked that both hold."""
    return one if _RANK[one] <= _RANK[other] else other


def stronger(one: VerdictCodes, other: VerdictCodes) -> VerdictCodes:
    """Of two reasons, or PASSED, the one under which a message is booked that both hold, elementwise."""
    held: VerdictCodes = _stronger(one, other)
    return held


@kernel("(),()->()", "BB->B")
def _stronger() -> Plain:
    def plain(one: int, other: int, held: VerdictCodes) -> None:
        held[0] = strongest(one, other)

    return plain


def also_held(reason: VerdictCodes, where: Mask, kind: np.uint8) -> VerdictCodes:
    """The reasons, or PASSED, of messages of which one more layer holds those where it is true, elementwise."""
    held: VerdictCodes = _also_held(reason, where, kind)
    return held


@kernel("(),(),()->()", "B?B->B")
def _also_held() -> Plain:
    def plain(reason: int, where: bool, kind: int, held: VerdictCodes) -> None:
        held[0] = strongest(reason, kind) if where else reason

    return plain


def standing(links: Links, now: Conditions) -> VerdictCodes:
    """What the timeline makes of a message offered on each link, shape (L,): a reason, or PASSED."""
    reason = np.full(len(links), PASSED)
    for kind, held in (
        (Verdict.PARTITION, now.partitioned),
        (Verdict.CUT, now.cut),
        (Verdict.DEPARTED, links.touching(now.departed)),
        (Verdict.DEAD, links.touching(now.dead)),
    ):
        reason[held] = kind
    return reason


def doom(links: Links, now: Conditions) -> VerdictCodes:
    """What the timeline makes of a message under way on each link, shape (L,): a reason to drop it, or PASSED."""
    receiver = links.dst - 1
    reason = np.full(len(links), PASSED)
    for kind, held in (
        (Verdict.PARTITION, now.partition_drops),
        (Verdict.CUT, now.cut_drops),
        (Verdict.DEPARTED, now.departed[receiver]),
        (Verdict.PAUSED, now.pause_drops),
        (Verdict.DEAD, now.dead[receiver]),
    ):
        reason[held] = kind
    return reason
