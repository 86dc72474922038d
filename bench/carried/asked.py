"""Rows on what a journal says of every message against what was asked of the air, in all and link by link."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from against import Against, Row
from lossy import burst_rows

from analysis.models.arrays import Array, Mask
from netem.impairments.chain import Chain
from netem.impairments.corrupt import Mark
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict

_LONGEST = 60  # ticks of a delay that are told apart


class Asked(NamedTuple):
    """A profile, and what follows from it.

    Parameters
    ----------
    parameters
        In the words of the table.
    text
        As a scenario has it.
    chain
        All its losses together.
    delay
        Distribution function of the delay of communication, in seconds; None without.
    duplicate, corrupt
        Chances of a copy, and of each mark.
    """

    parameters: str
    text: str
    chain: Chain
    delay: Callable[[Array], Array] | None = None
    duplicate: float = 0.0
    corrupt: Mapping[Mark, float] = {}


def rows(against: Against, asked: Asked, made: Verdicts, dt: float) -> Iterator[Row]:
    """Losses of all channels, and what happens to communication, of verdicts (T, C, L) that begin with the sensing."""
    lost = made.kind == Verdict.LOST
    yield from losses(against, asked.chain, lost)
    passed = ~lost[:, 1:]
    if asked.delay is not None:
        wait = (made.due[:, 1:] - np.arange(len(lost))[:, None, None]).clip(0, _LONGEST)
        whole = asked.delay(np.arange(float(_LONGEST)) * dt)
        chances = np.diff(whole, prepend=0.0)
        yield against.counts("delay, ticks", chances, np.bincount(wait[passed], minlength=_LONGEST + 1))
        yield _of_links(against, "delay on each link, ticks", chances, wait, passed)
    if asked.duplicate:
        copied = made.copy_due[:, 1:] >= 0
        yield against.share("copies", asked.duplicate, copied[passed])
        yield _shares(against, "copies on each link", asked.duplicate, copied, passed)
    for mark, chance in asked.corrupt.items():
        struck = made.mark[:, 1:] == mark
        yield against.share(
            f"{mark.label} messages", chance, struck[1:][passed[1:]]
        )  # nothing is stale in the first tick
    if asked.corrupt:
        wrong, chance = made.mark[1:, 1:] > 0, sum(asked.corrupt.values())
        yield _shares(against, "corrupted on each link", chance, wrong, passed[1:])


def losses(against: Against, chain: Chain, lost: Mask) -> Iterator[Row]:
    """Of messages lost (T, C, L), each channel and link by itself."""
    ticks, channels, _ = lost.shape
    variance = mean_variance(chain, ticks)
    apart = lost.reshape(ticks, -1)
    yield against.normal("mean loss", chain.mean_loss, float(lost.mean()), (variance / apart.shape[1]) ** 0.5)
    each = (lost.mean(axis=(0, 1)) - chain.mean_loss) / (variance / channels) ** 0.5
    yield against.standard(
        "loss on each link", each, float(lost.mean(axis=(0, 1)).min()), float(lost.mean(axis=(0, 1)).max())
    )
    yield from burst_rows(against, chain, apart)


def mean_variance(chain: Chain, ticks: int) -> float:
    """Variance of the share that a chain loses of so many messages in a row, in closed form."""
    mean, state = chain.mean_loss, chain.stationary * chain.loss
    summed = ticks * mean * (1.0 - mean)
    for apart in range(1, ticks):
        state = state @ chain.transition
        covariance = float(state @ chain.loss) - mean * mean
        summed += 2.0 * (ticks - apart) * covariance
        if abs(covariance) < 1e-15:
            break
    return summed / ticks**2


def _shares(against: Against, what: str, chance: float, hits: Mask, among: Mask) -> Row:
    trials = among.sum(axis=(0, 1))
    return against.shares(what, np.full(len(trials), chance), (hits & among).sum(axis=(0, 1)), trials)


def _of_links(against: Against, what: str, chances: Array, wait: Array, passed: Mask) -> Row:
    """The mean of each link, of delays that are independent."""
    ticks = np.arange(len(chances))
    mean = float(chances @ ticks)
    spread = float(chances @ (ticks - mean) ** 2) ** 0.5
    number, summed = passed.sum(axis=(0, 1)), np.where(passed, wait, 0).sum(axis=(0, 1))
    means = summed / number
    return against.standard(what, (means - mean) / spread * number**0.5, float(means.min()), float(means.max()))
