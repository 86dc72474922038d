"""What came of some runs over time, as curves over each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from analysis.figures.axes import logarithmic
from analysis.models.arrays import Array


@dataclass(frozen=True)
class Curve:
    """Of a run.

    Parameters
    ----------
    name
        What it is called.
    quantity
        What is drawn, with its unit; each of these has a panel.
    seconds, values
        Shape (T,).
    """

    name: str
    quantity: str
    seconds: Array
    values: Array


def draw(curves: Sequence[Curve], path: Path) -> None:
    """Draw them on logarithmic axes, one panel for each quantity."""
    quantities = list(dict.fromkeys(curve.quantity for curve in curves))
    figure = Figure(figsize=(7.0, 3.0 * len(quantities)), layout="constrained")
    for place, quantity in enumerate(quantities):
        panel = figure.add_subplot(len(quantities), 1, place + 1)
        for number, curve in enumerate(curves):
            if curve.quantity == quantity:
                positive = np.where(curve.values > 0.0, curve.values, np.nan)
                panel.plot(curve.seconds, positive, color=f"C{number % 10}", linewidth=1.0, label=curve.name)
        logarithmic(panel, "y")
        panel.set_xlabel("time (s)")
        panel.set_ylabel(quantity)
        panel.grid(visible=True, alpha=0.3)
        legend = panel.legend(frameon=False)
        for text in legend.get_texts():
            text.set_parse_math(False)
    figure.savefig(path, dpi=160)
