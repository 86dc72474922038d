"""The means of many cases along an axis of numbers, each with its confidence interval."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.claims.intervals import CONFIDENCE
from analysis.figures.axes import colours_of, finish, labels_of, logarithmic

_DECADES = 30.0  # labels that reach farther stand on a logarithmic axis
_LEGEND = 1.4  # inches beside the panels
_BARS = f"Bars: {100 * CONFIDENCE:g} % interval of the mean over the runs (Student's t)"
_DOWN = "; one that reaches 0 goes down to the edge"
_LOST = "; × at the top: no number, as runs diverged"


class Mean(NamedTuple):
    """The mean over the runs of a case, and the ends of its interval; NaN is none.

    Parameters
    ----------
    labels
        Of the case, by axis.
    found, low, high
        The mean, and the ends.
    """

    labels: Mapping[str, str]
    found: float
    low: float
    high: float


def sweep(
    path: Path,
    title: str,
    cases: Sequence[Mean],
    axes: Sequence[str],
    along: str,
    quantity: str,
    bound: tuple[float, str] | None = None,
) -> None:
    """A quantity over one axis: a panel for each label of the first other axis, a curve for each of the second.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    cases, axes, along
        The means, the axes by which they are laid out, and the one of numbers.
    quantity
        What is drawn, with its unit.
    bound
        A dashed line, and what it says.
    """
    across, each = [name for name in axes if name != along]
    columns = labels_of(cases, across)
    figure = Figure(figsize=(_LEGEND + 3.0 * len(columns), 3.0), layout="constrained", dpi=160)
    panels = figure.subplots(1, len(columns), sharey=True, squeeze=False)
    colours = colours_of(cases, each)
    for panel, column in zip(panels[0], columns, strict=True):
        for label in labels_of(cases, each):
            chosen = [one for one in cases if one.labels[across] == column and one.labels[each] == label]
            _draw(panel, chosen, along, label, colours[label])
        panel.set_title(column)
    numbers = [float(label) for label in labels_of(cases, along)]
    for panel in panels[0]:
        if min(numbers) > 0.0 and max(numbers) > _DECADES * min(numbers):
            logarithmic(panel, "x")
        if bound is not None:
            panel.axhline(bound[0], color="black", ls="--", lw=0.8, label=bound[1])
    finish(figure, panels, title, along, quantity, each, _note(cases))
    figure.savefig(path)


def _draw(panel: Axes, cases: Sequence[Mean], along: str, label: str, colour: str) -> None:
    if not cases:
        return
    where = np.array([float(one.labels[along]) for one in cases])
    found, low, high = (np.array([getattr(one, name) for one in cases]) for name in ("found", "low", "high"))
    panel.errorbar(where, found, (found - low, high - found), label=label, color=colour, marker="o", ms=3, capsize=2)
    if (lost := np.isnan(found)).any():
        panel.plot(where[lost], np.full(lost.sum(), 0.97), "x", color=colour, transform=panel.get_xaxis_transform())


def _note(cases: Sequence[Mean]) -> str:
    """What its bars are, as far as there are some."""
    bars = _BARS + _DOWN * any(one.low <= 0.0 for one in cases)
    said = bars if any(np.isfinite(one.low) for one in cases) else "One run of each case: no interval"
    return said + _LOST * any(np.isnan(one.found) for one in cases) + "."
