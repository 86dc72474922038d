"""Accuracy of independence: of ticks, channels, links, and of what the air does to one message."""

from __future__ import annotations

from collections.abc import Iterator

import flown
import numpy as np
from against import Against, Row

from analysis.models.arrays import Array
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.loss import bernoulli, gilbert_elliott
from netem.medium.verdict import Verdict

_CHANNELS = ("sense", "input", "theta")


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """All of it."""
    yield from _ticks_and_channels(verdicts, seed)
    yield from _links(verdicts, seed + 1)
    yield from _layers(verdicts, seed + 2)
    yield from _coupled(verdicts, seed + 3)


def _ticks_and_channels(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    p, against = 0.2, Against("independence", "Bernoulli 0.2, channels apart")
    air = flown.medium(seed, links, _CHANNELS, coupled=False, chains=flown.layers(links, bernoulli(p)))
    x = _score(flown.fly(air, ticks).kind == Verdict.LOST, p)
    for lag in range(1, 6):
        yield against.uncorrelated(f"of ticks {lag} apart", x[:-lag], x[lag:])
    for first, second in ((0, 1), (0, 2), (1, 2)):
        yield against.uncorrelated(f"of {_CHANNELS[first]} and {_CHANNELS[second]}", x[:, first], x[:, second])
    yield against.uncorrelated("of the two directions", x[..., ::2], x[..., 1::2])
    yield against.uncorrelated("of a channel and the next tick's next", x[:-1, :-1], x[1:, 1:])
    again = flown.medium(seed + 100, links, _CHANNELS, coupled=False, chains=flown.layers(links, bernoulli(p)))
    yield against.uncorrelated("of two seeds", x, _score(flown.fly(again, ticks).kind == Verdict.LOST, p))


def _links(verdicts: int, seed: int) -> Iterator[Row]:
    """Every pair of links; of 0.5 the correlation is as near to normal as can be."""
    ticks, links = max(1000, verdicts // 1200), flown.ring(100, 6)
    air = flown.medium(seed, links, chains=flown.layers(links, bernoulli(0.5)))
    x = _score(flown.fly(air, ticks).kind[:, 0] == Verdict.LOST, 0.5)
    z = (x.T @ x)[np.triu_indices(len(links), 1)] / ticks**0.5
    against = Against("independence", "Bernoulli 0.5, 1,200 links of 100 agents")
    yield against.no_pair("of every two links", z)
    yield against.mean("mean square of those z", 1.0, z**2)
    lagged = (x[:-1].T @ x[1:]).ravel() / (ticks - 1) ** 0.5
    yield against.no_pair("of every two, one tick apart", lagged)
    bursty = flown.layers(links, gilbert_elliott(0.02, 0.25))
    x = _score(flown.fly(flown.medium(seed, links, chains=bursty), ticks).kind[:, 0] == Verdict.LOST, 0.02 / 0.27)
    against = Against("independence", "Gilbert 0.02, 0.25, 1,200 links of 100 agents")
    yield against.mean("of links to one agent", 0.0, (x[:, ::2] * x[:, 1::2]).mean(axis=0))


def _layers(verdicts: int, seed: int) -> Iterator[Row]:
    """What befalls one message: if a loss chose its messages by anything else, the others would not be as they all are."""
    links, ticks = flown.size(2 * verdicts)
    law = MessageDelay(DelayLaw.UNIFORM, np.ones(len(links), dtype=bool), 0.105, 0.1, np.empty(0), 0.0, False)
    chances, corrupt = np.full(len(links), 0.3), np.tile([0.0, 0.1, 0.0, 0.2], (len(links), 1))
    chain = flown.layers(links, bernoulli(0.5))
    made = flown.fly(flown.medium(seed, links, delays=(law,), duplicate=chances, corrupt=corrupt, chains=chain), ticks)
    passed, wait = made.kind != Verdict.LOST, made.due - np.arange(ticks)[:, None, None]
    copied, struck, wait = made.copy_due[passed] >= 0, made.mark[passed] > 0, wait[passed]
    against = Against("independence", "what befalls one message")
    yield against.share("copies among those not lost", 0.3, copied)
    yield against.share("corrupted among those not lost", 0.3, struck)
    slow = wait > 10  # of 1 to 21 ticks, evenly over 0.5 to 20.5
    yield against.share("slow among those not lost", 0.525, slow)
    events = {"copy": _score(copied, 0.3), "corruption": _score(struck, 0.3), "delay": _score(slow, 0.525)}
    for first, second in (("copy", "corruption"), ("copy", "delay"), ("corruption", "delay")):
        yield against.uncorrelated(f"of {first} and {second}", events[first], events[second])


def _coupled(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    air = flown.medium(seed, links, _CHANNELS, chains=flown.layers(links, gilbert_elliott(0.02, 0.25)))
    kind = flown.fly(air, ticks).kind
    against = Against("Assumption 1", "coupled, 3 channels")
    yield against.exactly("channels of one verdict", 1.0, float((kind == kind[:, :1]).all(axis=1).mean()))


def _score(events: Array, p: float) -> Array:
    return (events - p) / (p * (1.0 - p)) ** 0.5
