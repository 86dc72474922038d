"""Figures of agents that pursue a target, like those of paper 002: one run of each case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.figures.axes import logarithmic, titled
from analysis.models.arrays import Array

_ALONE, _TOGETHER, _TRUE = "0.65", "tab:blue", "black"
_ROOM = 0.6  # about what is agreed on, of its range


@dataclass(frozen=True)
class TargetRun:
    """One run.

    Parameters
    ----------
    labels
        Of its case.
    seconds
        Its moments, shape (T,).
    target
        Where the target was, shape (T, D), in metres.
    position
        Where the agents were, shape (T, N, D), in metres.
    places
        Where they steer for about the target, shape (N, D), in metres.
    found, reference
        Where each found the target by itself, and what it steered by, shape (T, N, D), in metres.
    """

    labels: Mapping[str, str]
    seconds: Array
    target: Array
    position: Array
    places: Array
    found: Array
    reference: Array


def pursued(path: Path, title: str, flights: Sequence[TargetRun]) -> None:
    """For each flight a row: the first coordinate, its error, the plane of the first two, and how far agents are behind.

    Figs. 2 and 3, 5 and 6 of paper 002.
    """
    figure = Figure(figsize=(13.6, 2.5 * len(flights)), layout="constrained", dpi=130)
    panels = figure.subplots(len(flights), 4, squeeze=False)
    for flight, (coordinate, error, plane, behind) in zip(flights, panels, strict=True):
        _coordinate(coordinate, flight)
        _error(error, flight)
        _plane(plane, flight)
        off = np.linalg.norm(flight.position - flight.reference - flight.places, axis=-1)
        behind.plot(flight.seconds, off, lw=0.6)
        logarithmic(behind, "y")
        _named(behind, "time (s)", "distance from the place steered for (m)")
        coordinate.set_title(", ".join(flight.labels.values()), fontsize=8)
    titled(figure, title)
    figure.savefig(path)


def agreement(path: Path, title: str, seconds: Array, fused: Array, known: Array) -> None:
    """What agents agree on, and the mean of what they know, with derivatives: a row for each derivative (paper 002, Fig. 4).

    Shapes (T, N, m + 1), of one number that they agree on; on the left the whole run, on the right its last tenth.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    seconds
        Of the ticks, shape (T,).
    fused, known
        What each agent agreed on, and what it knew by itself, shapes (T, N, m + 1).
    """
    rows = fused.shape[-1]
    figure = Figure(figsize=(9.0, 2.0 * rows), layout="constrained", dpi=130)
    mean, late = known.mean(axis=1), seconds >= 0.9 * seconds[-1]
    for derivative, (whole, end) in enumerate(figure.subplots(rows, 2, sharex="col", squeeze=False)):
        for panel, shown in ((whole, np.ones_like(late)), (end, late)):
            panel.plot(seconds[shown], fused[shown, :, derivative], lw=0.5)
            panel.plot(seconds[shown], mean[shown, derivative], color="red", lw=1.2)
            low, high = mean[shown, derivative].min(), mean[shown, derivative].max()
            if derivative == 0:  # agents may begin apart
                low, high = min(low, fused[shown, :, 0].min()), max(high, fused[shown, :, 0].max())
            room = _ROOM * (high - low)
            if room > 0.0:
                panel.set_ylim(low - room, high + room)
        whole.set_ylabel(f"derivative {derivative}" if derivative else "information")
        if derivative == rows - 1:
            for panel in (whole, end):
                panel.set_xlabel("time (s)")
    titled(figure, f"{title}: first number of the information vector, agents thin, mean of what they know red", 8.0)
    figure.savefig(path)


def _coordinate(panel: Axes, flight: TargetRun) -> None:
    panel.plot(flight.seconds, flight.found[..., 0], color=_ALONE, lw=0.4)
    panel.plot(flight.seconds, flight.reference[:, 0, 0], color=_TOGETHER, lw=0.9, label="steered by")
    panel.plot(flight.seconds, flight.target[:, 0], color=_TRUE, lw=0.9, label="target")
    _named(panel, "time (s)", "x (m)")
    panel.legend(fontsize=6)


def _error(panel: Axes, flight: TargetRun) -> None:
    for said, values, colour, width in (
        ("alone", flight.found, _ALONE, 0.4),
        ("steered by", flight.reference, _TOGETHER, 0.7),
    ):
        off = values[..., 0] - flight.target[:, None, 0]
        lines = panel.plot(flight.seconds, off, color=colour, lw=width)
        lines[0].set_label(f"{said}, RMS {np.sqrt((off**2).mean(axis=0)).mean():.2f} m")
    _named(panel, "time (s)", "error of x (m)")
    panel.legend(fontsize=6)


def _plane(panel: Axes, flight: TargetRun) -> None:
    panel.plot(*flight.position.transpose(2, 0, 1)[:2], lw=0.5)
    panel.plot(*flight.position[-1].T[:2], "o", ms=2.5, color="0.3")
    panel.plot(*flight.reference[:, 0].T[:2], color=_TOGETHER, lw=0.9)
    panel.plot(*flight.target.T[:2], color=_TRUE, lw=0.9)
    _named(panel, "x (m)", "y (m)")
    panel.set_aspect("equal", "datalim")


def _named(panel: Axes, x: str, y: str) -> None:
    panel.set_xlabel(x, fontsize=7)
    panel.set_ylabel(y, fontsize=7)
