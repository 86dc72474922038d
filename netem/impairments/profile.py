"""Which impairments apply to which links and channels: the standing state of the air, without the scripted faults."""

from __future__ import annotations

from dataclasses import dataclass

from analysis.models.arrays import Array, Integers
from netem.impairments.chain import ChainLayer
from netem.impairments.delay import MessageDelay
from netem.impairments.jamming import Zone
from netem.impairments.own import OwnLoss
from netem.impairments.rate import Rate
from netem.impairments.rate_over_time import RateOverTime
from netem.impairments.reach import Reach
from netem.impairments.schedule import Schedule
from netem.impairments.trace import DelayTrace, Trace


@dataclass(frozen=True)
class Profile:
    """The impairments of every directed link. Only communication is delayed, doubled, overtaken or limited in rate.

    Parameters
    ----------
    dt
        Tick, in seconds.
    coupled
        Assumption 1 of paper 000: one verdict per directed link and tick serves sensing and all communication. Otherwise
        each channel is decided for itself.
    least_delay
        Ticks every communicated message takes at least: 0 for the synchronous exchange, 1 for `next-tick`.
    chains, traces
        Losses that time decides; a message passes when none loses it.
    schedules
        Links that take turns.
    reaches, zones
        Losses that positions decide.
    own
        Losses of a user's own.
    listed
        Messages that are dropped, by number: rows of (link row, how many were offered before it, whether on sensing, whether
        on communication), shape (m, 4).
    delays, delay_traces
        What a message waits, in sum.
    duplicate, reorder
        Probabilities that a message arrives twice, and that its `delays` are left out, shape (L,).
    corrupt, bias
        Probabilities of each kind of corruption, shape (L, 4), and what a bias adds, shape (L,).
    rate, rate_trace
        Limits of rate and queue, if any; those that change over time in place of those that do not.
    message_bits
        Size of a message, by channel, shape (C,).
    """

    dt: float
    coupled: bool
    least_delay: int
    chains: tuple[ChainLayer, ...]
    traces: tuple[Trace, ...]
    schedules: tuple[Schedule, ...]
    reaches: tuple[Reach, ...]
    zones: tuple[Zone, ...]
    own: tuple[OwnLoss, ...]
    listed: Integers
    delays: tuple[MessageDelay, ...]
    delay_traces: tuple[DelayTrace, ...]
    duplicate: Array
    reorder: Array
    corrupt: Array
    bias: Array
    rate: Rate | None
    rate_trace: RateOverTime | None
    message_bits: Array

    @property
    def limits(self) -> Rate | RateOverTime | None:
        """Limits of rate and queue, if any."""
        return self.rate_trace or self.rate

    @property
    def spatial(self) -> bool:
        """Whether a verdict depends on where the agents are."""
        return bool(self.reaches or self.zones) or any(loss.by_position for loss in self.own)
