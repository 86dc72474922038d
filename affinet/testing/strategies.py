"""Hypothesis strategies of faults: entries of a timeline that fit a scenario, simplest first, so that they shrink well.

A fault is a list of entries, since what is killed may be restarted. Plain maps, as a scenario file has them.
"""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from affinet.planning.blueprint import formation_of
from affinet.scenario.sections import Scenario
from affinet.testing import menu
from affinet.testing.menu import LONGEST, STEPS, Dish, Entries, Entry, Part, seconds

VERBS = menu.VERBS


def moments(given: Scenario, last: int = STEPS) -> SearchStrategy[float]:
    """Times of a run, in seconds: multiples of a 24th of it, whole ticks."""
    return st.integers(0, last).map(lambda step: seconds(given, step))


def spans(given: Scenario, *, forever: bool = True) -> SearchStrategy[Entry]:
    """When a fault begins, and how long it lasts; one that never ends is the simplest."""
    lasting = st.integers(1, LONGEST).map(lambda step: {"lasts": seconds(given, step)})
    end = st.one_of(st.just({}), lasting) if forever else lasting
    return st.builds(lambda at, end: {"at": at} | end, moments(given, STEPS - 1), end)


def agents(given: Scenario) -> SearchStrategy[list[int | str]]:
    """Selectors of agents: one, those of a role, or a random few."""
    return st.one_of(*map(st.sampled_from, menu.agents(formation_of(given))))


def links(given: Scenario) -> SearchStrategy[list[str]]:
    """Selectors of links: one, both ways of an edge, all of an agent, by role or by what the graph makes of itself."""
    return st.one_of(*map(st.sampled_from, menu.links(formation_of(given))))


def faults(given: Scenario, verbs: Sequence[str]) -> SearchStrategy[Entries]:
    """One fault of any of these verbs."""
    dishes = menu.menu(given, verbs)
    return st.sampled_from(list(verbs)).flatmap(lambda verb: _fault(given, dishes[verb]))


def timelines(given: Scenario, verbs: Sequence[str], most: int = 3) -> SearchStrategy[list[Entries]]:
    """One to `most` faults of these verbs, each with its entries."""
    return st.lists(faults(given, verbs), min_size=1, max_size=most)


def schedules(given: Scenario, verbs: Sequence[str], most: int = 3) -> SearchStrategy[Entries]:
    """Timelines of one to `most` faults of these verbs."""
    return timelines(given, verbs, most).map(lambda chosen: [entry for fault in chosen for entry in fault])


def _fault(given: Scenario, dish: Dish) -> SearchStrategy[Entries]:
    chosen = st.tuples(*map(_part, dish.parts))
    return st.builds(dish.entries, spans(given, forever=dish.forever), chosen)


def _part(part: Part) -> SearchStrategy[Entry]:
    return st.one_of(*map(st.sampled_from, part))
