"""The frontier of what breaks: outages of more and more links, for longer and longer, each with many seeds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from affinet.planning.blueprint import formation_of
from affinet.scenario.sections import Scenario
from affinet.testing.flights import Each, Flown, fly, in_order
from affinet.testing.hunt import Quarry, refuse_failing_undisturbed
from affinet.testing.trial import Trial
from analysis.claims import intervals
from analysis.claims.intervals import Interval
from analysis.models.arrays import Integers
from netem.core.links import Links

CONFIDENCE = 0.95
SEEDS = 10  # where nobody says which
_STEPS, _AT, _LONGEST = 8, 0.25, 0.5  # steps of each axis; when it begins and how long it lasts, in shares of a run
_AT_ONCE = 128  # trials that fly side by side


@dataclass(frozen=True)
class Frontier:
    """How often an invariant breaks, over a grid of outages.

    Parameters
    ----------
    at
        When they begin, in seconds.
    links, seconds
        How many links are cut, and for how long.
    broke, told
        Of each invariant, how many runs broke it, and how many put it to the test, shape (I, links, seconds).
    """

    at: float
    links: tuple[int, ...]
    seconds: tuple[float, ...]
    broke: Integers
    told: Integers

    def share(self, number: int, row: int, column: int) -> Interval:
        """Of the runs of a cell, which share breaks an invariant; exact, by Clopper and Pearson."""
        broke, told = int(self.broke[number, row, column]), int(self.told[number, row, column])
        return intervals.share(broke, 0, told, (1.0 + CONFIDENCE) / 2.0)


def grid(given: Scenario) -> tuple[float, tuple[int, ...], tuple[float, ...]]:
    """When outages of a scenario begin, of how many links they are, and how long they last."""
    formation, dt, ticks = formation_of(given), given.time.dt, given.time.ticks
    size = len(Links.both_ways(formation.agents, formation.edges))
    numbers = np.unique(np.round(np.geomspace(1, size, _STEPS)).astype(int))
    lengths = np.unique(np.maximum(np.round(np.linspace(0.0, _LONGEST, _STEPS + 1)[1:] * ticks), 1.0))
    seconds = tuple(round(float(length) * dt, 9) for length in lengths)
    return round(int(_AT * ticks) * dt, 9), tuple(numbers.tolist()), seconds


def fly_frontier(quarry: Quarry, each: Each, watch: Callable[[int, int], None]) -> Frontier:
    """Fly a grid of outages, each with every seed, which says as well which links they are of.

    Parameters
    ----------
    quarry
        What must hold, in one scenario.
    each
        Flies chunks of trials, in this process or in others.
    watch
        Told how many have flown, and of how many.

    Raises
    ------
    ScenarioError
        When an invariant fails with no fault added.
    """
    refuse_failing_undisturbed(quarry, each)
    ((settings, given),) = quarry.scenarios.items()
    at, links, seconds = grid(given)
    trials = [
        Trial(settings, seed, ([{"verb": "cut", "at": at, "lasts": lasts, "links": [f"random {number}"]}],))
        for number in links
        for lasts in seconds
        for seed in quarry.seeds
    ]
    flown = _flown(quarry, trials, each, watch)
    invariants = range(len(quarry.make()))
    shape = (len(invariants), len(links), len(seconds), len(quarry.seeds))
    broke = np.reshape([[one.breaks(number) for one in flown] for number in invariants], shape)
    told = np.reshape([[_told(one, number) for one in flown] for number in invariants], shape)
    return Frontier(at, links, seconds, broke.sum(axis=-1), told.sum(axis=-1))


def of_one_setting(quarry: Quarry) -> Quarry:
    """The quarry with seeds enough for shares, where it has one alone."""
    first = quarry.seeds[0]
    return quarry if len(quarry.seeds) > 1 else replace(quarry, seeds=range(first, first + SEEDS))


def _flown(quarry: Quarry, trials: Sequence[Trial], each: Each, watch: Callable[[int, int], None]) -> list[Flown]:
    cases = [quarry.case(trial) for trial in trials]
    chunks = [cases[first : first + _AT_ONCE] for first in range(0, len(cases), _AT_ONCE)]
    flown = list[Flown]()
    with closing(each(partial(fly, quarry.make), chunks)) as found:
        for made in in_order(found):
            flown += [one for one in made if one is not None]
            watch(len(flown), len(trials))
    return flown


def _told(one: Flown, number: int) -> bool:
    return one.breaks(number) or (not one.vacuous and one.findings[number].verdict != "vacuous")
