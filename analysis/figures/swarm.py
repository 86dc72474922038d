"""Pictures of a swarm that flies: one moment, or many as a film."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle
from matplotlib.patheffects import withStroke
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from numpy.typing import NDArray

from analysis.figures.axes import logarithmic
from analysis.models.arrays import Array, Integers, Mask

_TRAIL_S = 8.0
_MOST_NUMBERS = 60  # agents, above which their numbers hide them
_STYLE: dict[Any, Any] = {"font.size": 8, "axes.grid": False, "text.parse_math": False}
_LEADER, _FOLLOWER, _FAINT, _WALL, _JAMMED = "#c98a00", "#2f7fc1", "#b4b4bc", "#8d8172", "#f2d024"
_MARGIN = 0.4  # of what is shown, about a formation at its largest
_WIDE = 1.45  # times as high, in a plane


class NoFilm(RuntimeError):
    """A film cannot be made: why, and what would help."""


@dataclass(frozen=True)
class Flight:
    """What is drawn of a run.

    Parameters
    ----------
    title
        Above it.
    seconds
        Of the ticks, shape (T,).
    position, target
        Of the agents, shape (T, N, D), in metres.
    leaders
        Shape (N,).
    edges
        Of the nominal graph, rows of agents from 0, shape (E, 2).
    heard
        Who is heard by whom, rows of agents from 0, shape (L, 2).
    verdicts
        What became of what, as rows of `colours`, shape (T, L).
    colours
        Of each verdict its name and colour; of one without a name nothing is said.
    error
        The quantity below, shape (T,), and what it is called.
    quantity
        Its name, with its unit.
    walls, zones
        Lines through points, and where it is jammed: centre and radius, in metres.
    """

    title: str
    seconds: Array
    position: Array
    target: Array
    leaders: Mask
    edges: Integers
    heard: Integers
    verdicts: NDArray[np.uint8]
    colours: Sequence[tuple[str, str]]
    error: Array
    quantity: str
    walls: Sequence[Array]
    zones: Sequence[tuple[Array, float]]


class Picture:
    """A figure of some flights beside each other, at one moment of all.

    Parameters
    ----------
    flights
        What is drawn.
    """

    def __init__(self, flights: Sequence[Flight]) -> None:
        with mpl.rc_context(_STYLE):
            self.figure = Figure(figsize=(4.6 * len(flights) + 0.6, 4.6), layout="constrained")
            grid = self.figure.add_gridspec(2, len(flights), height_ratios=[3, 1])
            self._panels = [_Panel(self.figure, grid[0, column], flight) for column, flight in enumerate(flights)]
            below = None
            for column, flight in enumerate(flights):
                below = self.figure.add_subplot(grid[1, column], sharey=below)
                self._panels[column].curve(below, flight)
            self._name_colours(flights)

    def show(self, seconds: float) -> None:
        """Draw this moment."""
        for panel in self._panels:
            panel.show(seconds)

    def _name_colours(self, flights: Sequence[Flight]) -> None:
        shown = {flight.colours[code] for flight in flights for code in np.unique(flight.verdicts).tolist()}
        named = [(name, colour) for name, colour in flights[0].colours if (name, colour) in shown and name]
        handles = [Line2D([], [], color=colour, label=name) for name, colour in named]
        self.figure.legend(handles=handles, loc="outside lower center", ncols=max(1, len(handles)), frameon=False)


class _Panel:
    def __init__(self, figure: Figure, place: Any, flight: Flight) -> None:
        self._flight = flight
        self._flat = flight.position.shape[-1] == 2
        axes: Any = figure.add_subplot(place, **({} if self._flat else {"projection": "3d"}))
        self._axes = axes
        axes.set_title(flight.title, fontsize=8)
        lines: Any = LineCollection if self._flat else Line3DCollection
        for wall in flight.walls:
            axes.plot(*wall.T, color=_WALL, linewidth=1.5)
        for centre, radius in flight.zones if self._flat else ():
            axes.add_patch(Circle(tuple(centre), radius, color=_JAMMED, alpha=0.25, linewidth=0))
        empty = np.zeros((0, 2, flight.position.shape[-1]))
        self._wanted, self._graph, self._trails = (
            axes.add_collection(lines(empty, linewidths=width)) for width in (0.7, 1.2, 0.6)
        )
        self._wanted.set_color(_FAINT)
        kinds = [_LEADER if leader else _FOLLOWER for leader in flight.leaders.tolist()]
        self._trails.set_color(kinds)
        solid = {} if self._flat else {"depthshade": False}
        self._agents = axes.scatter(*flight.position[0].T, c=kinds, s=18, zorder=3, **solid)
        self._numbers = [self._number(agent + 1) for agent in range(len(kinds))] if len(kinds) <= _MOST_NUMBERS else []
        for axis in "xy" if self._flat else "xyz":
            getattr(axes, f"set_{axis}label")(f"{axis} (m)")
        if self._flat:
            axes.set_aspect("equal", adjustable="box")
        self._cursor: Any = None
        extent = np.ptp(flight.target, axis=1).max(axis=0)
        self._reach = (1.0 + _MARGIN) / 2.0 * float(max(extent[0] / _WIDE, extent[1]) if self._flat else extent.max())

    def _number(self, agent: int) -> Any:
        """The number of an agent, beside it; beyond the panel there is none."""
        look: Any = {"fontsize": 7, "zorder": 4, "path_effects": [withStroke(linewidth=1.5, foreground="white")]}
        if self._flat:
            beside = {"xytext": (3.0, 3.0), "textcoords": "offset points", "annotation_clip": True}
            return self._axes.annotate(f"{agent}", (0.0, 0.0), **beside, **look)
        return self._axes.text(0.0, 0.0, 0.0, f"  {agent}", axlim_clip=True, **look)

    def curve(self, axes: Any, flight: Flight) -> None:
        """The quantity over time, with a line at the moment that is shown."""
        positive = np.where(flight.error > 0.0, flight.error, np.nan)
        axes.plot(flight.seconds, positive, color=_FOLLOWER, linewidth=0.8)
        logarithmic(axes, "y")
        axes.set_xlabel("s")
        axes.set_ylabel(flight.quantity)
        axes.grid(visible=True, alpha=0.3)
        self._cursor = axes.axvline(flight.seconds[0], color="black", linewidth=0.8)

    def show(self, seconds: float) -> None:
        """Draw this moment, about the formation that is wanted."""
        flight = self._flight
        tick = min(int(np.searchsorted(flight.seconds, seconds - 1e-9)), len(flight.seconds) - 1)
        position, target = flight.position[tick], flight.target[tick]
        before = int(np.searchsorted(flight.seconds, flight.seconds[tick] - _TRAIL_S))
        sender, receiver = position[flight.heard[:, 0]], position[flight.heard[:, 1]]
        self._wanted.set_segments(target[flight.edges])
        self._graph.set_segments(np.stack([(sender + receiver) / 2.0, receiver], axis=1))
        self._graph.set_color([flight.colours[code][1] for code in flight.verdicts[tick].tolist()])
        self._trails.set_segments(list(np.swapaxes(flight.position[before : tick + 1], 0, 1)))
        if self._flat:
            self._agents.set_offsets(position)
        else:
            self._agents._offsets3d = tuple(position.T)
        for number, place in zip(self._numbers, position, strict=False):
            number.set_visible(bool(np.isfinite(place).all()))
            if self._flat:
                number.xy = place
            else:
                number.set_position_3d(place)
        self._look_at(target)
        self._cursor.set_xdata([flight.seconds[tick]] * 2)

    def _look_at(self, target: Array) -> None:
        middle = (target.max(axis=0) + target.min(axis=0)) / 2.0
        for axis, centre in zip("xyz", middle.tolist(), strict=False):
            reach = self._reach * (_WIDE if self._flat and axis == "x" else 1.0)
            getattr(self._axes, f"set_{axis}lim")(centre - reach, centre + reach)


def still(flights: Sequence[Flight], seconds: float, file: Path | IO[bytes]) -> None:
    """One moment, as an image or a page, by the ending of the file's name; PNG where it has none."""
    picture = Picture(flights)
    picture.show(seconds)
    with mpl.rc_context(_STYLE):
        picture.figure.savefig(file, dpi=160)


def film(flights: Sequence[Flight], moments: Array, frames_per_s: int, path: Path) -> Iterator[int]:
    """Many moments as .mp4 or .gif; yields the number of each frame once it is drawn.

    Parameters
    ----------
    flights
        What is drawn.
    moments
        In seconds, shape (F,).
    frames_per_s
        How many are shown in a second.
    path
        The file.

    Raises
    ------
    NoFilm
        When there is nothing to write it with.
    """
    writer: AbstractMovieWriter
    if path.suffix == ".gif":
        writer = PillowWriter(fps=frames_per_s)
    elif FFMpegWriter.isAvailable():
        writer = FFMpegWriter(fps=frames_per_s, codec="h264", extra_args=["-pix_fmt", "yuv420p"])
    else:
        raise NoFilm(f"{path}: there is no ffmpeg on the path to write it with: install it, or write a .gif")
    picture = Picture(flights)
    picture.show(float(moments[0]))
    picture.figure.draw_without_rendering()
    picture.figure.set_layout_engine("none")  # laid out once, not for each frame
    with mpl.rc_context(_STYLE), writer.saving(picture.figure, str(path), dpi=100):
        for number, moment in enumerate(moments.tolist()):
            picture.show(moment)
            writer.grab_frame()
            yield number
