"""What ten agents measure of each other, with the covariances of paper 003 in full and by their diagonals (Fig. 2 a, d).

python docs/draw_measurements.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse

import affinet
from analysis.models.arrays import Array

PICTURE = Path(__file__).parent / "pictures" / "paper-003-measurements.png"

_DEVIATIONS = 2.0


def main() -> None:
    """Fly a tick of `localization`, and draw what was measured in it."""
    run = affinet.run("localization", "time.duration=0.01")
    links = run.plan.world.links
    places, measured = run.position[0], run.arrays["measured"][0]
    origin = places[links.dst - 1]
    draw(places, origin, origin - measured, run.plan.world.sensor.spread(measured), PICTURE)


def draw(places: Array, origin: Array, found: Array, covariance: Array, picture: Path) -> None:
    """Ellipses of two standard deviations about what was measured.

    Parameters
    ----------
    places
        Where the agents are, shape (N, 2), in metres.
    origin, found
        Whence, and where another agent was found, shape (L, 2), in metres.
    covariance
        Of what was found, shape (L, 2, 2), in square metres.
    picture
        The file to draw.
    """
    mpl.rcParams.update({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3})
    figure = Figure(figsize=(10.0, 4.8), layout="constrained", dpi=160)
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    for panel, spread, title in zip(
        both,
        (covariance, covariance * np.eye(2)),
        ("full covariances", "their diagonals: along the line of sight and across are lost"),
        strict=True,
    ):
        _panel(panel, places, origin, found, spread)
        panel.set_title(title)
        panel.set_xlabel("x (m)")
    both[0].set_ylabel("y (m)")
    figure.legend(*both[0].get_legend_handles_labels(), loc="outside right center", frameon=False)
    figure.savefig(picture)


def _panel(panel: Axes, places: Array, origin: Array, found: Array, covariance: Array) -> None:
    for start, end, spread in zip(origin, found, covariance, strict=True):
        lengths, axes = np.linalg.eigh(spread)
        width, height = 2.0 * _DEVIATIONS * np.sqrt(lengths)
        angle = np.degrees(np.arctan2(axes[1, 0], axes[0, 0]))
        panel.add_patch(Ellipse(tuple(end), width, height, angle=angle, fc="0.85", ec="0.5", alpha=0.5, lw=0.6))
        panel.annotate("", end, start, arrowprops={"arrowstyle": "->", "color": "C0", "lw": 0.6})
    panel.plot(*found.T, "x", color="black", ms=3, mew=0.8, label="measured")
    panel.plot(*places.T, "o", color="C3", ms=5, label="agents")
    panel.set_aspect("equal")


if __name__ == "__main__":
    main()
