"""Logarithmic axes whose labels are plain text: titles may hold a dollar sign, so that no text is taken for a formula."""

from __future__ import annotations

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatter


def logarithmic(panel: Axes, axis: Literal["x", "y"]) -> None:
    """Make an axis logarithmic.

    Parameters
    ----------
    panel, axis
        Which.
    """
    scale = {"x": panel.set_xscale, "y": panel.set_yscale}[axis]
    scale("log")
    ticks = {"x": panel.xaxis, "y": panel.yaxis}[axis]
    ticks.set_major_formatter(LogFormatter())
    ticks.set_minor_formatter(LogFormatter(labelOnlyBase=False, minor_thresholds=(1.0, 0.4)))
