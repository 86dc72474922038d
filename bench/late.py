"""Accuracy of what happens to messages that pass: delays, copies, overtaking, corruption, limited rate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import flown
import numpy as np
from against import Against, Row
from scipy import stats

from analysis.models.arrays import Array
from netem.core.links import Links
from netem.impairments.corrupt import Mark
from netem.impairments.delay import DelayLaw, MessageDelay
from netem.impairments.rate import Rate
from netem.medium.by_tick import ImpairmentsByTick
from netem.medium.in_flight import Verdicts
from netem.medium.medium import Medium
from netem.medium.verdict import Verdict

_TABLE = np.array([0.004, 0.010, 0.011, 0.015, 0.040, 0.120])
_PARETO_SHAPE = 1.0 + (1.0 + (0.040 / 0.010) ** 2) ** 0.5
_PARETO = stats.pareto(_PARETO_SHAPE, scale=0.040 * (_PARETO_SHAPE - 1.0) / _PARETO_SHAPE)


class Case(NamedTuple):
    """A delay, and its distribution by another hand."""

    parameters: str
    law: DelayLaw
    mean: float
    jitter: float
    correlation: float
    cdf: Callable[[Array], Array]


CASES = (
    Case("30 ms", DelayLaw.CONSTANT, 0.030, 0.0, 0.0, stats.norm(0.030, 1e-12).cdf),
    Case("20 +- 15 ms", DelayLaw.UNIFORM, 0.020, 0.015, 0.0, stats.uniform(0.005, 0.030).cdf),
    Case("10 +- 20 ms, none below 0", DelayLaw.UNIFORM, 0.010, 0.020, 0.0, stats.uniform(-0.010, 0.040).cdf),
    Case("50, 10 ms", DelayLaw.NORMAL, 0.050, 0.010, 0.0, stats.norm(0.050, 0.010).cdf),
    Case("10, 10 ms, none below 0", DelayLaw.NORMAL, 0.010, 0.010, 0.0, stats.norm(0.010, 0.010).cdf),
    Case("50, 10 ms, correlation 0.5", DelayLaw.NORMAL, 0.050, 0.010, 0.5, stats.norm(0.050, 0.010).cdf),
    Case("30 ms", DelayLaw.EXPONENTIAL, 0.030, 0.0, 0.0, stats.expon(0.0, 0.030).cdf),
    Case("30 ms, correlation 0.9", DelayLaw.EXPONENTIAL, 0.030, 0.0, 0.9, stats.expon(0.0, 0.030).cdf),
    Case("40, 10 ms", DelayLaw.PARETO, 0.040, 0.010, 0.0, _PARETO.cdf),
    Case("6 values", DelayLaw.TABLE, 0.0, 0.0, 0.0, lambda s: np.searchsorted(_TABLE, s, side="right") / len(_TABLE)),
)


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """All of it."""
    for number, case in enumerate(CASES):
        yield from _delay(case, verdicts, seed + number)
    yield from _ordered(verdicts, seed + 20)
    yield from _duplicates(verdicts, seed + 21)
    yield from _reorder(verdicts, seed + 22)
    yield from _corruption(verdicts, seed + 23)
    yield from _rate(verdicts, seed + 24)


def _law(links: Links, case: Case, *, ordered: bool = False) -> MessageDelay:
    rows = np.ones(len(links), dtype=bool)
    return MessageDelay(case.law, rows, case.mean, case.jitter, _TABLE, case.correlation, ordered)


def _delay(case: Case, verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    law, against = _law(links, case), Against(f"delay, {case.law}", case.parameters)
    air = flown.medium(seed, links, delays=(law,))
    by_tick = ImpairmentsByTick(seed, links, flown.profile(links, delays=(law,)), np.array([0]), np.array([False]))
    seconds = np.stack([by_tick.at(tick).delay_s[0] for tick in range(ticks)])
    wait = flown.fly(air, ticks).due[:, 0] - np.arange(ticks)[:, None]
    early, late = wait < seconds / flown.DT - 1e-6, wait >= seconds / flown.DT + 1.0
    yield against.exactly("arrive before they are due, or a tick late", 0.0, float((early | late).sum()))
    if case.law is DelayLaw.CONSTANT:
        yield against.exactly("ticks", 3.0, float(wait.mean()))
        return
    yield against.mean("mean, s", law.mean_delay, seconds.mean(axis=0))
    apart = seconds[:: 1 if not case.correlation else int(np.ceil(np.log(1e-4) / np.log(case.correlation)))]
    at_once = float(case.cdf(np.zeros(1))[0])
    if at_once > 0.01:
        yield against.share("share at once", at_once, apart == 0.0)
    if case.law is DelayLaw.TABLE:
        counted = np.array([(apart == value).sum() for value in _TABLE])
        yield against.counts("seconds", np.full(len(_TABLE), 1.0 / len(_TABLE)), counted)
        return
    above = apart[apart > 0.0]
    yield against.distribution("seconds", lambda s: (case.cdf(s) - at_once) / (1.0 - at_once), above)
    if case.correlation:
        score = stats.norm.ppf(case.cdf(seconds))
        yield against.mean("correlation of scores", case.correlation, (score[:-1] * score[1:]).mean(axis=0))


def _ordered(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    law = _law(links, CASES[6], ordered=True)
    due = flown.fly(flown.medium(seed, links, delays=(law,)), ticks).due[:, 0]
    free = flown.fly(flown.medium(seed, links, delays=(_law(links, CASES[6]),)), ticks).due[:, 0]
    against = Against("delay, order kept", CASES[6].parameters)
    waited = np.maximum.accumulate(free, axis=0)
    yield against.exactly("each waits for those before", 1.0, float((due == waited).mean()))


def _duplicates(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    case, against = CASES[6], Against("duplicate", "0.05, delayed 30 ms exponentially")
    chance = np.full(len(links), 0.05)
    air = flown.medium(seed, links, delays=(_law(links, case),), duplicate=chance)
    made = flown.fly(air, ticks)
    copied = made.copy_due >= 0
    yield against.share("share", 0.05, copied)
    tick = np.arange(ticks)[:, None, None]
    wait, first = (made.copy_due - tick)[copied], (made.due - tick)[copied]
    chances: Array = np.diff(case.cdf(np.arange(41.0) * flown.DT))
    yield against.counts("ticks of a copy", chances, np.bincount(np.clip(wait, 1, 41), minlength=42)[1:])
    score_wait, score_first = ((ticks_ - ticks_.mean()) / ticks_.std() for ticks_ in (wait, first))
    yield against.uncorrelated("with the first's ticks", score_wait, score_first)
    yield against.exactly("offered + copies - arrived - under way", 0.0, _balance(air, min(ticks, 200)))


def _balance(air: Medium, ticks: int) -> float:
    state, links = air.begin(), len(air.timeline.links)
    everything, sum_ = np.ones((1, links), dtype=bool), 0
    for tick in range(ticks):
        state, verdicts = air.judge(state, tick, everything, None)
        state, delivery = air.deliver(state, tick, verdicts)
        arrived = int((verdicts.kind == Verdict.DELIVERED).sum()) + delivery.late
        sum_ += links + int((verdicts.copy_due >= 0).sum()) - arrived
    return sum_ - state.in_flight


def _reorder(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    chance = np.full(len(links), 0.25)
    due = flown.fly(flown.medium(seed, links, delays=(_law(links, CASES[0]),), reorder=chance), ticks).due[:, 0]
    wait = due - np.arange(ticks)[:, None]
    against = Against("reorder", "0.25, delayed 30 ms")
    yield against.share("share at once", 0.25, wait == 0)
    yield against.exactly("the others, ticks", 3.0, float(wait[wait > 0].mean()))


def _corruption(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    chances = {Mark.STALE: 0.02, Mark.BIAS: 0.03, Mark.NAN: 0.01, Mark.BIT_FLIP: 0.05}
    table = np.tile(list(chances.values()), (len(links), 1))
    made = flown.fly(flown.medium(seed, links, corrupt=table), ticks)
    mark = made.mark[1:]  # nothing was said before the first tick that could be stale
    against = Against("corruption", "stale 0.02, bias 0.03, NaN 0.01, flip 0.05")
    for kind, chance in chances.items():
        yield against.share(kind.label, chance, mark == kind)
    shares = np.array([1.0 - sum(chances.values()), *chances.values()])
    yield against.counts("kinds", shares[:-1], np.bincount(mark.ravel(), minlength=5))
    yield against.exactly("stale in the first tick", 0.0, float((made.mark[0] == Mark.STALE).sum()))
    yield against.exactly("messages that arrive", 1.0, float((made.kind == Verdict.DELIVERED).mean()))


def _rate(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    bits, size = 512.0, len(links)
    for rate, burst, queue in ((20_000.0, 0.0, 4096.0), (7_300.0, 2048.0, 10_000.0)):
        limit = Rate(np.full(size, rate), np.full(size, burst), np.full(size, queue))
        made = flown.fly(flown.medium(seed, links, rate=limit, message_bits=np.array([bits])), ticks)
        yield from _queue(Against("rate", f"{rate:g} bit/s, burst {burst:g}, queue {queue:g} bit"), made, rate, queue)
        passed = (made.kind != Verdict.OVERFLOW).sum(axis=0) * bits
        whole = rate * (ticks - 1) * flown.DT + burst + queue
        worst = float(passed.ravel()[np.abs(passed - whole).argmax()])
        yield Against("rate", f"saturated by {bits / flown.DT:g} bit/s").within(
            "all that was admitted, bits", whole, worst, bits, "bits"
        )
    spare = Rate(np.full(size, 102_400.0), np.zeros(size), np.full(size, 512.0))
    wait = flown.fly(flown.medium(seed, links, rate=spare), 200).due - np.arange(200)[:, None, None]
    yield Against("rate", "half used").exactly("ticks of a message of 5 ms", 1.0, float(wait.mean()))


def _queue(against: Against, made: Verdicts, rate: float, queue: float) -> Iterator[Row]:
    """A full queue: what comes out, and how long it took."""
    passed, ticks = made.kind[:, 0] != Verdict.OVERFLOW, len(made.kind)
    half = ticks // 2
    through = passed[half:].sum(axis=0) * 512.0 / ((ticks - half) * flown.DT)
    off = 512.0 / ((ticks - half) * flown.DT)
    yield against.within(
        "throughput, bit/s", rate, float(through.ravel()[np.abs(through - rate).argmax()]), off, "bit/s"
    )
    wait = np.where(passed, made.due[:, 0] - np.arange(ticks)[:, None], 0)
    most = np.ceil(queue / rate / flown.DT)
    yield against.within("longest wait, ticks", most, float(wait[half:].max()), 512.0 / rate / flown.DT, "ticks")
    yield against.exactly("waits longer than the queue", 0.0, float((wait > most).sum()))
