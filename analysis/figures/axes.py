"""Titles and notes that fit their figure, logarithmic axes with plain labels, and colours that are the same in every panel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Literal, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter
from numpy.typing import NDArray

_POINTS = 72.0  # to an inch
_WIDTH = 0.56  # of a letter in the mean, by its size
_FEWEST = 12
_SMALL = 6.5  # points
_ABOVE_AND_BELOW = 0.3  # inches


class Labelled(Protocol):
    """What is drawn of a case, with its labels by axis."""

    @property
    def labels(self) -> Mapping[str, str]:
        """By axis."""


class Plain(LogFormatter):
    """Labels of a logarithmic axis that are all written alike: 0.1, 1, 10."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        """That of a tick, or none."""
        return f"{x:g}" if super().__call__(x, pos) else ""


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
    ticks.set_major_formatter(Plain())
    ticks.set_minor_formatter(Plain(labelOnlyBase=False, minor_thresholds=(1.0, 0.4)))


def titled(figure: Figure, title: str, size: float = 9.6) -> None:
    """Write a title above a figure, in as many lines as its width asks for; the size is in points."""
    figure.suptitle(fill(title, _letters(figure.get_figwidth(), size)), fontsize=size)


def named_aside(figure: Figure, name: str, size: float = 8.0) -> None:
    """Write at its left what a figure's ordinates are, in as many lines as its height asks for."""
    figure.supylabel(fill(name, _letters(figure.get_figheight() - _ABOVE_AND_BELOW, size)), fontsize=size)


def finish(
    figure: Figure, panels: NDArray[np.object_], title: str, x: str, y: str, legend: str | None, note: str = ""
) -> None:
    """Have panels (rows, columns) say what they show, with one legend, on a logarithmic ordinate.

    Parameters
    ----------
    figure, panels, title
        What is drawn, and what stands above.
    x, y
        What the axes are.
    legend
        What its entries are labels of.
    note
        What stands below, small: what bars and bands are.
    """
    titled(figure, title)
    for panel in panels.ravel():
        logarithmic(panel, "y")
    for panel in panels[-1]:
        panel.set_xlabel(x)
    named_aside(figure, y)
    drawn = [panel.get_legend_handles_labels() for panel in panels.ravel()]
    named = {label: handle for handles, labels in drawn for handle, label in zip(handles, labels, strict=True)}
    figure.legend(named.values(), named.keys(), title=legend, fontsize=7, loc="outside right center")
    if note:
        figure.supxlabel(fill(note, _letters(figure.get_figwidth(), _SMALL)), fontsize=_SMALL, color="dimgrey")


def colours_of(cases: Sequence[Labelled], axis: str) -> dict[str, str]:
    """A colour for each label of an axis, the same in every panel."""
    return {label: f"C{number}" for number, label in enumerate(labels_of(cases, axis))}


def labels_of(cases: Sequence[Labelled], axis: str) -> list[str]:
    """The labels of an axis, in the order of the cases."""
    return list(dict.fromkeys(case.labels[axis] for case in cases))


def _letters(inches: float, size: float) -> int:
    """How many letters of a size fit into a length."""
    return max(_FEWEST, int(inches * _POINTS / (_WIDTH * size)))
