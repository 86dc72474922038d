"""What random faults are drawn of: for each verb, words of a timeline that fit a scenario, simplest first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from affinet.planning.blueprint import formation_of
from affinet.scenario.profiles import presets
from affinet.scenario.sections import Scenario
from netem.core.links import Links
from world.formation.nominal import Formation

Entry = dict[str, Any]
Entries = list[Entry]
Part = tuple[tuple[Entry, ...], ...]

STEPS = 24
LONGEST = STEPS // 3


@dataclass(frozen=True)
class Dish:
    """What a fault of a verb is drawn of.

    Parameters
    ----------
    verb
        Its verb.
    parts
        It has one of each; a part has kinds, and each kind words of an entry.
    forever
        Whether it may have no end.
    """

    verb: str
    parts: tuple[Part, ...]
    forever: bool = True

    def entries(self, span: Entry, chosen: Sequence[Entry]) -> Entries:
        """The entries of a fault, from when it begins and how long it lasts, and what was chosen of each part."""
        words = {key: value for part in chosen for key, value in part.items()}
        return killed(span, words) if self.verb == "kill" else [{"verb": self.verb} | span | words]


def killed(span: Entry, words: Entry) -> Entries:
    """The entries of a kill, and of the restart that ends it."""
    agents = {"agents": words["agents"]}
    first = {"verb": "kill", "at": span["at"]} | agents
    if "lasts" not in span:
        return [first]
    back = {"verb": "restart", "at": round(span["at"] + span["lasts"], 9)} | agents | {"state": words["state"]}
    return [first, back]


def menu(given: Scenario, verbs: Sequence[str]) -> dict[str, Dish]:
    """What faults of these verbs are drawn of, in a scenario."""
    formation = formation_of(given)
    return {verb: _DISHES[verb](formation) for verb in verbs}


def seconds(given: Scenario, step: int) -> float:
    """A time of a run: so many of the 24 parts of it, in whole ticks."""
    ticks = max(1, given.time.ticks // STEPS) * step
    return round(ticks * given.time.dt, 9)


def agents(formation: Formation) -> tuple[list[list[int | str]], ...]:
    """Selectors of agents by their kinds: one, those of a role, or a random few."""
    one: list[list[int | str]] = [[agent] for agent in range(1, formation.agents + 1)]
    return one, [["followers"], ["leaders"]], [["random 1"], ["random 2"]]


def links(formation: Formation) -> tuple[list[list[str]], ...]:
    """Selectors of links by their kinds: one, both ways of an edge, all of an agent, by role or by the graph."""
    ways = Links.both_ways(formation.agents, formation.edges)
    one = [[f"{src}->{dst}"] for src, dst in zip(ways.src.tolist(), ways.dst.tolist(), strict=True)]
    edges = [[f"{i}-{j}"] for i, j in formation.edges]
    whole = [[f"{agent}"] for agent in range(1, formation.agents + 1)]
    words = [["all"], ["leaders->followers"], ["followers->leaders"], ["min-cut"], ["random 3"]]
    return one, edges, whole, words


def _among(key: str, *values: Any) -> Part:
    return (tuple({key: value} for value in values),)


def _on(formation: Formation) -> Part:
    return tuple(tuple({"links": chosen} for chosen in kind) for kind in links(formation))


def _whom(formation: Formation) -> Part:
    return tuple(tuple({"agents": chosen} for chosen in kind) for kind in agents(formation))


def _one(formation: Formation) -> Part:
    return (_whom(formation)[0],)


def _vectors(formation: Formation, key: str, *lengths: float) -> Part:
    axes = np.eye(formation.dimension)
    ways = [*axes.tolist(), *(-axes).tolist()]
    return (tuple({key: [length * part for part in way]} for length, way in product(lengths, ways)),)


def _lies(formation: Formation) -> Part:
    dimension = formation.dimension
    mirror = np.diag([-1.0] + [1.0] * (dimension - 1))
    return _among("matrix", *(matrix.tolist() for matrix in (0.8 * np.eye(dimension), mirror, 0.0 * mirror)))


_IN_FLIGHT = _among("in_flight", "drop", "deliver", "hold")
_SPLITS = _among("groups", "halves", "leaders", "min-cut")

_DISHES: Mapping[str, Callable[[Formation], Dish]] = {
    "cut": lambda f: Dish("cut", (_on(f), _IN_FLIGHT)),
    "lose": lambda f: Dish("lose", (_on(f), _among("loss", 1.0, 0.9, 0.5))),
    "dropout": lambda f: Dish("dropout", (_on(f), _among("p", 1.0, 0.9, 0.5))),
    "partition": lambda _: Dish("partition", (_SPLITS, _IN_FLIGHT)),
    "delay": lambda f: Dish("delay", (_on(f), _among("delay", 0.1, 0.2, 0.5, 1.0))),
    "degrade": lambda f: Dish("degrade", (_on(f), _among("profile", *sorted(presets())))),
    "freeze": lambda f: Dish("freeze", (_on(f),)),
    "kill": lambda f: Dish("kill", (_one(f), _among("state", "cold", "warm"))),
    "pause": lambda f: Dish("pause", (_whom(f), _among("in_flight", "hold", "drop"))),
    "depart": lambda f: Dish("depart", (_whom(f), _among("body", "hold", "drift", "vanish"))),
    "bias": lambda f: Dish("bias", (_on(f), _vectors(f, "by", 0.2, 0.5))),
    "outlier": lambda f: Dish("outlier", (_on(f), _among("p", 0.05, 0.2), _among("sigma", 1.0, 3.0))),
    "gust": lambda f: Dish("gust", (_whom(f), _vectors(f, "velocity", 0.2, 0.5)), forever=False),
    "clock": lambda f: Dish("clock", (_whom(f), _among("rate", 0.01, -0.01, 0.05))),
    "lie": lambda f: Dish("lie", (_whom(f), _lies(f))),
}
VERBS: tuple[str, ...] = tuple(_DISHES)
