"""The first picture of the README, from the data of the study `bursts`: docs/pictures/bursts.png.

affinet study bursts --out STUDY
python docs/draw_bursts.py STUDY
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import h5netcdf
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

PICTURE = Path(__file__).parent / "pictures" / "bursts.png"

_GRAPH, _BURST = "zhao7", "mean burst (s)"
_INDEPENDENT, _HALF_A_SECOND = 0.0143, 0.5
_SHOWN = {"none": ("no estimator", "C7"), "rkf": ("RKF", "C1"), "ga-rkf": ("GA-RKF", "C0")}
_OTHERS = {"ral": ("RAL", "C4"), "conral": ("conRAL", "C2")}
_LOST = 1.0  # m²
_HIGHEST, _LOWEST = 1e4, 1e-3  # m², of what is drawn


def main(given: Sequence[str]) -> None:
    """Draw it from the directory of a study."""
    if len(given) != 1:
        sys.exit("give the directory that `affinet study bursts` has left")
    draw(Path(given[0]), PICTURE)


def draw(study: Path, picture: Path) -> None:
    """Error over time under losses that are independent and that last, and over how long they last.

    Parameters
    ----------
    study
        The directory of the study.
    picture
        The file to draw.
    """
    mpl.rcParams.update({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3, "legend.frameon": False})
    figure = Figure(figsize=(10.0, 3.0), layout="constrained", dpi=160)
    left, middle, right = figure.subplots(1, 3, sharey=True)
    with h5netcdf.File(study / "results.nc", decode_vlen_strings=True) as results:
        _over_time(left, results, _INDEPENDENT)
        _over_time(middle, results, _HALF_A_SECOND)
        _over_bursts(right, results)
    left.set_title("30 % lost, each message for itself")
    middle.set_title("30 % lost, in bursts of half a second")
    right.set_title("30 % lost: how long may a burst last?")
    for panel in (left, middle, right):
        panel.axhline(_LOST, color="black", ls="--", lw=0.8)
        panel.set_yscale("log")
        panel.set_ylim(_LOWEST, _HIGHEST)
    left.set_ylabel("tracking error (m²), mean over the runs")
    figure.legend(*right.get_legend_handles_labels(), loc="outside right center")
    figure.savefig(picture)


def _over_time(panel: Axes, results: h5netcdf.File, burst: float) -> None:
    for estimator, (label, colour) in _SHOWN.items():
        error = _at(results, "mean_tracking_error", {"graph": _GRAPH, "estimator": estimator, _BURST: burst})
        panel.plot(results["time"][:], error, color=colour, label=label, lw=1.2)
    panel.set_xlabel("time (s)")


def _over_bursts(panel: Axes, results: h5netcdf.File) -> None:
    for estimator, (label, colour) in (_SHOWN | _OTHERS).items():
        means = _at(results, "tracking_error", {"graph": _GRAPH, "estimator": estimator}).mean(axis=1)
        panel.plot(results[_BURST][:], means, color=colour, label=label, marker="o", ms=3, lw=1.2)
    panel.set_xscale("log")
    panel.set_xlabel("mean burst (s)")


def _at(results: h5netcdf.File, name: str, labels: Mapping[str, str | float]) -> np.ndarray:
    """What is over the other dimensions, at these labels."""
    variable = results[name]
    places = (
        results[axis][:].tolist().index(labels[axis]) if axis in labels else slice(None) for axis in variable.dimensions
    )
    return np.nan_to_num(variable[tuple(places)], nan=np.inf, posinf=1e300)


if __name__ == "__main__":
    main(sys.argv[1:])
