"""Sensors and radios that take turns: links that are closed by the clock, not by chance.

A schedule is a chain that is never in doubt: its states follow each other in a circle. So its mean loss, bursts and ages come
from the same closed forms.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from analysis.models.arrays import Integers, Mask
from netem.core.links import Links
from netem.impairments.chain import Chain


@dataclass(frozen=True)
class Schedule:
    """Links that are open in some ticks of a period.

    Parameters
    ----------
    period
        Ticks after which it repeats, shape (L,); 1 where a link is always open.
    begins, lasts
        The link is open in ticks k with (k - begins) mod period < lasts, shape (L,).
    sensing, comms
        The channel classes on which it acts.
    """

    period: Integers
    begins: Integers
    lasts: Integers
    sensing: bool
    comms: bool

    def closed(self, ticks: Integers) -> Mask:
        """True where a link is closed, shape (T, L), in ticks (T,)."""
        shut: Mask = (ticks[:, None] - self.begins) % self.period >= self.lasts
        return shut


def round_robin(links: Links, held: int) -> tuple[Integers, Integers, Integers]:
    """Every agent looks at one neighbour at a time, for `held` ticks each: (period, begins, lasts), each (L,)."""
    place = np.zeros(len(links), dtype=np.int64)
    place[links.slots[links.present]] = np.broadcast_to(np.arange(links.present.shape[1]), links.present.shape)[
        links.present
    ]
    degree = links.degree[links.dst - 1]
    return degree * held, place * held, np.full(len(links), held)


def slotted(links: Links, held: int) -> tuple[Integers, Integers, Integers]:
    """Every agent speaks in its own slot of `held` ticks (time division): (period, begins, lasts), each (L,)."""
    whole = np.full(len(links), links.agents * held)
    return whole, (links.src - 1) * held, np.full(len(links), held)


def turning(period: int, lasts: int) -> Chain:
    """The chain of a link open in `lasts` ticks of each `period`: mean loss 1 - lasts / period."""
    return Chain(
        np.roll(np.eye(period), 1, axis=1),
        (np.arange(period) >= lasts).astype(np.float64),
        np.zeros(period),
    )
