"""What is smaller than a trial, along each axis: fewer faults, a plainer run, fewer links or agents, shorter, weaker.

Each axis lists candidates, the smallest first: halves of halves, and what is less by a step, two, four. A fault from which
neither can be taken is the smallest along it, to the step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from affinet.planning.blueprint import formation_of
from affinet.scenario import selectors
from affinet.scenario.sections import Scenario
from affinet.scenario.selectors import ChoiceKey
from affinet.testing.menu import Entries, Entry, killed
from affinet.testing.trial import Settings, Trial
from netem.core.links import Links

_SHARE, _LENGTH, _RATE = 0.01, 0.01, 0.001  # steps: of probabilities, of metres and metres per second, of clocks
_STEPS: Mapping[str, float] = {
    "loss": _SHARE,
    "p": _SHARE,
    "by": _LENGTH,
    "velocity": _LENGTH,
    "sigma": _LENGTH,
    "rate": _RATE,
}
_PLAINEST = {"in_flight": "drop", "state": "cold", "body": "hold"}
_TIMED_APART = frozenset(("after", "when", "every", "name", "times"))
Chosen = TypeVar("Chosen")


@dataclass(frozen=True)
class Ground:
    """In which scenarios a trial is made smaller.

    Parameters
    ----------
    scenarios
        By the settings that make them, the plainest first.
    seeds
        Of the runs, the plainest first.
    """

    scenarios: Mapping[Settings, Scenario]
    seeds: Sequence[int]


Axis = Callable[[Trial, Ground], Iterator[Trial]]


def fewer_faults(trial: Trial, _: Ground) -> Iterator[Trial]:
    """One of its faults alone, or all but one."""
    faults = trial.faults
    if len(faults) > 1:
        yield from (replace(trial, faults=(fault,)) for fault in faults)
    if len(faults) > 2:
        yield from (replace(trial, faults=faults[:n] + faults[n + 1 :]) for n in range(len(faults) - 1, -1, -1))


def plainer_run(trial: Trial, ground: Ground) -> Iterator[Trial]:
    """Earlier settings and seeds, of those the hunt has."""
    settings, seeds = _before(trial.settings, [*ground.scenarios]), _before(trial.seed, ground.seeds)
    yield from (replace(trial, settings=one, seed=seed) for one in settings for seed in seeds)
    yield from (replace(trial, settings=one) for one in settings)
    yield from (replace(trial, seed=seed) for seed in seeds)


def plainer_words(trial: Trial, _: Ground) -> Iterator[Trial]:
    """Words that say the usual."""
    for number, fault in enumerate(trial.faults):
        plain = [{key: _PLAINEST.get(key, value) for key, value in entry.items()} for entry in fault]
        if plain != fault and fault[0]["verb"] != "pause":
            yield _with(trial, number, plain)


def less_wide(trial: Trial, ground: Ground) -> Iterator[Trial]:
    """Fewer links, or fewer agents; of a partition some of the links that it cuts."""
    given = ground.scenarios[trial.settings]
    for number, fault in enumerate(trial.faults):
        entry = fault[0]
        place = len(given.timeline) + 1 + sum(map(len, trial.faults[:number]))
        found = _held(entry, given, ChoiceKey(trial.seed, place))
        if found is None:
            continue
        key, whole = found
        for some in _subsets(whole):
            if entry["verb"] == "partition":
                words = {name: value for name, value in entry.items() if name != "groups"} | {"verb": "cut"}
                yield _with(trial, number, [words | {key: some}])
            else:
                yield _with(trial, number, [one | {key: some} for one in fault])


def shorter(trial: Trial, ground: Ground) -> Iterator[Trial]:
    """Of a shorter time, at the beginning or at the end of it; then as long, but earlier."""
    given = ground.scenarios[trial.settings]
    for number, fault in enumerate(trial.faults):
        if _TIMED_APART & fault[0].keys():
            continue
        start, end = span(fault, given)
        first, last = fault[0], fault[-1]
        for_good = last is first and not {"lasts", "until"} & first.keys()
        for ticks in _less(end - start):
            yield _with(trial, number, spanning(fault, (start, start + ticks), given))
            yield _with(trial, number, spanning(fault, (end - ticks, None if for_good else end), given))
        for moved in _before_it(start):
            yield _with(trial, number, spanning(fault, (moved, moved + end - start), given))


def all_earlier(trial: Trial, ground: Ground) -> Iterator[Trial]:
    """All faults sooner by as much: what has to meet cannot move alone."""
    given = ground.scenarios[trial.settings]
    if len(trial.faults) < 2 or any(_TIMED_APART & fault[0].keys() for fault in trial.faults):
        return
    spans = [span(fault, given) for fault in trial.faults]
    first = min(start for start, _ in spans)
    for moved in _before_it(first):
        sooner = [(start - first + moved, end - first + moved) for start, end in spans]
        pairs = zip(trial.faults, sooner, strict=True)
        yield replace(trial, faults=tuple(spanning(fault, ticks, given) for fault, ticks in pairs))


def weaker(trial: Trial, ground: Ground) -> Iterator[Trial]:
    """With a smaller probability, delay, vector or rate."""
    steps = {**_STEPS, "delay": ground.scenarios[trial.settings].time.dt}
    for number, fault in enumerate(trial.faults):
        for key in steps.keys() & fault[0].keys():
            for value in _smaller(fault[0][key], steps[key]):
                yield _with(trial, number, [fault[0] | {key: value}, *fault[1:]])


AXES: tuple[Axis, ...] = (fewer_faults, plainer_run, plainer_words, less_wide, shorter, all_earlier, weaker)


def span(fault: Entries, given: Scenario) -> tuple[int, int]:
    """The first tick of a fault, and the first after it, none of them after the run."""
    dt, ticks, first, last = given.time.dt, given.time.ticks, fault[0], fault[-1]
    start, end = round(first.get("at", 0.0) / dt), ticks
    if last is not first:
        end = round(last["at"] / dt)
    elif "lasts" in first:
        end = start + round(first["lasts"] / dt)
    elif "until" in first:
        end = round(first["until"] / dt)
    return min(start, ticks), min(end, ticks)


def spanning(fault: Entries, ticks: tuple[int, int | None], given: Scenario) -> Entries:
    """The fault from one tick to another, or for good."""
    (start, end), dt = ticks, given.time.dt
    times: Entry = {"at": round(start * dt, 9)} | ({} if end is None else {"lasts": round((end - start) * dt, 9)})
    first = {key: value for key, value in fault[0].items() if key not in ("at", "lasts", "until", "verb")}
    if fault[0]["verb"] == "kill":
        return killed(times, first | {"state": fault[-1].get("state", "cold")})
    return [{"verb": fault[0]["verb"]} | times | first]


def _held(entry: Entry, given: Scenario, key: ChoiceKey) -> tuple[str, list[Any]] | None:
    """What an entry takes hold of, one by one, and under which word; None where it can be no less."""
    formation = formation_of(given)
    links = Links.both_ways(formation.agents, formation.edges)
    if "agents" in entry:
        return "agents", [*selectors.agents(entry["agents"], formation, key)]
    if "links" in entry:
        return "links", [f"{src}->{dst}" for src, dst in selectors.pairs(entry["links"], formation, links, key)]
    if "groups" not in entry:
        return None
    groups = entry["groups"]
    sides = selectors.groups(groups, formation) if isinstance(groups, str) else groups
    side = {agent: number for number, group in enumerate(sides) for agent in group}
    ends = zip(links.src.tolist(), links.dst.tolist(), strict=True)
    return "links", [f"{src}->{dst}" for src, dst in ends if side.get(src) != side.get(dst)]


def _subsets(whole: Sequence[Chosen]) -> list[list[Chosen]]:
    """Each one, each half, quarter, eighth of them, and all but those; the smallest first."""
    size = len(whole)
    if size < 2:
        return []
    parts = sorted({size, *(2**n for n in range(1, size.bit_length()) if 2**n < size)})
    chunks = [(size * part // among, size * (part + 1) // among) for among in parts for part in range(among)]
    those = [[*whole[first:end]] for first, end in chunks]
    others = [[*whole[:first], *whole[end:]] for first, end in chunks]
    return sorted((some for some in (*those, *others) if some), key=len)


def _less(whole: int) -> list[int]:
    """Whole numbers below one: its half, and the half of that; it less one, two, four; the smallest first."""
    places = range(whole.bit_length())
    return sorted({number for n in places for number in (whole >> n, whole - (1 << n)) if 0 < number < whole})


def _before_it(tick: int) -> tuple[int, ...]:
    """Ticks before one, the earliest first."""
    return (0, *_less(tick)) if tick else ()


def _smaller(value: Any, step: float) -> Iterator[Any]:
    """Numbers nearer to 0, or shorter vectors, in steps."""
    length = float(np.abs(value).max())
    for steps in _less(round(length / step)):
        share = steps * step / length
        yield [round(part * share, 9) for part in value] if isinstance(value, list) else round(value * share, 9)


def _before(one: Chosen, among: Sequence[Chosen]) -> Sequence[Chosen]:
    """The first of those before one, at the most: to be plainer than that is not to be smaller."""
    return among[:1] if one in among and one != among[0] else ()


def _with(trial: Trial, number: int, fault: Entries) -> Trial:
    return replace(trial, faults=(*trial.faults[:number], fault, *trial.faults[number + 1 :]))
