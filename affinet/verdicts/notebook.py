"""A run in a notebook: its figures as a table, the paths of its agents and its error as drawings; no script."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from affinet.verdicts import told
from affinet.verdicts.evidence import Evidence
from analysis.models.arrays import Array

_COLOURS = {"pass": "#1a7f37", "fail": "#cf222e", "vacuous": "#9a6700"}
_LEADER, _FOLLOWER, _ERROR = "#d4a017", "#3b76c4", "#555555"
_WIDE, _HIGH, _MARGIN = 320.0, 200.0, 8.0
_MOST_POINTS = 200
_FLOOR = 1e-12  # of an error on a logarithmic axis


def html(run: Evidence) -> str:
    """A table of its figures, and two drawings beside it."""
    verdict = run.outcome.verdict.partition(",")[0]
    rows = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th><td style="text-align:left">{escape(says)}</td></tr>'
        for name, says in told.rows(run)
    )
    head = f'<b style="color:{_COLOURS[verdict]}">{escape(told.title(run))}</b>'
    drawings = "".join(
        f'<figure style="margin:4px"><figcaption>{caption}</figcaption>{drawing}</figure>'
        for caption, drawing in (
            ("paths, m", _paths(run)),
            (f"tracking error, m², logarithmic, over {run.ticks * run.dt:g} s", _error(run)),
        )
        if drawing
    )
    return (
        f'<div>{head}<div style="display:flex;flex-wrap:wrap;align-items:flex-start">'
        f"<table>{rows}</table>{drawings}</div></div>"
    )


def _paths(run: Evidence) -> str:
    """Where the agents flew, seen from above."""
    places = _thinned(run.position[..., :2])
    there = places[np.isfinite(places).all(axis=-1)]
    if not len(there):
        return ""
    corner, span = there.min(axis=0), np.ptp(there, axis=0)
    scale = min((_WIDE - 2 * _MARGIN) / max(span[0], 1e-9), (_HIGH - 2 * _MARGIN) / max(span[1], 1e-9))
    seen = (places - corner) * scale + _MARGIN
    lines = []
    for number, leads in enumerate(run.plan.world.formation.is_leader.tolist()):
        colour = _LEADER if leads else _FOLLOWER
        path = _upright(seen[:, number])
        lines.append(_line(path, colour))
        if len(path):
            x, y = path[-1]
            lines.append(
                f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{colour}"><title>agent {number + 1}</title></circle>'
            )
    return _drawing(lines)


def _error(run: Evidence) -> str:
    error = _thinned(run.error)
    there = np.isfinite(error)
    if not there.any():
        return ""
    height = np.log10(np.maximum(error[there], _FLOOR))
    low, high = float(height.min()), float(height.max())
    x = np.flatnonzero(there) / max(len(error) - 1, 1) * (_WIDE - 2 * _MARGIN) + _MARGIN
    y = (height - low) / max(high - low, 1e-9) * (_HIGH - 2 * _MARGIN) + _MARGIN
    words = [_word(_MARGIN, 12.0, f"{10.0**high:.2g}"), _word(_MARGIN, _HIGH - 2.0, f"{10.0**low:.2g}")]
    return _drawing([_line(_upright(np.column_stack([x, y])), _ERROR), *words])


def _thinned(values: Array) -> Array:
    """Some of the ticks, the last among them."""
    return values[
        np.unique(np.linspace(0, max(len(values) - 1, 0), _MOST_POINTS).round().astype(np.int64))[: len(values)]
    ]


def _upright(points: Array) -> Array:
    """Points with y upward as those of a drawing, whose y goes down; without those that are nowhere."""
    turned = np.column_stack([points[:, 0], _HIGH - points[:, 1]])
    return turned[np.isfinite(turned).all(axis=-1)]


def _line(points: Array, colour: str) -> str:
    said = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{said}" fill="none" stroke="{colour}" stroke-width="1.2"/>'


def _word(x: float, y: float, says: str) -> str:
    return f'<text x="{x:.0f}" y="{y:.0f}" font-size="10" fill="{_ERROR}">{escape(says)}</text>'


def _drawing(parts: Sequence[str]) -> str:
    frame = f'<rect width="{_WIDE:g}" height="{_HIGH:g}" fill="none" stroke="#cccccc"/>'
    size = f'width="{_WIDE:g}" height="{_HIGH:g}" viewBox="0 0 {_WIDE:g} {_HIGH:g}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{frame}{"".join(parts)}</svg>'
