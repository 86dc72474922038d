"""Accuracy of impairments together on one link: by the theory of independent layers, or computed again by another hand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import arriving
import flown
import numpy as np
import queued
from against import Against, Row
from lossy import burst_rows
from scipy import stats

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.impairments.chain import Chain, all_together
from netem.impairments.corrupt import Mark
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.loss import bernoulli, gilbert_elliott
from netem.impairments.rate import Rate
from netem.impairments.rate_over_time import RateOverTime
from netem.impairments.trace import DelayTrace, Measured, Trace
from netem.medium.in_flight import Verdicts
from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

_BURSTS = gilbert_elliott(0.02, 0.25)
_UNIT = 128.0  # bits; of whole numbers of them a queue can be computed without rounding
_SIZE, _ROOM, _DRAINED = 5, 20, 4  # units of a message, of a queue, and those that pass in a tick
_WARM = 200  # ticks, after which nothing tells any more that a run began without messages under way
_FEWEST = 50_000
_SURVIVING = 400  # ticks, of which no message of these delays is older


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """All of it, of no fewer verdicts than leave some after `_WARM`."""
    verdicts = max(verdicts, _FEWEST)
    yield from _losses(verdicts, seed)
    yield from _losses_and_a_trace(verdicts, seed + 1)
    yield from _queue_behind_bursts(verdicts, seed + 2)
    yield from _delay_behind_losses(verdicts, seed + 3)
    yield from _age(verdicts, seed + 4)
    yield from _copies_of_the_corrupted(verdicts, seed + 5)
    yield from _delay_over_time(verdicts, seed + 6)
    yield from _rate_over_time(verdicts, seed + 7)


def _losses(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    for name, chains in (
        ("0.5; 0.3", (bernoulli(0.5), bernoulli(0.3))),
        ("Gilbert 0.02, 0.25; Gilbert 0.05, 0.5", (_BURSTS, gilbert_elliott(0.05, 0.5))),
    ):
        chain, against = all_together(chains), Against("two losses", name)
        air = flown.medium(seed, links, chains=flown.layers(links, *chains))
        lost = flown.fly(air, ticks).kind[:, 0] == Verdict.LOST
        yield against.mean("mean loss", chain.mean_loss, lost.mean(axis=0))
        yield from burst_rows(against, chain, lost)
        alone = np.zeros_like(lost)
        for layer in flown.layers(links, *chains):
            alone |= flown.fly(flown.medium(seed, links, chains=(layer,)), ticks).kind[:, 0] == Verdict.LOST
        yield against.exactly("lost by either alone, and no other", 0.0, float((lost != alone).sum()))


def _losses_and_a_trace(verdicts: int, seed: int) -> Iterator[Row]:
    """Each third of the time has its own availability, on top of two chains."""
    links, ticks = flown.size(verdicts)
    thirds, passing = np.arange(3) * (ticks // 3), np.array([1.0, 0.6, 0.9])
    trace = Trace(thirds, np.repeat(passing[:, None], len(links), axis=1), True, True)
    chain = all_together((bernoulli(0.05), _BURSTS))
    air = flown.medium(seed, links, chains=flown.layers(links, bernoulli(0.05), _BURSTS), traces=(trace,))
    lost = flown.fly(air, ticks).kind[:, 0] == Verdict.LOST
    against = Against("losses and a trace", "0.05; Gilbert 0.02, 0.25; 1, 0.6, 0.9 in turn")
    for part, share in zip(np.split(lost, thirds[1:]), passing, strict=True):
        due = 1.0 - (1.0 - chain.mean_loss) * float(share)
        yield against.mean(f"mean loss while the trace says {share:g}", due, part.mean(axis=0))


def _queue_behind_bursts(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    chain, size = gilbert_elliott(1.0 / 6.0, 0.25), len(links)
    limit = Rate(np.full(size, _DRAINED * _UNIT / flown.DT), np.zeros(size), np.full(size, _ROOM * _UNIT))
    chains = flown.layers(links, chain)
    made = flown.fly(flown.medium(seed, links, chains=chains, rate=limit, message_bits=_bits()), ticks)
    against = Against("queue behind bursts", "Gilbert 1/6, 1/4; 1.25 ticks a message, 4 wait")
    yield _as_without(against, made, _lost(seed, links, chain, ticks))
    yield from queued.rows(against, made, np.full(2 * ticks, _DRAINED), [_SIZE], _ROOM)
    full, waits = _in_the_long_run(chain)
    overflow, wait = (made.kind[_WARM:, 0] == Verdict.OVERFLOW), made.due[_WARM:, 0] - np.arange(_WARM, ticks)[:, None]
    yield against.mean("share that overflows", full, overflow.mean(axis=0))
    passed = np.isin(made.kind[_WARM:, 0], (Verdict.DELIVERED, Verdict.DELAYED))
    mean = float(waits @ np.arange(len(waits)))
    yield against.ratio("mean wait, ticks", mean, np.where(passed, wait, 0).sum(axis=0), passed.sum(axis=0))
    counted = np.stack([((wait == n) & passed).sum(axis=0) for n in range(len(waits))], axis=-1)
    yield against.counts_by_link("waits, ticks", waits[waits > 0.0], counted[:, waits > 0.0].astype(np.float64))


def _bits() -> Array:
    return np.full(len(flown.ONE), _SIZE * _UNIT)


def _lost(seed: int, links: Links, chain: Chain, ticks: int) -> Mask:
    """What a chain loses where there is nothing beside it."""
    return flown.fly(flown.medium(seed, links, chains=flown.layers(links, chain)), ticks).kind[:, 0] == Verdict.LOST


def _as_without(against: Against, made: Verdicts, lost: Mask) -> Row:
    other = (made.kind[:, 0] == Verdict.LOST) != lost
    return against.exactly("lost other than without the queue", 0.0, float(other.sum()))


def _in_the_long_run(chain: Chain) -> tuple[float, Array]:
    """Of a queue behind a chain: the share of all messages that overflow, and how likely those that pass wait 0, 1, ... ticks.

    State of the chain and units that wait make one Markov chain, which begins a tick by draining.
    """
    states, depth = len(chain.loss), _ROOM + 1
    begun = np.zeros((states, depth, states, depth))
    left = np.maximum(np.arange(depth) - _DRAINED, 0)
    fits = left + _SIZE <= _ROOM
    for state in range(states):
        for before in range(depth):
            after = left[before] + _SIZE if fits[before] else left[before]
            begun[state, before, :, after] += (1.0 - chain.loss[state]) * chain.transition[state]
            begun[state, before, :, left[before]] += chain.loss[state] * chain.transition[state]
    step = begun.reshape(states * depth, -1)
    balance = np.vstack([step.T - np.eye(len(step)), np.ones(len(step))])
    share = np.linalg.lstsq(balance, np.append(np.zeros(len(step)), 1.0), rcond=None)[0].reshape(states, depth)
    coming = (share * (1.0 - chain.loss)[:, None]).sum(axis=0)
    waits = np.bincount(-(-(left[fits] + _SIZE) // _DRAINED), coming[fits])
    return float(coming[~fits].sum()), waits / waits.sum()


def _exponential(links: Links) -> MessageDelay:
    return MessageDelay(DelayLaw.EXPONENTIAL, np.ones(len(links), dtype=bool), 0.03, 0.0, np.empty(0), 0.0, False)


def _delay_behind_losses(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    air = flown.medium(seed, links, chains=flown.layers(links, _BURSTS), delays=(_exponential(links),))
    made = flown.fly(air, ticks)
    lost, wait = made.kind[:, 0] == Verdict.LOST, made.due[:, 0] - np.arange(ticks)[:, None]
    against = Against("delay behind losses", "Gilbert 0.02, 0.25; 30 ms exponentially")
    yield against.mean("mean loss", _BURSTS.mean_loss, lost.mean(axis=0))
    yield from burst_rows(against, _BURSTS, lost)
    whole = stats.expon(0.0, 0.03).cdf(np.arange(41.0) * flown.DT)
    yield against.counts(
        "ticks of those that pass", np.diff(whole), np.bincount(wait[~lost].clip(1, 41), minlength=42)[1:]
    )
    after = lost[:-1] & ~lost[1:]
    yield against.counts(
        "ticks of the first after a burst", np.diff(whole), np.bincount(wait[1:][after].clip(1, 41), minlength=42)[1:]
    )


def _age(verdicts: int, seed: int) -> Iterator[Row]:
    """Older than a are those of whom none of the last a + 1 has arrived: each is lost, or still under way."""
    links, ticks = flown.size(verdicts)
    waits = stats.expon(0.0, 0.03).sf(np.arange(float(_SURVIVING)) * flown.DT)
    for loss in (0.0, 0.2):
        older = np.cumprod(loss + (1.0 - loss) * waits)
        air = flown.medium(seed, links, chains=flown.layers(links, bernoulli(loss)), delays=(_exponential(links),))
        newest, _ = _arrivals(air, ticks)
        age = np.arange(ticks)[:, None] - np.maximum.accumulate(newest, axis=0)
        against = Against("delay behind losses", f"{loss:g}; 30 ms exponentially")
        yield against.mean("mean age of the newest, ticks", float(older.sum()), age[_WARM:].mean(axis=0))
        yield against.mean("share older than 5 ticks", float(older[5]), (age[_WARM:] > 5).mean(axis=0))


def _arrivals(air: Medium, ticks: int) -> tuple[Integers, Integers]:
    """Of every tick, the newest that arrives, -1 for none, shape (T, L); and all that does, as `arriving.expected` has it."""
    state, everything, newest, rows = air.begin(), np.ones((1, len(air.timeline.links)), dtype=bool), [], []
    for tick in range(ticks):
        state, verdicts = air.judge(state, tick, everything, None)
        state, delivery = air.deliver(state, tick, verdicts)
        newest.append(delivery.newest[0])
        channel, link = np.nonzero(delivery.plain)
        plain = np.stack([np.full_like(link, tick), channel, link, np.zeros_like(link)], axis=-1)
        odd = delivery.apart[:, [0, 2, 1, 3]]
        arrived = np.concatenate([plain, odd])
        rows.append(np.column_stack([np.full(len(arrived), tick), arrived]))
    return np.stack(newest), np.concatenate(rows)


def _copies_of_the_corrupted(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    size = len(links)
    chances = {Mark.STALE: 0.05, Mark.BIAS: 0.1, Mark.BIT_FLIP: 0.02}
    table = np.tile([chances.get(mark, 0.0) for mark in (Mark.STALE, Mark.BIAS, Mark.NAN, Mark.BIT_FLIP)], (size, 1))
    on: dict[str, Any] = {"corrupt": table, "duplicate": np.full(size, 0.2), "delays": (_exponential(links),)}
    made = flown.fly(flown.medium(seed, links, **on), ticks)
    _, rows = _arrivals(flown.medium(seed, links, **on), ticks)
    against = Against("copies of the corrupted", "0.2 twice; stale 0.05, bias 0.1, flip 0.02; 30 ms exponentially")
    yield against.exactly(
        "arrivals other than the verdicts say", 0.0, float(arriving.apart(rows, arriving.expected(made)))
    )
    copied, mark = made.copy_due[1:, 0] >= 0, made.mark[1:, 0]
    yield against.share("copies", 0.2, copied)
    for kind, chance in chances.items():
        yield against.share(f"{kind.label} among the doubled", chance, mark[copied] == kind)
    rows = rows[rows[:, 1] >= 1]
    arrived = np.bincount(rows[:, 3], minlength=size).astype(np.float64)
    for kind, chance in chances.items():
        struck = np.bincount(rows[rows[:, 4] == kind, 3], minlength=size).astype(np.float64)
        yield against.ratio(f"{kind.label} among all that arrives", chance / 1.2, struck, arrived)


def _delay_over_time(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    rng, changes = np.random.default_rng(seed), 10
    when = np.arange(changes) * (ticks // changes)
    due = rng.integers(0, 8, size=(changes, len(links))).astype(np.float64) * 0.005 + 0.0025
    rows = np.tile(np.arange(len(links)), changes)
    measured = Measured(np.repeat(when * flown.DT, len(links)), rows, due.ravel())
    trace = DelayTrace(*measured.over(len(links), flown.DT, ticks))
    held = np.repeat(due, np.diff(np.append(when, ticks)), axis=0)
    on: dict[str, Any] = {"chains": flown.layers(links, bernoulli(0.2)), "delay_traces": (trace,)}
    constant = MessageDelay(DelayLaw.CONSTANT, np.ones(len(links), dtype=bool), 0.02, 0.0, np.empty(0), 0.0, False)
    made = flown.fly(flown.medium(seed, links, delays=(constant,), **on), ticks)
    against = Against("delay over time", f"{changes} changes on each of {len(links)} links; 20 ms; 0.2 lost")
    passed, wait = made.kind[:, 0] != Verdict.LOST, made.due[:, 0] - np.arange(ticks)[:, None]
    asked = np.ceil((held + 0.02) / flown.DT - 1e-6)
    yield against.exactly("ticks other than the file says", 0.0, float((wait != asked)[passed].sum()))
    yield against.share("loss", 0.2, ~passed)
    made = flown.fly(flown.medium(seed, links, delays=(_exponential(links),), **on), ticks)
    passed, wait = made.kind[:, 0] != Verdict.LOST, made.due[:, 0] - np.arange(ticks)[:, None]
    against = Against("delay over time", f"{changes} changes on each of {len(links)} links; 30 ms exponentially")
    late = _ticks_beyond(held)
    yield against.ratio(
        "mean ticks beyond the file's", 0.0, np.where(passed, wait - late, 0.0).sum(axis=0), passed.sum(axis=0)
    )


def _ticks_beyond(held: Array) -> Array:
    """Mean ticks of a delay that is constant and, on top of it, exponential of 30 ms: those that it is longer than."""
    longer = np.arange(_SURVIVING) * flown.DT
    survive: Array = stats.expon(0.0, 0.03).sf(longer[:, None] - np.unique(held)).sum(axis=0)
    return survive[np.searchsorted(np.unique(held), held)]


def _rate_over_time(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    size, turns = len(links), np.array([_DRAINED, 2, 0, 8])
    when = np.arange(len(turns)) * (ticks // len(turns))
    measured = Measured(
        np.repeat(when * flown.DT, size),
        np.tile(np.arange(size), len(turns)),
        np.repeat(turns * _UNIT / flown.DT, size),
    )
    changes, rate = measured.over(size, flown.DT, ticks)
    limit = RateOverTime(flown.DT, changes, rate, np.zeros(size), np.full(size, _ROOM * _UNIT))
    chains = flown.layers(links, _BURSTS)
    made = flown.fly(flown.medium(seed, links, chains=chains, rate_trace=limit, message_bits=_bits()), ticks)
    drained = np.append(np.repeat(turns, np.diff(np.append(when, ticks))), np.full(ticks, turns[-1]))
    against = Against("rate over time", "51200, 25600, 0, 102400 bit/s in turn behind Gilbert 0.02, 0.25")
    yield _as_without(against, made, _lost(seed, links, _BURSTS, ticks))
    yield from queued.rows(against, made, drained, [_SIZE], _ROOM)
