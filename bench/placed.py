"""Accuracy of what place, the clock, a list or a file decides: reach, zones, schedules, listed messages, traces."""

from __future__ import annotations

from collections.abc import Iterator

import flown
import numpy as np
from against import Against, Row
from scipy.special import ndtr

from analysis.models.arrays import Array, Integers, Mask
from netem.core.links import Links
from netem.impairments import schedule, trace
from netem.impairments.jamming import Zone
from netem.impairments.reach import Reach, ReachLaw
from netem.impairments.schedule import Schedule
from netem.impairments.trace import Trace
from netem.medium.verdict import Verdict


def check(verdicts: int, seed: int) -> Iterator[Row]:
    """All of it."""
    yield from _ramp(verdicts, seed)
    yield from _disk(verdicts, seed + 1)
    for number, coherence in enumerate((1, 5)):
        yield from _log_distance(verdicts, seed + 2 + number, coherence)
    yield from _zones(verdicts, seed + 4)
    yield from _schedules(verdicts, seed + 5)
    yield from _listed(verdicts, seed + 6)
    yield from _trace(verdicts, seed + 7)


def _apart(links: Links, distances: Array) -> tuple[Array, Array]:
    """Positions that set the distance of each pair, in turn, and the distance of every link."""
    position = np.zeros((links.agents, 2))
    position[1::2, 1] = np.resize(distances, links.agents // 2)
    position += np.repeat(np.arange(links.agents // 2) * 1e3, 2)[:, None] * [1.0, 0.0]
    return position, np.repeat(np.resize(distances, links.agents // 2), 2)


def _reach(
    links: Links, law: ReachLaw, inner: float, outer: float, shadowing: float = 0.0, coherence: int = 1
) -> Reach:
    return Reach(law, np.ones(len(links), dtype=bool), inner, outer, 3.0, shadowing, coherence, True, True)


def _passing(
    verdicts: int,
    seed: int,
    distances: Array,
    law: ReachLaw,
    inner: float,
    outer: float,
    shadowing: float = 0.0,
    coherence: int = 1,
) -> tuple[Mask, Array]:
    links, ticks = flown.size(verdicts)
    position, length = _apart(links, distances)
    reach = _reach(links, law, inner, outer, shadowing, coherence)
    return flown.fly(
        flown.medium(seed, links, reaches=(reach,)), ticks, position=position
    ).kind != Verdict.RANGE, length


def _ramp(verdicts: int, seed: int) -> Iterator[Row]:
    distances, against = np.array([9.9, 11.0, 15.0, 18.0, 19.5, 20.0]), Against("ramp", "10 to 20 m")
    passing, length = _passing(verdicts, seed, distances, ReachLaw.RAMP, inner=10.0, outer=20.0)
    for distance in distances:
        here, due = passing[..., length == distance], float(np.clip((20.0 - distance) / 10.0, 0.0, 1.0))
        if 0.0 < due < 1.0:
            yield against.share(f"availability at {distance:g} m", due, here)
        else:
            yield against.exactly(f"availability at {distance:g} m", due, float(here.mean()))


def _disk(verdicts: int, seed: int) -> Iterator[Row]:
    distances = np.array([1.0, 20.0, 20.001, 50.0])
    passing, length = _passing(verdicts, seed, distances, ReachLaw.RAMP, inner=20.0, outer=20.0)
    as_due = passing == (length <= 20.0)
    yield Against("disk", "20 m").exactly("verdicts as the distance says", 1.0, float(as_due.mean()))


def _log_distance(verdicts: int, seed: int, coherence: int) -> Iterator[Row]:
    """Shadows are shared by both directions and by the ticks of a spell, so that one spell of a pair is one event."""
    distances = np.array([10.0, 16.0, 20.0, 25.0, 35.0])
    against = Against("log-distance", f"20 m, exponent 3, 4 dB, {coherence} ticks")
    passing, length = _passing(
        2 * coherence * verdicts, seed, distances, ReachLaw.LOG_DISTANCE, 0.0, 20.0, shadowing=4.0, coherence=coherence
    )
    passing = passing[: len(passing) // coherence * coherence, 0]
    by_pair = passing.reshape(-1, coherence, passing.shape[-1] // 2, 2).swapaxes(1, 2)
    spells = by_pair.reshape(*by_pair.shape[:2], -1)
    yield against.exactly(
        "one verdict in a spell of a pair", 1.0, float((spells == spells[..., :1]).all(axis=-1).mean())
    )
    for distance in distances:
        due = float(ndtr(10.0 * 3.0 * np.log10(20.0 / distance) / 4.0))
        yield against.share(f"availability at {distance:g} m", due, spells[:, length[::2] == distance, 0])


def _zones(verdicts: int, seed: int) -> Iterator[Row]:
    """Few links and many ticks: a zone has one verdict a tick."""
    links, against = flown.pairs(100), Against("jammed zone", "share 0.3, and one of 0.5 beside it")
    ticks = -(-verdicts // len(links))
    x = np.resize([0.0, 3.0, 0.0, 9.0, 20.0, 20.0, 50.0, 50.0], links.agents)
    position, heard = np.stack([x, np.zeros(len(x))], axis=-1), x[links.dst - 1]
    zones = tuple(
        Zone(np.array([centre, 0.0]), 5.0, share, np.ones(len(links), dtype=bool), True, True)
        for centre, share in ((0.0, 0.3), (20.0, 0.5))
    )
    kind = flown.fly(flown.medium(seed, links, ("sense", "theta"), zones=zones), ticks, position=position).kind
    jammed = kind == Verdict.JAMMED
    first, second = jammed[..., heard <= 5.0], jammed[..., heard == 20.0]
    for name, inside, share in (("first", first, 0.3), ("second", second, 0.5)):
        inside = inside.reshape(ticks, -1)
        one_verdict = (inside == inside[:, :1]).all(axis=1).mean()
        yield against.exactly(f"{name}: all inside share their verdict", 1.0, float(one_verdict))
        yield against.share(f"{name}: share of ticks", share, inside[:, 0])
    yield against.exactly("jammed outside", 0.0, float(jammed[..., (heard > 5.0) & (heard != 20.0)].sum()))
    scores = [(on[:, 0, 0] - share) / (share * (1.0 - share)) ** 0.5 for on, share in ((first, 0.3), (second, 0.5))]
    yield against.uncorrelated("first with second", *scores)
    yield against.uncorrelated("first with its next tick", scores[0][:-1], scores[0][1:])


def _schedules(verdicts: int, seed: int) -> Iterator[Row]:
    rng = np.random.default_rng(seed)
    edges = [(1, n) for n in range(2, 21)] + [tuple(rng.choice(np.arange(2, 21), 2, replace=False)) for _ in range(30)]
    links = Links.both_ways(20, edges)
    ticks = np.arange(-(-verdicts // len(links)))
    for name, turns, due in (
        ("round robin, 3 ticks", schedule.round_robin(links, 3), _robin(links, ticks, 3)),
        ("slots of 2 ticks", schedule.slotted(links, 2), links.src - 1 == (ticks[:, None] // 2) % links.agents),
    ):
        air = flown.medium(seed, links, schedules=(Schedule(*turns, True, True),))
        opened = flown.fly(air, len(ticks)).kind[:, 0] != Verdict.CLOSED
        against = Against("schedule", f"{name}, {len(links)} links of 20 agents")
        yield against.exactly("verdicts as the clock says", 1.0, float((opened == due).mean()))
    links = flown.pairs(100)
    ticks = np.arange(-(-verdicts // len(links)))
    period, begins, lasts = (np.full(len(links), n) for n in (7, 0, 3))
    part_time = Schedule(period, begins, lasts, True, True)
    kind = flown.fly(flown.medium(seed, links, schedules=(part_time,)), len(ticks)).kind[:, 0]
    against, whole = Against("schedule", "3 of 7 ticks"), len(kind) // 7 * 7
    yield against.exactly(
        "verdicts as the clock says", 1.0, float(((ticks % 7 < 3) == (kind != Verdict.CLOSED).T).mean())
    )
    chain, closed = schedule.turning(7, 3), float((kind[:whole] == Verdict.CLOSED).mean())
    yield against.within("mean loss", chain.mean_loss, closed, 1e-12, "")
    yield against.within("mean burst", chain.mean_burst, 4.0, 1e-12, "")


def _robin(links: Links, ticks: Integers, held: int) -> Mask:
    """Neighbour after neighbour, by the definition."""
    opened = np.zeros((len(ticks), len(links)), dtype=bool)
    for agent in range(1, links.agents + 1):
        around = sorted(links.src[links.dst == agent].tolist())
        for place, neighbour in enumerate(around):
            opened[:, links.index[neighbour, agent]] = (ticks // held) % len(around) == place
    return opened


def _listed(verdicts: int, seed: int) -> Iterator[Row]:
    links, rng = flown.pairs(100), np.random.default_rng(seed)
    ticks = -(-verdicts // (2 * len(links)))
    drawn = np.stack([rng.integers(len(links), size=5000), rng.integers(ticks // 2, size=5000)], axis=-1)
    listed = np.unique(drawn, axis=0)
    offered = rng.random((ticks, 2, len(links))) < 0.5
    everywhere = np.column_stack([listed, np.ones_like(listed)])
    air = flown.medium(seed, links, ("input", "theta"), listed=everywhere, coupled=False)
    kind = flown.fly(air, ticks, offered).kind
    number, wanted = np.cumsum(offered, axis=0) - 1, set(map(tuple, listed.tolist()))
    due = np.zeros_like(offered)
    for tick, channel, link in zip(*np.nonzero(offered), strict=True):
        due[tick, channel, link] = (link, number[tick, channel, link]) in wanted
    against = Against("list", f"{len(listed)} messages of {len(links)} links")
    yield against.exactly("messages dropped", float(due.sum()), float((kind == Verdict.LISTED).sum()))
    yield against.exactly("exactly those", 1.0, float(((kind == Verdict.LISTED) == due).mean()))


def _trace(verdicts: int, seed: int) -> Iterator[Row]:
    links, ticks = flown.size(verdicts)
    rng, changes = np.random.default_rng(seed), 10
    when = np.arange(changes) * (ticks // changes)
    due = rng.uniform(0.05, 0.95, size=(changes, len(links)))
    every, time = np.arange(len(links)), np.repeat(when * flown.DT, len(links))
    measured = trace.Measured(time, np.tile(every, changes), due.ravel())
    read = Trace(*measured.over(len(links), flown.DT, ticks), True, True)
    lost = flown.fly(flown.medium(seed, links, traces=(read,)), ticks).kind[:, 0] == Verdict.LOST
    against = Against("trace", f"{changes} changes on each of {len(links)} links")
    hits = np.add.reduceat(~lost, when, axis=0)
    trials = np.diff(np.append(when, ticks))[:, None] * np.ones(len(links))
    spread = float((trials * due * (1.0 - due)).sum()) ** 0.5
    mean = float((due * trials).sum()) / lost.size
    yield against.normal("mean availability", mean, float(1.0 - lost.mean()), spread / lost.size)
    yield against.shares("availability, each time and link", due, hits, trials)
    sure = Trace(when, np.where(due > 0.5, 1.0, 0.0), True, True)
    lost = flown.fly(flown.medium(seed, links, traces=(sure,)), ticks).kind[:, 0] == Verdict.LOST
    held = sure.availability[np.repeat(np.arange(changes), trials[:, 0].astype(int))]
    yield against.exactly("of 0 and 1: verdicts as it says", 1.0, float((lost == (held == 0.0)).mean()))
