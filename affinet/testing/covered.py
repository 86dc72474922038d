"""What the trials of a hunt have covered, and what of what there is they never met."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, combinations_with_replacement, permutations
from typing import NamedTuple

import numpy as np

from affinet.planning.plan import Plan
from affinet.testing.menu import Dish, Entries, Entry
from affinet.testing.trial import Trial

VERB, SELECTOR, THIRD, ORDER, LINK, TOGETHER = (
    "verb",
    "selector",
    "begins in",
    "in which order",
    "on a link at once",
    "in one schedule",
)
KINDS = (VERB, SELECTOR, THIRD, ORDER, LINK, TOGETHER)
THIRDS = ("first third", "second third", "last third")
_ON_LINKS = frozenset(
    ("cut", "partition", "lose", "delay", "degrade", "freeze", "kill", "pause", "bias", "outlier", "dropout")
)


class Item(NamedTuple):
    """One thing that a trial may cover, of a kind."""

    kind: str
    name: str


@dataclass
class Coverage:
    """What a hunt has tried.

    Parameters
    ----------
    schedules
        How many were flown.
    items
        How many of them covered each thing.
    vacuous
        How many could not tell: a fault touched nothing, or no invariant was put to the test.
    unfit
        How many were no schedule of the scenario: a selector matched nothing.
    shrinking
        How many flew besides to shrink what broke.
    """

    schedules: int = 0
    items: Counter[Item] = field(default_factory=Counter)
    vacuous: int = 0
    unfit: int = 0
    shrinking: int = 0

    def add(self, covered: Iterable[Item], *, vacuous: bool) -> bool:
        """Count a schedule; whether it covered something that none had before."""
        those = set(covered)
        new = not those <= self.items.keys()
        self.schedules += 1
        self.vacuous += vacuous
        self.items.update(those)
        return new

    def of(self, kind: str) -> dict[str, int]:
        """How many schedules covered each thing of a kind."""
        return {item.name: number for item, number in self.items.items() if item.kind == kind}

    def never(self, dishes: Mapping[str, Dish], most: int) -> dict[str, list[str]]:
        """What there is of each kind and was never met, where schedules have so many faults at the most."""
        missing: dict[str, list[str]] = {kind: [] for kind in KINDS}
        for item in _all(dishes, most):
            if item not in self.items:
                missing[item.kind].append(item.name)
        return missing


def of(trial: Trial, plan: Plan) -> frozenset[Item]:
    """What a trial covers, from its plan."""
    spans = [_span(fault, plan) for fault in trial.faults]
    verbs = [str(fault[0]["verb"]) for fault in trial.faults]
    ticks = plan.world.ticks
    items = {Item(VERB, verb) for verb in verbs}
    items |= {Item(SELECTOR, _kind(word)) for entry in trial.entries for word in _words(entry)}
    items |= {
        Item(THIRD, f"{verb}, {THIRDS[min(2, 3 * start // ticks)]}")
        for verb, (start, _) in zip(verbs, spans, strict=True)
    }
    for (one, (start, end)), (other, (later, _)) in permutations(zip(verbs, spans, strict=True), 2):
        if later >= end:
            items.add(Item(ORDER, f"{other} after {one}"))
        elif later > start:
            items.add(Item(ORDER, f"{other} under {one}"))
    items |= {Item(TOGETHER, _joined(pair)) for pair in combinations(verbs, 2)}
    return frozenset(items | set(_on_links(plan)))


def _on_links(plan: Plan) -> Iterator[Item]:
    """Which verbs hold a link at once, in any tick."""
    timeline, ticks = plan.timeline, plan.world.ticks
    placed = [
        (number, fault)
        for number, fault in enumerate(timeline.faults)
        if fault.trigger is None and str(fault.verb) in _ON_LINKS
    ]
    for tick in sorted({fault.start for _, fault in placed if fault.start < ticks}):
        acting = [(str(fault.verb), timeline.held(number)) for number, fault in placed if fault.active(tick)]
        held = np.array([mask for _, mask in acting])
        for row in np.unique(held.T, axis=0):
            if row.any():
                yield Item(
                    LINK, _joined({verb for (verb, _), there in zip(acting, row.tolist(), strict=True) if there})
                )


def _all(dishes: Mapping[str, Dish], most: int) -> Iterator[Item]:
    yield from (Item(VERB, verb) for verb in dishes)
    words = (
        word
        for dish in dishes.values()
        for part in dish.parts
        for kind in part
        for entry in kind
        for word in _words(entry)
    )
    yield from (Item(SELECTOR, kind) for kind in dict.fromkeys(map(_kind, words)))
    yield from (Item(THIRD, f"{verb}, {third}") for verb in dishes for third in THIRDS)
    on_links = sorted(_ON_LINKS & dishes.keys())
    yield from (Item(LINK, verb) for verb in on_links)
    if most > 1:
        yield from (Item(ORDER, f"{one} {how} {other}") for one in dishes for other in dishes for how in _HOW)
        yield from (Item(LINK, _joined(pair)) for pair in combinations(on_links, 2))
        yield from (Item(TOGETHER, _joined(pair)) for pair in combinations_with_replacement(dishes, 2))


_HOW = ("after", "under")


def _joined(verbs: Iterable[str]) -> str:
    return "+".join(sorted(verbs))


def _span(fault: Entries, plan: Plan) -> tuple[int, int]:
    """The first tick of a fault, and the first after it."""
    dt, first, last = plan.world.dt, fault[0], fault[-1]
    start = round(first.get("at", 0.0) / dt)
    if last is not first:
        return start, round(last["at"] / dt)
    if "lasts" in first:
        return start, start + round(first["lasts"] / dt)
    return start, round(first["until"] / dt) if "until" in first else plan.world.ticks


def _words(entry: Entry) -> Sequence[object]:
    chosen = entry.get("links") or entry.get("agents") or entry.get("groups") or []
    return list(chosen) if isinstance(chosen, list) else [chosen]


def _kind(word: object) -> str:
    text = str(word)
    if isinstance(word, list):
        return "groups"
    if text.isdecimal():
        return "agent" if isinstance(word, int) else "all links of an agent"
    if text.replace("->", "").isdecimal():
        return "one-way link"
    return "edge" if text.replace("-", "").isdecimal() else text
