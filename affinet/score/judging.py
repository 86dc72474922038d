"""What a score says of an entrant against each of the others, how sure it is, and in words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from affinet.score.card import Task, Worsening
from affinet.score.flying import Flown, Timed
from analysis.claims import intervals, paired
from analysis.claims.intervals import Interval
from analysis.claims.paired import Comparison
from analysis.models.arrays import Array

CONFIDENCE = 0.95
MATTERS = 1.1  # a factor of errors up to which one is as good as another
ASTRAY = 10.0  # times what loses a swarm: beyond that one error is as bad as another
_TELLS_THE_TRUTH = (1 / 1.1, 1.1)  # of a normalised estimation error squared


@dataclass(frozen=True)
class Raw:
    """All that was flown for a score.

    Parameters
    ----------
    tasks, airs, worsenings
        What was flown, through what, and what was made worse: names of airs.
    entrants
        Names, the one that is scored first.
    cells, noisier
        Of each task, air and entrant what came of it; and of each task and entrant with worse sensors, in the first air.
    points
        Of each task, worsening and entrant how bad it had to be for the swarm of each seed to be lost.
    times
        Of each task and entrant.
    """

    tasks: Sequence[Task]
    airs: Sequence[str]
    worsenings: Sequence[Worsening]
    entrants: Sequence[str]
    cells: Mapping[tuple[str, str, str], Flown]
    noisier: Mapping[tuple[str, str], Flown]
    points: Mapping[tuple[str, str, str], Sequence[float]]
    times: Mapping[tuple[str, str], Timed]

    @property
    def scored(self) -> str:
        """Who is scored."""
        return self.entrants[0]

    def flies(self, task: str, entrant: str, air: str | None = None) -> bool:
        """Whether an entrant suits a task: at all, or through an air."""
        return any(self.cells[task, each, entrant].unsuited is None for each in ([air] if air else self.airs))

    def flown(self, task: str, entrant: str) -> list[str]:
        """Airs that it flies a task through."""
        return [air for air in self.airs if self.flies(task, entrant, air)]

    def runs(self, task: str, air: str, entrant: str, what: str) -> Array:
        """What was measured of each run, shape (R,)."""
        return np.array(self.cells[task, air, entrant].runs[what])


class Compared(NamedTuple):
    """The one that is scored against a rival, in a task and an air: by which factor its errors are the other's."""

    task: str
    air: str
    rival: str
    factor: Interval
    decision: Comparison


class BreakDown(NamedTuple):
    """How bad it has to be for half of the swarms to be lost, and how that compares for the one that is scored."""

    task: str
    worsening: str
    entrant: str
    median: Interval
    decision: Comparison | None


@dataclass(frozen=True)
class Score:
    """What a score says.

    Parameters
    ----------
    compared
        With each rival, in each task and air.
    break_downs
        Of every entrant.
    words
        The verdict, sentence by sentence.
    """

    compared: tuple[Compared, ...]
    break_downs: tuple[BreakDown, ...]
    words: tuple[str, ...]


def judge(raw: Raw) -> Score:
    """Judge what was flown."""
    compared, break_downs = tuple(_compared(raw)), tuple(_break_downs(raw))
    words = [
        *_unsuited(raw),
        *_vacuous(raw),
        *_against(raw, compared),
        *_points(raw, break_downs),
        *_honest(raw),
        *_cost(raw),
    ]
    return Score(compared, break_downs, tuple(words))


def _compared(raw: Raw) -> Iterator[Compared]:
    pairs = [
        (task, air, rival)
        for task in raw.tasks
        for air in raw.flown(task.name, raw.scored)
        for rival in raw.entrants[1:]
        if raw.flies(task.name, rival, air) and not raw.runs(task.name, air, raw.scored, "vacuous").all()
    ]
    for task, air, rival in pairs:
        one, other = (raw.runs(task.name, air, who, "error") for who in (raw.scored, rival))
        factor = paired.ratio(one, other, ASTRAY * task.lost, len(pairs), CONFIDENCE)
        yield Compared(task.name, air, rival, factor, paired.compared(factor, MATTERS))


def _break_downs(raw: Raw) -> Iterator[BreakDown]:
    worsenings = {one.name: one for one in raw.worsenings}
    comparisons = sum(who != raw.scored for _, _, who in raw.points)
    for (task, worsening, who), points in raw.points.items():
        own = raw.points.get((task, worsening, raw.scored))
        decision = (
            None
            if who == raw.scored or own is None
            else paired.larger(np.array(own), np.array(points), comparisons, CONFIDENCE)
        )
        yield BreakDown(task, worsening, who, break_down(points, worsenings[worsening]), decision)


def break_down(points: Sequence[float], worse: Worsening) -> Interval:
    """How bad it has to be for half of the swarms to be lost, when it was found for each by bisection."""
    median = paired.median(np.array(points), CONFIDENCE)
    return Interval(median.found, worse.around(median.low)[0], worse.around(median.high)[1])


def _unsuited(raw: Raw) -> Iterator[str]:
    for task in raw.tasks:
        if not raw.flies(task.name, raw.scored):
            yield f"{task.name}: {raw.scored} does not suit it: {raw.cells[task.name, raw.airs[0], raw.scored].unsuited}"
            continue
        for air in raw.airs:
            if (why := raw.cells[task.name, air, raw.scored].unsuited) is not None:
                yield f"{task.name}, {air}: {raw.scored} does not suit it: {why}"


