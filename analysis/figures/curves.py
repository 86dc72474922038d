"""Figures like those of the papers: mean and one standard deviation over the runs, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.figures.axes import colours_of, finish, labels_of, titled
from analysis.metrics.consistency import DRAWN, band
from analysis.models.arrays import Array

mpl.rcParams.update(
    {"font.size": 8, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False, "text.parse_math": False}
)
_LOST, _FAR = 1.0, 100.0  # m²
_BAND = (
    "Lines: mean over the runs. Bands: one standard deviation of the runs; one that reaches 0 goes down to the edge."
)
_LEGEND = 1.4  # inches beside the panels


@dataclass(frozen=True)
class Curve:
    """The error of many runs of one case.

    Parameters
    ----------
    labels
        Of the case, by axis.
    seconds, error
        Moments, shape (T,), and the error in each, shape (R, T).
    overall
        What stands for each run over time, shape (R,).
    changes
        When the graph changes for good or for a time, in seconds.
    """

    labels: Mapping[str, str]
    seconds: Array
    error: Array
    overall: Array
    changes: Sequence[float] = ()


def curves(
    path: Path,
    title: str,
    cases: Sequence[Curve],
    axes: Sequence[str],
    quantity: str,
    bound: tuple[float, str] | None = None,
) -> None:
    """A quantity over time: a panel for each label of the first axis and each of the second, a curve for each of the third.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    cases, axes
        The curves, and the axes by which they are laid out.
    quantity
        What is drawn, with its unit.
    bound
        A dashed line, and what it says.
    """
    across, down, each = axes
    columns, rows = labels_of(cases, across), labels_of(cases, down)
    figure = Figure(figsize=(_LEGEND + 3.4 * len(columns), 2.2 * len(rows)), layout="constrained", dpi=160)
    panels = figure.subplots(len(rows), len(columns), sharex=True, sharey=True, squeeze=False)
    colours = colours_of(cases, each)
    for case in cases:
        panel = panels[rows.index(case.labels[down]), columns.index(case.labels[across])]
        _draw(panel, case, case.labels[each], colours[case.labels[each]])
        panel.set_title(f"{case.labels[across]}, {case.labels[down]}")
    if bound is not None:
        for panel in panels.ravel():
            panel.axhline(bound[0], color="black", ls="--", lw=0.8, label=bound[1])
    finish(figure, panels, title, "time (s)", quantity, each, _BAND)
    figure.savefig(path)


def consistency(
    path: Path, title: str, normalised: Mapping[str, Sequence[Curve]], axes: Sequence[str], dimension: int
) -> None:
    """Normalised errors and innovations over time: a row for each, a panel for each pair of labels of the first two axes.

    Their mean over the runs, of filters whose covariances tell the truth, lies in the grey band with 95 %: that of one edge in
    every run, and the more surely that of the mean over many.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    normalised
        The curves of each row, by what they are.
    axes
        By which panels and curves are laid out.
    dimension
        Of an error, D.
    """
    across, down, each = axes
    first = next(iter(normalised.values()))
    places = list(dict.fromkeys((case.labels[across], case.labels[down]) for case in first))
    figure = Figure(figsize=(_LEGEND + 3.4 * len(places), 2.2 * len(normalised)), layout="constrained", dpi=160)
    colours = colours_of(first, each)
    panels = figure.subplots(len(normalised), len(places), sharex=True, sharey=True, squeeze=False)
    for row, (what, cases) in zip(panels, normalised.items(), strict=True):
        for case in cases:
            panel = row[places.index((case.labels[across], case.labels[down]))]
            mean = case.error.mean(axis=0)
            shown, label = np.where(np.isfinite(mean), mean, np.nan), case.labels[each]
            panel.plot(case.seconds, shown, lw=0.8, label=label, color=colours[label])
            panel.set_title(f"{what}: {case.labels[across]}, {case.labels[down]}")
        for panel in row:
            panel.axhspan(*band(DRAWN, dimension, len(first[0].error)), color="grey", alpha=0.25, lw=0)
    finish(figure, panels, title, "time (s)", "mean", each)
    for panel in panels.ravel():
        panel.set_yscale("linear")
        panel.set_ylim(0.0, 3.0 * dimension)
    figure.savefig(path)


def evolution(path: Path, title: str, cases: Sequence[tuple[Mapping[str, str], Array, Array]]) -> None:
    """Where the agents of one run of each case believe they are, over time: a panel each, x in black, y in red, z in blue.

    A case is its labels, moments (T,), and places (T, N, D), in metres.
    """
    columns = min(len(cases), 3)
    rows = -(-len(cases) // columns)
    figure = Figure(figsize=(3.4 * columns, 2.2 * rows), layout="constrained", dpi=160)
    panels = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for panel, (labels, seconds, place) in zip(panels.ravel(), cases, strict=False):
        for axis, colour in zip(range(place.shape[-1]), ("black", "tab:red", "tab:blue"), strict=False):
            panel.plot(seconds, place[..., axis], color=colour, lw=0.6)
        panel.set_title(", ".join(labels.values()), fontsize=7)
    for panel in panels[-1]:
        panel.set_xlabel("time (s)")
    for panel in panels[:, 0]:
        panel.set_ylabel("estimated position (m)")
    titled(figure, title)
    figure.savefig(path)


def rates(path: Path, title: str, found: Array) -> None:
    """Convergence rates (n, 2) with the weighted centroid and with an anchor, a point for each graph."""
    figure = Figure(figsize=(3.4, 3.2), layout="constrained", dpi=160)
    panel = figure.subplots()
    panel.plot(found[:, 1], found[:, 0], ".", ms=2)
    panel.plot([found.min(), 1.0], [found.min(), 1.0], color="grey", lw=0.8)
    panel.set_xlabel("with an anchor")
    panel.set_ylabel("weighted centroid")
    titled(figure, f"{title}: convergence rates on {len(found)} random graphs", 7.0)
    figure.savefig(path)


def indicator(path: Path, title: str, seconds: Array, error: Array, corrected: Array, numbers: Sequence[int]) -> None:
    """Mean tracking error (R, T), and corrected indicators (T, F) of the followers with these numbers."""
    figure = Figure(figsize=(4.6, 3.0), layout="constrained", dpi=160)
    panel = figure.subplots()
    for place, number in enumerate(numbers):
        panel.plot(seconds, _positive(corrected[:, place]), lw=0.8, label=f"agent {number}")
    panel.plot(seconds, error.mean(axis=0), color="black", lw=1.2, label="tracking error")
    finish(figure, np.array([[panel]]), title, "time (s)", "m²", None)
    figure.savefig(path)


def settings(path: Path, title: str, cases: Sequence[Curve], axes: Sequence[str]) -> None:
    """Mean error over a grid: a panel for each label of the first axis, rows and columns for those of the second and third.

    A cell has a cross where the formation is lost for good: the mean over the runs is above 1 m² at the end.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    cases, axes
        The curves, and the axes of the grid.
    """
    across, down, each = axes
    panels, rows, columns = (labels_of(cases, axis) for axis in (across, down, each))
    size = (1.6 + 0.52 * len(columns) * len(panels), 1.3 + 0.26 * len(rows))
    figure = Figure(figsize=size, layout="constrained", dpi=160)
    for panel, label in zip(figure.subplots(1, len(panels), sharey=True, squeeze=False)[0], panels, strict=True):
        grid = np.full((len(rows), len(columns)), np.nan)
        for case in (one for one in cases if one.labels[across] == label):
            row, column = rows.index(case.labels[down]), columns.index(case.labels[each])
            grid[row, column] = _cell(panel, row, column, case)
        image = panel.imshow(np.log10(grid), cmap="RdYlGn_r", vmin=-3, vmax=2, aspect="auto")
        panel.set_xticks(range(len(columns)), columns, rotation=60, ha="right")
        panel.set_yticks(range(len(rows)), rows)
        panel.set_title(label)
        panel.grid(visible=False)
    titled(figure, title)
    figure.colorbar(image, label="mean tracking error (m²), power of ten")
    figure.savefig(path)


def _cell(panel: Axes, row: int, column: int, case: Curve) -> float:
    """Say the mean error of a case in its place, and how it ended."""
    mean = float(_finite(case.overall).mean())
    cross = " ×" if _finite(case.error)[:, -1].mean() > _LOST else ""
    said, colour = (f"{mean:.2g}{cross}", "black") if mean < _FAR else ("lost", "white")
    panel.text(column, row, said, ha="center", va="center", fontsize=6, color=colour)
    return mean


def _draw(panel: Axes, case: Curve, label: str, colour: str) -> None:
    error = _finite(case.error)
    mean, deviation = error.mean(axis=0), error.std(axis=0)
    panel.plot(case.seconds, mean, lw=1.0, label=label, color=colour)
    for second in case.changes:
        panel.axvline(second, color="black", ls=":", lw=0.6)
    panel.fill_between(case.seconds, mean - deviation, mean + deviation, color=colour, alpha=0.15, lw=0)


def _finite(values: Array) -> Array:
    """What can be drawn: a run that has diverged leaves at the top."""
    return np.nan_to_num(np.minimum(values, 1e12), nan=1e12)


def _positive(values: Array) -> Array:
    """What a logarithmic axis can show: nothing below zero."""
    shown: Array = np.where(values > 0.0, values, np.nan)
    return shown
