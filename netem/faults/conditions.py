"""What all faults together impose in one tick."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Array, Mask
from netem.faults.fault import Fault, Verb


class Acting(NamedTuple):
    """A fault in force, and the links (L,) and the agents (N,) that it names."""

    fault: Fault
    links: Mask
    agents: Mask


@dataclass(frozen=True)
class Conditions:
    """What the timeline imposes in one tick.

    Parameters
    ----------
    dead, paused, departed
        Agents whose processes are dead, or stopped, and agents that have left the formation, shape (N,).
    drifting, vanished
        Departed agents whose bodies fly on as they did, or are gone, shape (N,).
    cut, partitioned
        Links that carry nothing, shape (L,).
    cut_drops, partition_drops, pause_drops, holds
        Links on which messages under way are dropped by a cut, a partition or a paused receiver, or wait, shape (L,).
    loss, dropout
        Probabilities of scripted loss, and of a measurement that is not made, shape (L,).
    delay_s
        Scripted delay, shape (L,), in seconds.
    profile
        Which profile rules each link, 0 its own, shape (L,).
    frozen
        Links whose sensor repeats itself, shape (L,).
    bias, push
        What is added to measurements, in metres, and to velocities, in metres per second, shape (L, D) and (N, D), or (L, 1)
        and (N, 1) of zeros.
    outlier, deviation
        Probability of an outlier, and its standard deviation in metres, shape (L,).
    acting
        All faults in force, each with the links (L,) and the agents (N,) that it names.
    """

    dead: Mask
    paused: Mask
    departed: Mask
    drifting: Mask
    vanished: Mask
    cut: Mask
    partitioned: Mask
    cut_drops: Mask
    partition_drops: Mask
    pause_drops: Mask
    holds: Mask
    loss: Array
    dropout: Array
    delay_s: Array
    profile: NDArray[np.uint8]
    frozen: Mask
    bias: Array
    push: Array
    outlier: Array
    deviation: Array
    acting: tuple[Acting, ...]

    def under(self, verb: Verb) -> list[Acting]:
        """Those of a verb."""
        return [one for one in self.acting if one.fault.verb is verb]

    @cached_property
    def liars(self) -> tuple[Fault, ...]:
        """Faults by which agents lie."""
        return tuple(one.fault for one in self.under(Verb.LIE))

    @cached_property
    def absent(self) -> Mask:
        """Agents that take no part: dead or departed, shape (N,)."""
        return self.dead | self.departed

    @cached_property
    def idle(self) -> Mask:
        """Agents whose processes neither hear nor speak, shape (N,)."""
        return self.dead | self.paused

    @cached_property
    def still(self) -> Mask:
        """Agents whose bodies hold where they are, shape (N,)."""
        return self.absent & ~self.coasting

    @cached_property
    def coasting(self) -> Mask:
        """Agents whose bodies fly on with the input they had, shape (N,)."""
        return ((self.paused & ~self.departed) | self.drifting) & ~self.dead