def _vacuous(raw: Raw) -> Iterator[str]:
    for task in raw.tasks:
        for air in raw.flown(task.name, raw.scored):
            share = raw.runs(task.name, air, raw.scored, "vacuous").mean()
            if share > 0.0:
                runs = "all runs" if share == 1.0 else f"{share:.0%} of the runs"
                yield f"{task.name}, {air}: in {runs} a fault touched nothing, which proves nothing"


def _against(raw: Raw, compared: Sequence[Compared]) -> Iterator[str]:
    for task in raw.tasks:
        for rival in raw.entrants[1:]:
            told = [one for one in compared if (one.task, one.rival) == (task.name, rival)]
            if not told:
                continue
            parts = []
            for decision in Comparison:
                airs = [one.air for one in told if one.decision is decision]
                if airs:
                    parts.append(f"{decision} in {len(airs)} of {len(told)} airs ({', '.join(airs)})")
            yield f"{task.name}, against {rival}: {'; '.join(parts)}"


def _points(raw: Raw, break_downs: Sequence[BreakDown]) -> Iterator[str]:
    of = {one.name: one for one in raw.worsenings}
    for own in break_downs:
        if own.entrant != raw.scored:
            continue
        worse = of[own.worsening]
        others = [
            f"with {one.entrant} at {point(one.median, worse)} ({one.decision})"
            for one in break_downs
            if (one.task, one.worsening) == (own.task, own.worsening) and one.entrant != raw.scored
        ]
        unit = f" {worse.unit}".rstrip()
        against = f"; {', '.join(others)}" if others else ""
        yield f"{own.task}, {own.worsening}: half of the swarms are lost at {point(own.median, worse)}{unit}{against}"


def point(found: Interval, worse: Worsening) -> str:
    """A break-down point with its interval, in words."""
    if found.found <= worse.least:
        return f"below {worse.least_tried:.3g}"
    beyond = f"beyond {worse.most:g}"
    if np.isinf(found.found):
        return beyond
    low = f"{worse.least:g}" if np.isinf(found.low) else f"{found.low:.3g}"
    return f"{found.found:.3g} ({low} to {beyond if np.isinf(found.high) else f'{found.high:.3g}'})"


def _honest(raw: Raw) -> Iterator[str]:
    flown = [task for task in raw.tasks if raw.flies(task.name, raw.scored)]
    tests = max(1, len(flown) * len(raw.airs))
    for task in flown:
        airs = raw.flown(task.name, raw.scored)
        found = {
            air: intervals.mean(raw.runs(task.name, air, raw.scored, "nees"), tests=tests, confidence=CONFIDENCE)
            for air in airs
        }
        sure = {air: one for air, one in found.items() if one.low > _TELLS_THE_TRUTH[1]}
        if sure:
            most = max(sure.items(), key=lambda item: item[1].found)
            yield (
                f"{task.name}: overconfident in {len(sure)} of {len(airs)} airs ({', '.join(sure)}): squared errors are "
                f"{most[1].found:.3g} times what its covariances say in {most[0]}"
            )
        if (task.name, raw.scored) in raw.noisier:
            yield from _blind_to_sensors(raw, task)


def _blind_to_sensors(raw: Raw, task: Task) -> Iterator[str]:
    """Whoever measures estimates worse with worse sensors; who does not knows what nobody told it."""
    factor = _with_worse_sensors(raw, task, raw.scored)
    suffers = [_with_worse_sensors(raw, task, rival) for rival in raw.entrants[1:]]
    if factor is None or not any(one is not None and one.low > MATTERS for one in suffers):
        return  # of one that estimates nothing, or where the sensors are worse to nobody
    if factor.high < MATTERS:
        yield (
            f"{task.name}: its estimates do not depend on its sensors: with {', '.join(task.noisier)} their errors are "
            f"{factor} times what they were; it knows what it has not measured"
        )


def _with_worse_sensors(raw: Raw, task: Task, who: str) -> Interval | None:
    """By which factor its estimates are worse."""
    if (task.name, who) not in raw.noisier:
        return None
    worse = np.array(raw.noisier[task.name, who].runs["estimation"])
    usual = raw.runs(task.name, raw.airs[0], who, "estimation")
    if np.isnan(worse).any() or np.isnan(usual).any():
        return None
    return paired.ratio(worse, usual, np.inf, len(raw.tasks), CONFIDENCE)


def _cost(raw: Raw) -> Iterator[str]:
    for (task, who), own in raw.times.items():
        if who != raw.scored:
            continue
        others = [
            f"with {rival} {raw.times[task, rival].tick_s * 1e3:.2g} ms"
            for rival in raw.entrants[1:]
            if (task, rival) in raw.times
        ]
        against = f" ({', '.join(others)})" if others else ""
        yield (
            f"{task}: a tick of the whole swarm takes {own.tick_s * 1e3:.2g} ms of this machine{against}; each agent says "
            f"{own.messages:.4g} messages, {own.bytes:.4g} bytes a second"
        )
