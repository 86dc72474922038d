"""Words for links: "2->4" one way, "2-4" both ways, roles in place of agents ("leaders->followers"), "leaders", "all"."""

from __future__ import annotations

import re
from collections.abc import Sequence

from netem.links import Links
from world.formation import Formation

_AGENT = r"\d+|leaders|followers|all"
_PAIR = re.compile(rf"({_AGENT})(->|-)({_AGENT})")
_SAY = "write '2->4' for what 4 hears of 2, '2-4' for both ways, 'leaders->followers', 'leaders' or 'all'"


def check(selector: str) -> str:
    """The selector itself, if it is one.

    Raises
    ------
    ValueError
        When it is not.
    """
    if not _PAIR.fullmatch(selector) and not re.fullmatch(_AGENT, selector):
        raise ValueError(f"{selector!r} selects no links; {_SAY}")
    return selector


def edge(text: str) -> tuple[int, int]:
    """The agents of an undirected edge "2-4".

    Raises
    ------
    ValueError
        When it is none.
    """
    if not (match := re.fullmatch(r"(\d+)-(\d+)", text)):
        raise ValueError(f"{text!r} is no edge; the edges of a formation have no direction: write '2-4'")
    return int(match[1]), int(match[2])


def rows(selector: str, formation: Formation, links: Links) -> list[int]:
    """Rows of the links that a selector names, in the order of the links.

    An agent or a role alone names all links from it and to it.

    Raises
    ------
    ValueError
        When it is no selector, names agents that do not exist, or matches no link.
    """
    check(selector)
    if match := _PAIR.fullmatch(selector):
        ways = [(match[1], match[3])] if match[2] == "->" else [(match[1], match[3]), (match[3], match[1])]
    else:
        ways = [(selector, "all"), ("all", selector)]
    ends = [(_agents(src, formation), _agents(dst, formation)) for src, dst in ways]
    found = [
        row
        for (src, dst), row in links.index.items()
        if any(src in sources and dst in receivers for sources, receivers in ends)
    ]
    if not found:
        raise ValueError(f"{selector!r} matches no link of the formation")
    return found


def pairs(selectors: Sequence[str], formation: Formation, links: Links) -> tuple[tuple[int, int], ...]:
    """The directed links (src, dst) that any of the selectors names, each once.

    Raises
    ------
    ValueError
        As `rows` does.
    """
    chosen = dict.fromkeys(row for selector in selectors for row in rows(selector, formation, links))
    return tuple((int(links.src[row]), int(links.dst[row])) for row in chosen)


def _agents(word: str, formation: Formation) -> frozenset[int]:
    everybody = range(1, formation.agents + 1)
    if word.isdecimal():
        if int(word) not in everybody:
            raise ValueError(f"agent {word} does not exist: agents are 1 to {formation.agents}")
        return frozenset({int(word)})
    leaders = frozenset(formation.leaders)
    return {"all": frozenset(everybody), "leaders": leaders, "followers": frozenset(everybody) - leaders}[word]
