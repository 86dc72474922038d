"""The house, drawn from its imports: docs/pictures/house.svg, and the linter's contracts in docs/architecture.md.

    python docs/draw_house.py

A room is a box on the lowest floor that is above all rooms it imports, an arrow the imports of one room by another, the wider
the more. Where rooms import each other in a circle there is no picture.
"""

from __future__ import annotations

import textwrap
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import log2
from pathlib import Path
from typing import Any

import grimp

DOCS = Path(__file__).parent
PICTURE = DOCS / "pictures" / "house.svg"
PAGE = DOCS / "architecture.md"
BEGIN, END = "<!-- contracts: written by docs/draw_house.py -->", "<!-- end of contracts -->"
ROWS = (("affinet",), ("agents", "world"), ("netem",), ("analysis",))

_BOX, _LINE, _GAP, _FLOOR, _MARGIN, _LETTER = 18, 13, 16, 46, 26, 6.1
_PASSING = 14  # width of an arrow that passes a floor
_COLOURS = {"affinet": "#4c72b0", "agents": "#c44e52", "world": "#55a868", "netem": "#8172b3", "analysis": "#937860"}

_WAYS = {True: "themselves", False: "by whatever way"}

Imports = Mapping[tuple[str, str], int]


class Circle(ValueError):
    """Rooms that import each other: which."""


@dataclass
class _Node:
    """A box, or an arrow that passes a floor, which has no text."""

    text: Sequence[str] = ()
    x: float = 0.0
    y: float = 0.0
    above: list[_Node] = field(default_factory=list)
    below: list[_Node] = field(default_factory=list)

    @property
    def width(self) -> float:
        return max((len(line) for line in self.text), default=0) * _LETTER + 16 if self.text else _PASSING

    @property
    def height(self) -> float:
        return _BOX + _LINE * (len(self.text) - 1) if self.text else 0.0


def imports() -> tuple[Imports, Imports]:
    """How many modules of one room import how many of another: within the packages, by room; and between the packages."""
    packages = [package for row in ROWS for package in row]
    graph = grimp.build_graph(*packages, cache_dir=None)
    within, between = Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    for importer in graph.modules:
        for imported in graph.find_modules_directly_imported_by(importer):
            one, other = (tuple(module.split(".")[:2]) for module in (importer, imported))
            if one[0] != other[0]:
                between[one[0], other[0]] += 1
            elif one != other:
                within[".".join(one), ".".join(other)] += 1
    return dict(sorted(within.items())), dict(sorted(between.items()))


def floors(rooms: Iterable[str], within: Imports) -> dict[str, int]:
    """The floor of each room, from 0 at the bottom: one above the highest it imports.

    Raises
    ------
    Circle
        When there is none.
    """
    found: dict[str, int] = {}
    waiting = {room: {below for above, below in within if above == room} for room in rooms}
    while waiting:
        ready = sorted(room for room, below in waiting.items() if below <= found.keys())
        if not ready:
            raise Circle(f"in a circle, or above one: {', '.join(sorted(waiting))}")
        for room in ready:
            found[room] = max((found[below] + 1 for below in waiting.pop(room)), default=0)
    return found


def drawn() -> str:
    """The picture, as SVG."""
    within, between = imports()
    panels = {package: _Panel(package, within) for row in ROWS for package in row}
    width = max(sum(panels[name].width + _MARGIN for name in row) for row in ROWS) + _MARGIN
    parts, top = list[str](), float(_MARGIN)
    for row in ROWS:
        left = (width - sum(panels[name].width + _MARGIN for name in row) + _MARGIN) / 2
        for name in row:
            parts += panels[name].at(left, top, between)
            left += panels[name].width + _MARGIN
        top += max(panels[name].height for name in row) + _MARGIN
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {top:.0f}" width="{width:.0f}" '
        f'height="{top:.0f}" font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="10">'
    )
    return "\n".join([head, '<rect width="100%" height="100%" fill="white"/>', *parts, "</svg>\n"])


def contracts() -> str:
    """The contracts of import-linter, as Markdown."""
    project = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))
    return "\n".join(_contract(each) for each in project["tool"]["importlinter"]["contracts"])


