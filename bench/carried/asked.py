"""Rows on what a journal says of every message against what was asked of the air, in all and link by link."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import queued
from against import Against, Row
from lossy import burst_rows

from analysis.models.arrays import Array, Mask
from netem.impairments.chain import Chain
from netem.impairments.corrupt import Mark
from netem.medium.in_flight import Verdicts
from netem.medium.verdict import Verdict

_LONGEST = 60  # ticks of a delay that are told apart
_NONE = 1e-12  # of correlations


class Queue(NamedTuple):
    """Bytes that pass in a tick, that may wait, and of a message on each channel of communication."""

    drained: int
    room: int
    sizes: Sequence[int]


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
    queue
        Without delays; None without one.
    """

    parameters: str
    text: str
    chain: Chain
    delay: Callable[[Array], Array] | None = None
    duplicate: float = 0.0
    corrupt: Mapping[Mark, float] = {}
    queue: Queue | None = None


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
        yield from _delays_apart(against, chances, wait, passed)
    if asked.queue is not None:
        drained, said = (
            np.full(2 * len(lost), asked.queue.drained),
            Verdicts(made.kind[:, 1:], made.due[:, 1:], made.mark[:, 1:], made.copy_due[:, 1:]),
        )
        yield from queued.rows(against, said, drained, asked.queue.sizes, asked.queue.room)
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
    yield from _losses_apart(against, chain, apart)


def mean_variance(chain: Chain, ticks: int) -> float:
    """Variance of the share that a chain loses of so many messages in a row, in closed form."""
    mean, alike = chain.mean_loss, correlations(chain, ticks)
    return mean * (1.0 - mean) * (1.0 + 2.0 * float((1.0 - np.arange(1, len(alike) + 1) / ticks) @ alike)) / ticks


def correlations(chain: Chain, ticks: int) -> Array:
    """Of the losses of messages 1, 2, ... apart, as far as there is any within so many ticks."""
    mean, state, alike = chain.mean_loss, chain.stationary * chain.loss, []
    for _ in range(1, ticks):
        state = state @ chain.transition
        alike.append((float(state @ chain.loss) - mean * mean) / (mean * (1.0 - mean)))
        if abs(alike[-1]) < _NONE:
            break
    return np.array(alike)


def _losses_apart(against: Against, chain: Chain, lost: Mask) -> Iterator[Row]:
    """Of every two series (T, S) that have nothing to do with each other: none alike, nor all a little."""
    ticks, series = lost.shape
    mean = chain.mean_loss
    score = (lost - mean) / (mean * (1.0 - mean)) ** 0.5
    spread = ((1.0 + 2.0 * float((correlations(chain, ticks) ** 2).sum())) / ticks) ** 0.5
    alike = (score.T @ score / ticks)[np.triu_indices(series, 1)]
    yield against.no_pair("losses of every two links and channels", alike / spread)
    yield against.normal("their correlation in the mean", 0.0, float(alike.mean()), spread / len(alike) ** 0.5)


def _delays_apart(against: Against, chances: Array, wait: Array, passed: Mask) -> Iterator[Row]:
    """Of a message and the next of its link, and that of the next link."""
    mean, spread = _moments(chances)
    score, among = (wait - mean) / spread, passed[:-1] & passed[1:]
    yield against.uncorrelated("delays of a message and the next", score[:-1][among], score[1:][among])
    beside, among = np.roll(score, 1, axis=-1), passed & np.roll(passed, 1, axis=-1)
    yield against.uncorrelated("delays of a link and the next", score[among], beside[among])


def _shares(against: Against, what: str, chance: float, hits: Mask, among: Mask) -> Row:
    trials = among.sum(axis=(0, 1))
    return against.shares(what, np.full(len(trials), chance), (hits & among).sum(axis=(0, 1)), trials)


def _of_links(against: Against, what: str, chances: Array, wait: Array, passed: Mask) -> Row:
    """The mean of each link, of delays that are independent."""
    mean, spread = _moments(chances)
    number, summed = passed.sum(axis=(0, 1)), np.where(passed, wait, 0).sum(axis=(0, 1))
    means = summed / number
    return against.standard(what, (means - mean) / spread * number**0.5, float(means.min()), float(means.max()))


def _moments(chances: Array) -> tuple[float, float]:
    """Mean and standard deviation of a number that is 0, 1, ... with these chances."""
    number = np.arange(len(chances))
    mean = float(chances @ number)
    return mean, float(chances @ (number - mean) ** 2) ** 0.5
