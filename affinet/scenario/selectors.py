"""Words for links and agents in a scenario.

Links: "2->4" one way, "2-4" both ways, roles in place of agents ("leaders->followers"), "leaders" for all links from and
to them, "all"; and what the graph makes of itself: "ring", "bridges", "min-cut", "critical"; "random 3" for a draw.
Agents: numbers, "leaders", "followers", "all", "cut-vertices", "critical"; "random 2", "random 1 followers".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from affinet.scenario.words import hint, shown
from analysis.models import cuts
from analysis.models.arrays import Integers
from netem.core.draws import Purpose, uniform
from netem.core.links import Links
from world.formation import stress
from world.formation.nominal import Formation

T = TypeVar("T")

_ROLES = ("leaders", "followers", "all")
_ROLE = "|".join(_ROLES)
_AGENT = rf"\d{{1,9}}|{_ROLE}"
_PAIR = re.compile(rf"({_AGENT})(->|-)({_AGENT})")
_RANDOM = re.compile(r"random (\d{1,9})")
_RANDOM_AGENTS = re.compile(rf"random (\d{{1,9}})(?: ({_ROLE}))?")
_OF_GRAPH = ("ring", "bridges", "min-cut", "critical")
_AGENTS_OF_GRAPH = ("cut-vertices", "critical")
_SPLITS = ("halves", "leaders", "min-cut")
_SAY = (
    "write '2->4' for what 4 hears of 2, '2-4' for both ways, 'leaders->followers', 'leaders', 'all', "
    f"'random 3' or {', '.join(_OF_GRAPH)}"
)
_SAY_AGENTS = f"write a number, 'leaders', 'followers', 'all', 'random 2 leaders' or {', '.join(_AGENTS_OF_GRAPH)}"


@dataclass(frozen=True)
class ChoiceKey:
    """What a random choice is a function of: the seed of the run, and the number of the entry that draws."""

    seed: int
    entry: int


def check(selector: str) -> str:
    """The selector of links itself, if it is one.

    Raises
    ------
    ValueError
        When it is not.
    """
    if not (
        _PAIR.fullmatch(selector)
        or re.fullmatch(_AGENT, selector)
        or _RANDOM.fullmatch(selector)
        or selector in _OF_GRAPH
    ):
        raise ValueError(f"{selector!r} selects no links; {hint(selector, (*_ROLES, *_OF_GRAPH))}{_SAY}")
    return selector


def several(given: object) -> object:
    """One selector, like "all", as a list of one; anything else as it is."""
    return [given] if isinstance(given, str) else given


def check_agents(selector: str) -> str:
    """The selector of agents itself, if it is one.

    Raises
    ------
    ValueError
        When it is not.
    """
    if not (re.fullmatch(_ROLE, selector) or _RANDOM_AGENTS.fullmatch(selector) or selector in _AGENTS_OF_GRAPH):
        raise ValueError(f"{selector!r} selects no agents; {hint(selector, (*_ROLES, *_AGENTS_OF_GRAPH))}{_SAY_AGENTS}")
    return selector


def agent_or_word(given: object) -> int | str:
    """A selector of agents: a number, or a word.

    Raises
    ------
    ValueError
        When it is neither.
    """
    if isinstance(given, int) and not isinstance(given, bool):
        return given
    if not isinstance(given, str):
        raise ValueError(f"{shown(given)} selects no agents; {_SAY_AGENTS}")
    return check_agents(given)


def groups_or_word(given: object) -> list[list[int]] | str:
    """Groups of agents, or the word for a way to split the swarm in two.

    Raises
    ------
    ValueError
        When it is neither.
    """
    if isinstance(given, str) and given in _SPLITS:
        return given
    if isinstance(given, list) and len(given) > 1 and all(isinstance(group, list) for group in given):
        if strangers := [agent for group in given for agent in group if type(agent) is not int]:
            raise ValueError(f"groups hold numbers of agents, like [[1, 2], [3, 4]], got {shown(strangers[0])}")
        return given
    near = f"; {hint(given, _SPLITS)}".rstrip("; ") if isinstance(given, str) else ""
    raise ValueError(
        f"give at least two lists of agents, like [[1, 2], [3, 4]], or {', '.join(map(repr, _SPLITS))}, "
        f"got {shown(given)}{near}"
    )


def edge(text: str) -> tuple[int, int]:
    """The agents of an undirected edge "2-4".

    Raises
    ------
    ValueError
        When it is none.
    """
    if not (match := re.fullmatch(r"(\d{1,9})-(\d{1,9})", text)):
        raise ValueError(f"{text!r} is no edge; the edges of a formation have no direction: write '2-4'")
    return int(match[1]), int(match[2])


def rows(selector: str, formation: Formation, links: Links, key: ChoiceKey | None = None) -> list[int]:
    """Rows of the links that a selector names, in the order of the links.

    An agent or a role alone names all links from it and to it.

    Parameters
    ----------
    selector
        Of links, as a scenario says it.
    formation, links
        Who flies, and over which links.
    key
        What a random selector draws by.

    Raises
    ------
    ValueError
        When it is no selector, names agents that do not exist, matches no link, or is random without a `key`.
    """
    check(selector)
    if match := _RANDOM.fullmatch(selector):
        return _drawn(int(match[1]), np.arange(len(links)), links.src, links.dst, key, "links")
    if selector in _OF_GRAPH:
        return sorted(links.index[way] for i, j in _edges(selector, formation) for way in ((i, j), (j, i)))
    if match := _PAIR.fullmatch(selector):
        ways = [(match[1], match[3])] if match[2] == "->" else [(match[1], match[3]), (match[3], match[1])]
    else:
        ways = [(selector, "all"), ("all", selector)]
    ends = [(_named(src, formation), _named(dst, formation)) for src, dst in ways]
    found = [
        row
        for (src, dst), row in links.index.items()
        if any(src in sources and dst in receivers for sources, receivers in ends)
    ]
    if not found:
        raise ValueError(f"{selector!r} matches no link of the formation")
    return found


def pairs(
    selectors: Sequence[str], formation: Formation, links: Links, key: ChoiceKey | None = None
) -> tuple[tuple[int, int], ...]:
    """The directed links (src, dst) that any of the selectors names, each once.

    Parameters
    ----------
    selectors
        Of links, as a scenario says them.
    formation, links
        Who flies, and over which links.
    key
        What random selectors draw by.

    Raises
    ------
    ValueError
        As `rows` does.
    """
    chosen = dict.fromkeys(row for selector in selectors for row in rows(selector, formation, links, key))
    return tuple((int(links.src[row]), int(links.dst[row])) for row in chosen)


def agents(selectors: Iterable[int | str], formation: Formation, key: ChoiceKey) -> tuple[int, ...]:
    """The agents that any of the selectors names, each once.

    Raises
    ------
    ValueError
        When one is no selector, names an agent that does not exist, or nobody.
    """
    return tuple(dict.fromkeys(agent for selector in selectors for agent in _whom(selector, formation, key)))


def groups(split: str, formation: Formation) -> tuple[tuple[int, ...], ...]:
    """The swarm in two: "halves" by number, "leaders" and their followers, or the sides of the smallest cut."""
    everybody = np.arange(1, formation.agents + 1)
    side = {
        "halves": lambda: everybody <= formation.agents // 2,
        "leaders": lambda: np.isin(everybody, formation.leaders),
        "min-cut": lambda: cuts.smallest_cut(formation.agents, formation.edges),
    }[split]()
    return tuple(everybody[side].tolist()), tuple(everybody[~side].tolist())


def _whom(selector: int | str, formation: Formation, key: ChoiceKey) -> list[int]:
    if isinstance(selector, int):
        return sorted(_named(str(selector), formation))
    check_agents(selector)
    if match := _RANDOM_AGENTS.fullmatch(selector):
        among = np.array(sorted(_named(match[2] or "all", formation)))
        return [int(among[row]) for row in _drawn(int(match[1]), np.arange(len(among)), among, 0, key, "agents")]
    if selector == "cut-vertices":
        return _some(cuts.cut_vertices(formation.agents, formation.edges), "no agent's loss disconnects the others")
    if selector == "critical":
        return _some(
            _first(range(1, formation.agents + 1), lambda one: not stress.survives(formation, agent=one)), _SAFE
        )
    return sorted(_named(selector, formation))


_SAFE = "the framework stays rigid whichever is lost"


def _edges(selector: str, formation: Formation) -> list[tuple[int, int]]:
    size, edges = formation.agents, formation.edges
    match selector:
        case "ring":
            around = {frozenset((n, n % size + 1)) for n in range(1, size + 1)}
            return _some([edge for edge in edges if frozenset(edge) in around], "no agents in succession are linked")
        case "bridges":
            return _some(cuts.bridges(size, edges), "no edge's loss disconnects the formation")
        case "min-cut":
            side = cuts.smallest_cut(size, edges)
            return [(i, j) for i, j in edges if side[i - 1] != side[j - 1]]
        case _:
            return _some(_first(edges, lambda one: not stress.survives(formation, edge=one)), _SAFE)


def _first(candidates: Iterable[T], holds: Callable[[T], bool]) -> list[T]:
    return next(([one] for one in candidates if holds(one)), [])


def _some(found: list[T], otherwise: str) -> list[T]:
    if not found:
        raise ValueError(otherwise)
    return found


def _drawn(
    number: int, candidates: Integers, src: ArrayLike, dst: ArrayLike, key: ChoiceKey | None, what: str
) -> list[int]:
    """So many of the candidates, by draws that are a function of each alone."""
    if key is None:
        raise ValueError("a random choice is for the timeline only")
    if not 1 <= number <= len(candidates):
        raise ValueError(f"cannot choose {number} of {len(candidates)} {what}")
    draw = uniform(key.seed, Purpose.SELECTION, tick=key.entry, src=src, dst=dst)[..., 0]
    return sorted(candidates[np.argsort(draw)[:number]].tolist())


def _named(word: str, formation: Formation) -> frozenset[int]:
    everybody = range(1, formation.agents + 1)
    if word.removeprefix("-").isdecimal():
        if int(word) not in everybody:
            raise ValueError(f"agent {word} does not exist: agents are 1 to {formation.agents}")
        return frozenset({int(word)})
    leaders = frozenset(formation.leaders)
    return {"all": frozenset(everybody), "leaders": leaders, "followers": frozenset(everybody) - leaders}[word]
