"""Where agents go, and what one of them flies, like Figs. 3.4, 4.11 and 6.1 of paper 004: one run of each case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis.figures.axes import titled
from analysis.models.arrays import Array, Integers

_AXES = "xyz"


@dataclass(frozen=True)
class Flight:
    """One run.

    Parameters
    ----------
    labels
        Of its case.
    seconds
        Its moments, shape (T,).
    position
        Where the agents were, shape (T, N, D), in metres.
    input
        What they flew, shape (T, N, D), in metres per second or per second squared.
    edges
        Who sees whom, by their places in `position`, shape (L, 2).
    shown
        The place in `position` of the agent whose input is drawn.
    """

    labels: Mapping[str, str]
    seconds: Array
    position: Array
    input: Array
    edges: Integers
    shown: int


def paths(path: Path, title: str, flights: Sequence[Flight]) -> None:
    """For each flight a column: the paths in the plane of the first two axes with the last formation, and one agent's input.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    flights
        What is drawn.
    """
    size = (2.7 * len(flights), 5.0)
    figure = Figure(figsize=size, layout="constrained", dpi=130)
    planes, inputs = figure.subplots(2, len(flights), sharex="row", sharey="row", squeeze=False)
    for flight, plane, flown in zip(flights, planes, inputs, strict=True):
        _plane(plane, flight)
        plane.set_title(", ".join(flight.labels.values()), fontsize=7)
        for name, axis in zip(_AXES, flight.input[:, flight.shown].T, strict=False):
            flown.plot(flight.seconds, axis, lw=0.5, label=name)
        flown.set_title(f"agent {flight.shown + 1}", fontsize=7)
        flown.set_xlabel("time (s)")
    planes[0].set_ylabel("y (m)")
    inputs[0].set_ylabel("input (m/s, or m/s²)")
    inputs[0].legend(fontsize=6)
    titled(figure, title)
    figure.savefig(path)


def _plane(panel: Axes, flight: Flight) -> None:
    flown, last = flight.position[..., :2], flight.position[-1, :, :2]
    panel.plot(*last[flight.edges].transpose(2, 1, 0), color="0.8", lw=0.5, zorder=1)
    panel.plot(*flown.transpose(2, 0, 1), lw=0.5)
    panel.plot(*last.T, "o", ms=2.5, color="0.2")
    panel.set_xlabel("x (m)")
    panel.set_aspect("equal", "box")
    panel.tick_params(labelsize=6)
    panel.margins(0.05)
