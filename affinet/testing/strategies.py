"""Hypothesis strategies of faults: entries of a timeline that fit a scenario, simplest first, so that they shrink well.

A fault is a list of entries, since what is killed may be restarted. Plain maps, as a scenario file has them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from affinet.planning.blueprint import formation_of
from affinet.scenario.profiles import presets
from affinet.scenario.sections import Scenario
from netem.core.links import Links

Entry = dict[str, Any]
Entries = list[Entry]

_STEPS = 24


def moments(given: Scenario, last: int = _STEPS) -> SearchStrategy[float]:
    """Times of a run, in seconds: multiples of a 24th of it, whole ticks."""
    return st.integers(0, last).map(lambda step: _seconds(given, step))


def spans(given: Scenario, *, forever: bool = True) -> SearchStrategy[Entry]:
    """When a fault begins, and how long it lasts; one that never ends is the simplest."""
    lasting = st.integers(1, _STEPS // 3).map(lambda step: {"lasts": _seconds(given, step)})
    end = st.one_of(st.just({}), lasting) if forever else lasting
    return st.builds(lambda at, end: {"at": at} | end, moments(given, _STEPS - 1), end)


def agents(given: Scenario) -> SearchStrategy[list[int | str]]:
    """Selectors of agents: one, those of a role, or a random few."""
    size = formation_of(given).agents
    one = st.integers(1, size).map(lambda agent: [agent])
    return st.one_of(one, st.sampled_from([["followers"], ["leaders"]]), st.sampled_from([["random 1"], ["random 2"]]))


def links(given: Scenario) -> SearchStrategy[list[str]]:
    """Selectors of links: one, both ways of an edge, all of an agent, by role or by what the graph makes of itself."""
    formation = formation_of(given)
    ways = Links.both_ways(formation.agents, formation.edges)
    one = [[f"{src}->{dst}"] for src, dst in zip(ways.src.tolist(), ways.dst.tolist(), strict=True)]
    edges = [[f"{i}-{j}"] for i, j in formation.edges]
    whole = [[f"{agent}"] for agent in range(1, formation.agents + 1)]
    words = [["all"], ["leaders->followers"], ["followers->leaders"], ["min-cut"], ["random 3"]]
    return st.one_of(*(st.sampled_from(chosen) for chosen in (one, edges, whole, words)))


def faults(given: Scenario, verbs: Sequence[str]) -> SearchStrategy[Entries]:
    """One fault of any of these verbs."""
    return st.sampled_from(list(verbs)).flatmap(lambda verb: _FAULTS[verb](given))


def timelines(given: Scenario, verbs: Sequence[str], most: int = 3) -> SearchStrategy[list[Entries]]:
    """One to `most` faults of these verbs, each with its entries."""
    return st.lists(faults(given, verbs), min_size=1, max_size=most)


def schedules(given: Scenario, verbs: Sequence[str], most: int = 3) -> SearchStrategy[Entries]:
    """Timelines of one to `most` faults of these verbs."""
    return timelines(given, verbs, most).map(lambda chosen: [entry for fault in chosen for entry in fault])


def _seconds(given: Scenario, step: int) -> float:
    ticks = max(1, given.time.ticks // _STEPS) * step
    return round(ticks * given.time.dt, 9)


def _one(given: Scenario, verb: str, *parts: SearchStrategy[Entry], forever: bool = True) -> SearchStrategy[Entries]:
    return st.tuples(spans(given, forever=forever), *parts).map(
        lambda chosen: [{"verb": verb} | {key: value for part in chosen for key, value in part.items()}]
    )


def _among(key: str, *values: Any) -> SearchStrategy[Entry]:
    return st.sampled_from(values).map(lambda value: {key: value})


def _on(given: Scenario) -> SearchStrategy[Entry]:
    return links(given).map(lambda chosen: {"links": chosen})


def _whom(given: Scenario) -> SearchStrategy[Entry]:
    return agents(given).map(lambda chosen: {"agents": chosen})


def _in_flight() -> SearchStrategy[Entry]:
    return _among("in_flight", "drop", "deliver", "hold")


def _kill(given: Scenario) -> SearchStrategy[Entries]:
    def entries(span: Entry, agent: int, state: str) -> Entries:
        killed = {"verb": "kill", "at": span["at"], "agents": [agent]}
        if "lasts" not in span:
            return [killed]
        back = {"verb": "restart", "at": round(span["at"] + span["lasts"], 9), "agents": [agent], "state": state}
        return [killed, back]

    size = formation_of(given).agents
    return st.builds(entries, spans(given), st.integers(1, size), st.sampled_from(["cold", "warm"]))


def _vectors(given: Scenario, key: str, *lengths: float) -> SearchStrategy[Entry]:
    dimension = formation_of(given).dimension
    directions = [*np.eye(dimension).tolist(), *(-np.eye(dimension)).tolist()]
    return st.builds(
        lambda length, way: {key: [length * part for part in way]},
        st.sampled_from(lengths),
        st.sampled_from(directions),
    )


def _lies(given: Scenario) -> SearchStrategy[Entry]:
    dimension = formation_of(given).dimension
    mirror = np.diag([-1.0] + [1.0] * (dimension - 1))
    return _among("matrix", *(matrix.tolist() for matrix in (0.8 * np.eye(dimension), mirror, 0.0 * mirror)))


_FAULTS: dict[str, Callable[[Scenario], SearchStrategy[Entries]]] = {
    "cut": lambda given: _one(given, "cut", _on(given), _in_flight()),
    "lose": lambda given: _one(given, "lose", _on(given), _among("loss", 1.0, 0.9, 0.5)),
    "dropout": lambda given: _one(given, "dropout", _on(given), _among("p", 1.0, 0.9, 0.5)),
    "partition": lambda given: _one(given, "partition", _among("groups", "halves", "leaders", "min-cut"), _in_flight()),
    "delay": lambda given: _one(given, "delay", _on(given), _among("delay", 0.1, 0.2, 0.5, 1.0)),
    "degrade": lambda given: _one(given, "degrade", _on(given), _among("profile", *sorted(presets()))),
    "freeze": lambda given: _one(given, "freeze", _on(given)),
    "kill": _kill,
    "pause": lambda given: _one(given, "pause", _whom(given), _among("in_flight", "hold", "drop")),
    "depart": lambda given: _one(given, "depart", _whom(given), _among("body", "hold", "drift", "vanish")),
    "bias": lambda given: _one(given, "bias", _on(given), _vectors(given, "by", 0.2, 0.5)),
    "outlier": lambda given: _one(given, "outlier", _on(given), _among("p", 0.05, 0.2), _among("sigma", 1.0, 3.0)),
    "gust": lambda given: _one(given, "gust", _whom(given), _vectors(given, "velocity", 0.2, 0.5), forever=False),
    "clock": lambda given: _one(given, "clock", _whom(given), _among("rate", 0.01, -0.01, 0.05)),
    "lie": lambda given: _one(given, "lie", _whom(given), _lies(given)),
}
VERBS: tuple[str, ...] = tuple(_FAULTS)
