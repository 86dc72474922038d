"""The frontier of what breaks: which share of the runs does, over a grid of outages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from analysis.figures.axes import titled
from analysis.models.arrays import Array, Mask

mpl.rcParams.update({"font.size": 8, "text.parse_math": False})
_HALF = 0.5
_DARK = 60.0  # %, from which on a cell is too dark for black letters


def frontier(
    path: Path,
    title: str,
    links: Sequence[int],
    seconds: Sequence[float],
    panels: Sequence[tuple[str, Array]],
) -> None:
    """A panel for each invariant: a cell for so many links and seconds, with the share that breaks it and its interval.

    A line goes around the cells of which half of the runs or more break it.

    Parameters
    ----------
    path, title
        The file to draw, and what stands above.
    links, seconds
        Of rows and columns.
    panels
        The invariants, with share, lower and upper end of each cell, shape (3, links, seconds); NaN where nothing was told.
    """
    size = (1.4 + 0.62 * len(seconds) * len(panels), 1.3 + 0.36 * len(links))
    figure = Figure(figsize=size, layout="constrained", dpi=160)
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    for panel, (name, shares) in zip(axes, panels, strict=True):
        image = panel.imshow(shares[0], cmap="Reds", vmin=0.0, vmax=1.0, aspect="auto", origin="lower")
        _cells(panel, shares)
        panel.add_collection(LineCollection(_border(shares[0] >= _HALF), colors="black", linewidths=1.6))
        panel.set_xticks(range(len(seconds)), [f"{one:g}" for one in seconds])
        panel.set_yticks(range(len(links)), [str(one) for one in links])
        panel.set_xlabel("for how long (s)")
        panel.set_title(f"{name}; beyond the line half of the runs or more break it", fontsize=7)
    axes[0].set_ylabel("how many links, one way each")
    titled(figure, title)
    figure.colorbar(image, label="share of the runs that break it")
    figure.savefig(path)


def _cells(panel: Axes, shares: Array) -> None:
    for row, column in np.ndindex(*shares.shape[1:]):
        share, low, high = (100.0 * shares[:, row, column]).tolist()
        said = "-" if np.isnan(share) else f"{share:.0f} %\n{low:.0f}-{high:.0f}"
        ink = "white" if share > _DARK else "black"
        panel.text(column, row, said, ha="center", va="center", fontsize=5, color=ink)


def _border(beyond: Mask) -> list[list[tuple[float, float]]]:
    """Where cells that are beyond the line meet those that are not."""
    upright = np.argwhere(beyond[:, 1:] != beyond[:, :-1]).tolist()
    flat = np.argwhere(beyond[1:] != beyond[:-1]).tolist()
    sides = [[(column + 0.5, row - 0.5), (column + 0.5, row + 0.5)] for row, column in upright]
    return sides + [[(column - 0.5, row + 0.5), (column + 0.5, row + 0.5)] for row, column in flat]
