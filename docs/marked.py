"""Markdown: pages that scripts write."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from textwrap import fill

from affinet.reference.entries import Parameter
from affinet.scenario.words import shown

Lines = Iterator[str]
LONGEST = 200  # characters of a default
_WIDTH = 120


def titled(title: str, *says: str) -> Lines:
    """The head of a page that a script writes."""
    yield from (f"# {title}", "", *says)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Lines:
    """A table; columns in which nothing stands are left out."""
    cells = [[_in_a_cell(one) for one in row] for row in rows]
    used = [number for number in range(len(head)) if any(row[number] for row in cells)]
    for row in (head, ["---"] * len(head), *cells):
        yield "| " + " | ".join(row[number] for number in used) + " |"


def parameters(those: Iterable[Parameter]) -> Lines:
    """A table of parameters, or keys."""
    return table(("name", "values", "unit", "default", "what"), map(_row, those))


def _row(one: Parameter) -> Sequence[str]:
    values = ", ".join(map(code, one.kind.split(" | "))) if " | " in one.kind else one.kind
    return code(one.name), values, one.unit, _default(one), one.says


def _default(one: Parameter) -> str:
    if one.required:
        return "**required**"
    return "" if one.default in (None, [], {}, "") or one.kind == "table" else code(shown(one.default, LONGEST))


def filled(text: str) -> str:
    """Prose, in lines as long as those of a page."""
    return fill(text, _WIDTH, break_on_hyphens=False, break_long_words=False)


def code(text: str) -> str:
    """Text as it is typed."""
    return f"`{text}`" if text else ""


def _in_a_cell(text: str) -> str:
    return " ".join(text.split()).replace("|", r"\|")
