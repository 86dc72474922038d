"""A trial of a hunt: a seed, settings and faults, drawn by its number alone; nothing is drawn in an order."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

from affinet.scenario import loading
from affinet.scenario.sections import Scenario
from affinet.testing.menu import STEPS, Dish, Entries, Entry, Part, seconds
from netem.core.draws import uniform

MOST_FAULTS = 3
_OF_A_FAULT = 12  # draws: verb, begin, whether it ends and when, and two for each part
_OF_ALL = 3  # seed, setting, how many faults
# Few: what is held so long makes messages so late, and runs of which it is known fly side by side.
_LASTS = (1, 2, 4, 8)  # of 24 parts of a run

Settings = tuple[str, ...]
Chosen = TypeVar("Chosen")


@dataclass(frozen=True)
class Trial:
    """What a schedule of a hunt is.

    Parameters
    ----------
    settings
        Overrides of the scenario, like `network.availability=0.5`.
    seed
        Of the run.
    faults
        Each with its entries in the timeline.
    """

    settings: Settings
    seed: int
    faults: tuple[Entries, ...]

    @property
    def entries(self) -> Entries:
        """Those of all faults."""
        return [entry for fault in self.faults for entry in fault]

    @cached_property
    def key(self) -> str:
        """What tells it apart."""
        return json.dumps([self.settings, self.seed, self.faults])

    def in_scenario(self, given: Scenario) -> Scenario:
        """The scenario, which has the settings already, with the seed and the faults.

        Raises
        ------
        ScenarioError
            When something in them is wrong.
        """
        return loading.extended(given.model_copy(update={"seed": self.seed}), self.entries)


@dataclass(frozen=True)
class Deck:
    """What trials are drawn of.

    Parameters
    ----------
    scenarios
        By the settings that make them.
    seeds
        Of the runs.
    menus
        By the settings: what faults are drawn of.
    """

    scenarios: Mapping[Settings, Scenario]
    seeds: Sequence[int]
    menus: Mapping[Settings, Mapping[str, Dish]]

    def draw(self, seed: int, number: int) -> Trial:
        """The trial of a number in a hunt with this seed."""
        drawn = iter(uniform(seed, "hunt", tick=number, lanes=_OF_ALL + MOST_FAULTS * _OF_A_FAULT).tolist())
        run_seed = _of(self.seeds, next(drawn))
        settings = _of([*self.scenarios], next(drawn))
        faults = 1 + int(next(drawn) * MOST_FAULTS)
        shares = [[next(drawn) for _ in range(_OF_A_FAULT)] for _ in range(faults)]
        given, dishes = self.scenarios[settings], [*self.menus[settings].values()]
        return Trial(settings, run_seed, tuple(_fault(given, dishes, iter(each)) for each in shares))

    def drawn(self, seed: int, number: int) -> Iterator[Trial]:
        """So many trials, each of them once; fewer where so many draws hold no more."""
        known = set[str]()
        for place in range(number):
            trial = self.draw(seed, place)
            if trial.key not in known:
                known.add(trial.key)
                yield trial


def _fault(given: Scenario, dishes: Sequence[Dish], drawn: Iterator[float]) -> Entries:
    dish = _of(dishes, next(drawn))
    span: Entry = {"at": seconds(given, int(next(drawn) * STEPS))}
    ends, lasts = next(drawn) < 0.5 or not dish.forever, _of(_LASTS, next(drawn))
    chosen = [_chosen(part, drawn) for part in dish.parts]
    # What is held for good is lost; it would only be known how late it may be, of each run another time.
    if ends or any(words.get("in_flight") == "hold" for words in chosen):
        span["lasts"] = seconds(given, lasts)
    return dish.entries(span, chosen)


def _chosen(part: Part, drawn: Iterator[float]) -> Entry:
    return _of(_of(part, next(drawn)), next(drawn))


def _of(some: Sequence[Chosen], share: float) -> Chosen:
    return some[min(int(share * len(some)), len(some) - 1)]
