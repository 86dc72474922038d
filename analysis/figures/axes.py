"""Titles that fit their figure, and logarithmic axes with plain labels: titles may hold a dollar sign, which is no formula."""

from __future__ import annotations

from textwrap import fill
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

_POINTS = 72.0  # to an inch
_WIDTH = 0.56  # of a letter in the mean, by its size
_FEWEST = 12
_ABOVE_AND_BELOW = 0.3  # inches


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


def titled(figure: Figure, title: str, size: float = 9.6) -> None:
    """Write a title above a figure, in as many lines as its width asks for; the size is in points."""
    figure.suptitle(fill(title, _letters(figure.get_figwidth(), size)), fontsize=size)


def named_aside(figure: Figure, name: str, size: float = 8.0) -> None:
    """Write at its left what a figure's ordinates are, in as many lines as its height asks for."""
    figure.supylabel(fill(name, _letters(figure.get_figheight() - _ABOVE_AND_BELOW, size)), fontsize=size)


def _letters(inches: float, size: float) -> int:
    """How many letters of a size fit into a length."""
    return max(_FEWEST, int(inches * _POINTS / (_WIDTH * size)))
