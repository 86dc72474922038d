"""Which impairments apply to which links and channels: the standing state of the air, without the scripted faults."""

from __future__ import annotations

from dataclasses import dataclass

from netem.draws import Array
from netem.links import Integers


@dataclass(frozen=True)
class Profile:
    """The impairments of every directed link.

    Parameters
    ----------
    availability
        Probability in [0, 1] that a message gets through, shape (L,).
    delay_ticks
        One-way delay of communication in ticks, shape (L,). Sensing is not delayed.
    coupled
        Assumption 1 of paper 000: one verdict per directed link and tick serves sensing and all communication. Otherwise
        each channel is decided for itself.
    least_delay
        Ticks every communicated message takes at least: 0 for the synchronous exchange, 1 for `next-tick`.
    """

    availability: Array
    delay_ticks: Integers
    coupled: bool
    least_delay: int