def with_contracts(page: str) -> str:
    """A page with the contracts between its two marks."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n\n{contracts()}\n\n{END}{after}"


def _contract(said: Mapping[str, Any]) -> str:
    within = f", within `{said['containers'][0]}`" if "containers" in said else ""
    if said["type"] == "layers":
        held = "; ".join(f"`{layer}`".replace(" | ", "`, `") for layer in said["layers"])
    else:
        modules, forbidden = (", ".join(said[key]) for key in ("source_modules", "forbidden_modules"))
        held = f"{modules} do not import {forbidden}, {_WAYS[said.get('allow_indirect_imports', False)]}"
    return textwrap.fill(
        f"- {said['name']}{within}: {held}.", width=120, subsequent_indent="  ", break_long_words=False
    )


class _Panel:
    """One package: its rooms on their floors, laid out so that arrows cross little."""

    def __init__(self, package: str, within: Imports) -> None:
        self.package = package
        own = {pair: count for pair, count in within.items() if pair[0].split(".")[0] == package}
        rooms = sorted({room for pair in own for room in pair})
        self._floor = floors(rooms, own)
        self._node = {room: _Node(_text(room, own)) for room in rooms}
        self._rows: list[list[_Node]] = [[] for _ in range(max(self._floor.values()) + 1)]
        for room in rooms:
            self._rows[self._floor[room]].append(self._node[room])
        self._ways = {pair: self._way(*pair) for pair in own}
        self._own = own
        self._order()
        self._place()

    def _way(self, above: str, below: str) -> list[_Node]:
        between = range(self._floor[above] - 1, self._floor[below], -1)
        passing = [_Node() for _ in between]
        for floor, node in zip(between, passing, strict=True):
            self._rows[floor].append(node)
        way = [self._node[above], *passing, self._node[below]]
        for one, other in pairwise(way):
            one.below.append(other)
            other.above.append(one)
        return way

    def _order(self) -> None:
        self._spread()
        for _ in range(24):
            for row in reversed(self._rows):
                row.sort(key=lambda node: _middle(node.above, node.x))
                self._spread()
            for row in self._rows:
                row.sort(key=lambda node: _middle(node.below, node.x))
                self._spread()

    def _spread(self) -> None:
        for row in self._rows:
            x = -(sum(node.width for node in row) + _GAP * (len(row) - 1)) / 2
            for node in row:
                node.x = x + node.width / 2
                x += node.width + _GAP

    def _place(self) -> None:
        left = min(node.x - node.width / 2 for row in self._rows for node in row) - _GAP
        right = max(node.x + node.width / 2 for row in self._rows for node in row) + _GAP
        self.width, y = right - left, 34.0
        for row in reversed(self._rows):
            height = max(node.height for node in row)
            for node in row:
                node.x, node.y = node.x - left, y + (height - node.height) / 2
            y += height + _FLOOR
        self.height = y - _FLOOR + _GAP

    def at(self, left: float, top: float, between: Imports) -> list[str]:
        """The panel with its upper left corner there, and what its package imports of others in its title."""
        colour = _COLOURS[self.package]
        others = " · ".join(f"{other} {count}" for (one, other), count in between.items() if one == self.package)
        title = self.package + (f"  →  {others}" if others else "")
        return [
            f'<g transform="translate({left:.0f} {top:.0f})">',
            f'<rect width="{self.width:.0f}" height="{self.height:.0f}" rx="8" fill="{colour}" fill-opacity="0.06" '
            f'stroke="{colour}"/>',
            f'<text x="12" y="20" font-size="13" font-weight="bold" fill="{colour}">{title}</text>',
            *(self._arrow(way, self._own[pair], colour) for pair, way in self._ways.items()),
            *(_box(node, colour) for node in self._node.values()),
            "</g>",
        ]

    @staticmethod
    def _arrow(way: Sequence[_Node], count: int, colour: str) -> str:
        first, last = way[0], way[-1]
        start, end = (first.x, first.y + first.height), (last.x, last.y - 6)
        points = [start, *((node.x, node.y) for node in way[1:-1]), end]
        curve = f"M{start[0]:.0f} {start[1]:.0f}"
        for (x, y), (to_x, to_y) in pairwise(points):
            middle = (y + to_y) / 2
            curve += f" C{x:.0f} {middle:.0f} {to_x:.0f} {middle:.0f} {to_x:.0f} {to_y:.0f}"
        tip = f"M{end[0] - 4:.0f} {end[1]:.0f}h8l-4 6z"
        width = 1 + log2(count) / 2
        return (
            f'<path d="{curve}" fill="none" stroke="{colour}" stroke-opacity="0.45" stroke-width="{width:.1f}"/>'
            f'<path d="{tip}" fill="{colour}"/>'
        )


def _middle(nodes: Sequence[_Node], otherwise: float) -> float:
    return sum(node.x for node in nodes) / len(nodes) if nodes else otherwise


def _text(room: str, own: Imports) -> list[str]:
    name = room.rpartition(".")[2]
    lines = [name if "." in room else "import affinet"]
    for (above, below), count in own.items():
        if above == room:
            said = f"{below.rpartition('.')[2]} {count}"
            if len(lines) > 1 and len(lines[-1]) + len(said) < 24:
                lines[-1] += f" · {said}"
            else:
                lines.append(said)
    return lines


def _box(node: _Node, colour: str) -> str:
    x, y = node.x - node.width / 2, node.y
    name, *counts = node.text
    return "".join(
        [
            f'<rect x="{x:.0f}" y="{y:.0f}" width="{node.width:.0f}" height="{node.height:.0f}" rx="3" fill="white" '
            f'stroke="{colour}"/>',
            f'<text x="{node.x:.0f}" y="{y + 13:.0f}" text-anchor="middle" font-weight="bold">{name}</text>',
            *(
                f'<text x="{node.x:.0f}" y="{y + 13 + _LINE * number:.0f}" text-anchor="middle" fill="#555">{line}</text>'
                for number, line in enumerate(counts, start=1)
            ),
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
    PAGE.write_text(with_contracts(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
