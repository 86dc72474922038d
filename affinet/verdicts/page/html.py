"""A page of HTML in one file: its parts, with all text of a user's escaped."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from typing import Any

import numpy as np

from affinet.verdicts.page import ticks
from analysis.models.arrays import Array

_WIDE, _HIGH = 1000.0, 200.0  # of what is drawn, which is stretched to the width of the page
_FLOOR = 1e-15


def document(title: str, body: Iterable[str], data: Any = None) -> str:
    """A whole page; `data` is what its script draws, if it has a scene."""
    script = "" if data is None else f"{_data(data)}<script>{_own('scene.js')}</script>"
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{_own('page.css')}</style></head>"
        f"<body>{''.join(body)}{script}</body></html>\n"
    )


def section(title: str, *parts: str) -> str:
    """A part of the page under a heading."""
    return f"<section><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def folded(title: str, *parts: str) -> str:
    """A part of the page that opens when it is asked for."""
    return f"<details><summary><h2>{escape(title)}</h2></summary>{''.join(parts)}</details>"


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Rows of text; the first of each says what it is of. Without a head they are facts, whose text wraps."""
    top = f"<tr>{''.join(f'<th>{escape(one)}</th>' for one in head)}</tr>" if head else ""
    body = "".join(
        f"<tr><th>{escape(first)}</th>{''.join(f'<td>{escape(one)}</td>' for one in rest)}</tr>"
        for first, *rest in rows
    )
    kind = "" if head else ' class="facts"'
    return f'<div class="wide"><table{kind}>{top}{body}</table></div>'


def key(named: Iterable[tuple[str, str]]) -> str:
    """What colours stand for."""
    entries = (f'<span><i style="background:{colour}"></i>{escape(name)}</span>' for name, colour in named)
    return f'<div class="key">{"".join(entries)}</div>'


def text(says: str) -> str:
    """Lines as they stand."""
    return f"<pre>{escape(says)}</pre>"


def curves(caption: str, seconds: Array, named: Sequence[tuple[str, str, Array]], *, logarithmic: bool = False) -> str:
    """Curves over time, each with its name and colour, shape (T,), and a line at the moment that the scene shows."""
    shown = [(name, colour, _decades(values) if logarithmic else values) for name, colour, values in named]
    there = np.concatenate([values[np.isfinite(values)] for _, _, values in shown])
    if not len(there):
        return ""
    low, high = float(there.min()), float(there.max())
    low, high = (low, high) if high > low else (low - 1.0, high + 1.0)
    last = max(float(seconds[-1]), 1e-9)
    lines = []
    for _, colour, values in shown:
        finite = np.isfinite(values)
        points = zip(_WIDE * seconds[finite] / last, _HIGH * (high - values[finite]) / (high - low), strict=True)
        drawn = " ".join(f"{a:.1f},{b:.1f}" for a, b in points)
        lines.append(f'<polyline points="{drawn}" fill="none" stroke="{colour}" stroke-width="1.3"/>')
    upright = ticks.decades(low, high) if logarithmic else ticks.of(low, high)
    grid = "".join(f"M0,{_HIGH * (high - at) / (high - low):.1f}H{_WIDE:g}" for at, _ in upright)
    words = [
        f'<span class="y" style="bottom:{100.0 * (at - low) / (high - low):.2f}%">{says}</span>' for at, says in upright
    ]
    words += [
        f'<span class="x" style="left:{100.0 * at / last:.2f}%">{says}</span>' for at, says in ticks.of(0.0, last)
    ]
    cursor = f'<line class="cursor" data-span="0 {_WIDE:g}" x1="0" x2="0" y1="0" y2="{_HIGH:g}"/>'
    svg = (
        f'<svg viewBox="0 0 {_WIDE:g} {_HIGH:g}" preserveAspectRatio="none"><path class="grid" d="{grid}"/>'
        f'<path class="axis" d="M0,0V{_HIGH:g}H{_WIDE:g}"/>{"".join(lines)}{cursor}</svg>'
    )
    says = f"{caption}, on a logarithmic axis, over time (s)" if logarithmic else f"{caption}, over time (s)"
    named_colours = key([(name, colour) for name, colour, _ in named]) if len(named) > 1 else ""
    return (
        f"<figure><figcaption>{escape(says)}</figcaption>"
        f'<div class="chart">{svg}{"".join(words)}</div>{named_colours}</figure>'
    )


def _decades(values: Array) -> Array:
    shown: Array = np.where(values > _FLOOR, np.log10(np.maximum(values, _FLOOR)), np.nan)
    return shown


def _data(data: Any) -> str:
    said = json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")  # no text of a user's ends the element
    return f'<script type="application/json" id="flight">{said}</script>'


def _own(name: str) -> str:
    return resources.files("affinet.verdicts.page").joinpath(name).read_text(encoding="utf-8")
