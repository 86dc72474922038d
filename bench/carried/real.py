"""Accuracy in real time: losses exact by verdict, delays by the clocks of those who hear, beside a process that only sleeps."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from against import SIGMAS, Against, Row
from carried import journals, sleeper, swarm
from carried.asked import Asked
from carried.swarm import Flown
from scipy import stats

from affinet.planning.plan import Plan
from analysis.models.arrays import Array
from netem.core.arrow import places
from netem.impairments.loss import gilbert_elliott
from netem.medium import deliveries
from netem.medium.medium import JOURNAL, Medium
from netem.medium.verdict import Verdict

DT = 0.05
CASE = Asked(
    "Gilbert 1/16, 1/4; 100 +- 100 ms",
    """
loss = [{ model = "gilbert-elliott", p = 0.0625, r = 0.25 }]
delay = { model = "uniform", mean = 0.1, jitter = 0.1 }
""",
    gilbert_elliott(0.0625, 0.25),
    stats.uniform(0.0, 0.2).cdf,
)
_ROUNDED = 1e-6  # s, of times kept in 32 bits, and of clocks
_STEEPER = 0.005  # share by which taken may be steeper than asked
_SLEEPS = 0.01  # s


class Delays(NamedTuple):
    """Delays of messages that were heard, in seconds, shape (m,): what the air asked, and what an agent found."""

    asked_s: Array
    taken_s: Array


class Machine(NamedTuple):
    """How late everything was that has nothing to do with delays, in ms: p99 of a sleeper and of ticks that begin; the load."""

    asleep_ms: float
    begun_ms: float
    load: str


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """A flight, longer where more verdicts are wanted; it takes as long as it flies."""
    clock = (f"time.dt={DT}", f"time.duration={min(60, max(10, verdicts // 15_000))}")
    with sleeper.sleeping(_SLEEPS) as woken:
        real = swarm.over_processes(CASE.text, seed, (*clock, 'time.mode="real"', "time.real.late=60"))
        load = os.getloadavg()[0]
    journal, delivered, noted = (
        Against("in real time", CASE.parameters, file) for file in (JOURNAL, deliveries.FILE, "noted by agents")
    )
    yield from verdict_rows(journal, real, swarm.in_process(CASE.text, seed, clock))
    yield from asked_rows(delivered, *matched(real))
    assert real.outcome.timing is not None
    asleep, begun = 1e3 * float(np.quantile(woken, 0.99)), real.outcome.timing.lateness["world"].p99_ms
    machine = Machine(asleep, begun, f"load {load:.1f} of {os.cpu_count()}")
    yield from delay_rows(noted, heard(real), machine)


def verdict_rows(against: Against, real: Flown, lockstep: Flown) -> Iterator[Row]:
    """What is lost is what lockstep loses, but for what nobody said in time."""
    world, channels = real.plan.world, real.plan.channels
    ours, theirs = (journals.verdicts(run.journal, world.links, channels, world.ticks).kind for run in (real, lockstep))
    said = ours != Verdict.UNSAID
    other = (ours == Verdict.LOST) != (theirs == Verdict.LOST)
    yield against.exactly("lost other than in lockstep", 0.0, float((other & said).sum()))
    yield against.exactly(
        "lost, of those said", float((theirs == Verdict.LOST)[said].sum()), float((ours == Verdict.LOST).sum())
    )
    yield against.told("unsaid, as agents were late", f"{(~said).sum()} of {said.size}")


def matched(real: Flown) -> tuple[Array, Array]:
    """Of each message delivered, the delay that the run booked as asked, and that which the profile has for it, in seconds."""
    table, plan = real.deliveries, real.plan
    ends = np.stack([table[name].to_numpy() for name in ("src", "dst")], axis=-1)
    row, channel = journals.rows_of(plan.world.links, ends), places(table["channel"], plan.channels)
    return table["asked_s"].to_numpy(), waits(plan)[table["content"].to_numpy(), channel, row]


def waits(plan: Plan) -> Array:
    """What the profile of a plan has each message wait, in seconds, shape (T, C, L)."""
    air = Medium(plan.world.seed, plan.channels, plan.profiles, plan.timeline)
    state, seconds = air.begin(), []
    for tick in range(plan.world.ticks):
        state, verdicts = air.judge(state, tick, air.offered(tick, None), None)
        assert state.waits is not None
        seconds.append(np.broadcast_to(state.waits.seconds, verdicts.kind.shape))
    return np.stack(seconds)


def asked_rows(against: Against, asked_s: Array, due_s: Array) -> Iterator[Row]:
    """The delay that each message was given."""
    off = np.abs(asked_s - due_s) > _ROUNDED
    yield against.exactly("asked other than the profile draws", 0.0, float(off.sum()))
    assert CASE.delay is not None
    yield against.distribution("asked, s", CASE.delay, asked_s.astype(np.float64))


def heard(real: Flown) -> Delays:
    """The delays of messages as those who heard them found them."""
    table, plan, noted = real.deliveries, real.plan, real.noted
    assert noted is not None
    ends = np.stack([table[name].to_numpy() for name in ("src", "dst")], axis=-1)
    asked = np.full((plan.world.ticks, len(plan.channels), len(plan.world.links)), np.nan)
    row, channel = journals.rows_of(plan.world.links, ends), places(table["channel"], plan.channels)
    asked[table["content"].to_numpy(), channel, row] = table["asked_s"].to_numpy()
    exchanged = ~np.isnan(noted.took_s)
    _, content, channel, link, _ = noted.arrived[exchanged].T
    return Delays(asked[content, channel, link], noted.took_s[exchanged])


def delay_rows(against: Against, delays: Delays, machine: Machine) -> Iterator[Row]:
    """How long messages took: never less than asked, in proportion to it, and later by less than half a tick.

    The slope is wrong where its whole interval is; it is wide where the machine was late. Half a tick is beyond what sleeping
    and beginning a tick were late by themselves.
    """
    known = ~np.isnan(delays.asked_s)
    yield against.exactly("heard and not delivered", 0.0, float((~known).sum()))
    delays = Delays(*(field[known] for field in delays))
    late_ms = 1e3 * (delays.taken_s - delays.asked_s)
    yield against.exactly("heard before they were due", 0.0, float((late_ms < -1e3 * _ROUNDED).sum()))
    slope, spread = _slope(delays)
    off = abs(slope - 1.0) - SIGMAS * spread > _STEEPER
    interval = f"{slope - SIGMAS * spread:.4f} to {slope + SIGMAS * spread:.4f}"
    yield against.judged("taken by asked", "1", f"{slope:.4f}", interval, machine.load, not off)
    low, middle, interval = _quantile(late_ms, 0.5)
    beside = f"ticks {machine.begun_ms:.2g}, a sleeper {machine.asleep_ms:.2g} ms late"
    ok = low < 500.0 * DT + max(machine.begun_ms, machine.asleep_ms)
    yield against.judged("later than asked, p50, ms", "0", middle, interval, beside, ok)
    _, high, interval = _quantile(late_ms, 0.99)
    yield against.told("later than asked, p99, ms", high, interval)


def _slope(delays: Delays) -> tuple[float, float]:
    """How much longer a message takes for each second asked, and its standard error whatever else makes it late (White)."""
    x = delays.asked_s - delays.asked_s.mean()
    slope = float((x * delays.taken_s).sum() / (x * x).sum())
    rest = delays.taken_s - delays.taken_s.mean() - slope * x
    return slope, float(((x * rest) ** 2).sum() ** 0.5 / (x * x).sum())


def _quantile(values: Array, share: float) -> tuple[float, str, str]:
    """The lower end of the interval of a quantile, whatever the distribution; the quantile and all of the interval in words."""
    outside = float(stats.norm.sf(SIGMAS))
    ends = stats.binom(len(values), share).ppf([outside, 1.0 - outside]) / len(values)
    low, middle, high = np.quantile(values, np.clip([ends[0], share, ends[1]], 0.0, 1.0))
    return float(low), f"{middle:.3g}", f"{low:.3g} to {high:.3g}"
