"""What a long run takes, over its ticks: docs/pictures/endurance.svg.

python bench/endurance.py inprocess --keep docs/endurance.json
python bench/endurance.py processes --ticks 100000 --keep docs/endurance.json
python docs/draw_endurance.py
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

MEASURED = Path(__file__).with_name("endurance.json")
PICTURE = Path(__file__).parent / "pictures" / "endurance.svg"

_SETTLED = 10_000  # ticks after which memory may not grow
_TITLES = {"inprocess": "in process", "processes": "over processes"}


def main() -> None:
    """Draw it from what was measured."""
    draw(json.loads(MEASURED.read_text()), PICTURE)


def draw(measured: dict[str, Any], picture: Path) -> None:
    """Memory of each process and sizes of the files.

    Parameters
    ----------
    measured
        Of each runtime, as `bench/endurance.py` keeps it.
    picture
        The file to draw.
    """
    mpl.rcParams.update({"font.size": 8, "axes.grid": True, "grid.alpha": 0.3, "svg.hashsalt": "affinet"})
    figure = Figure(figsize=(10.0, 5.2), layout="constrained")
    panels = figure.subplots(2, len(measured), squeeze=False)
    for (runtime, of_runtime), memory, files in zip(measured.items(), *panels, strict=True):
        looks = of_runtime["looks"]
        ticks = np.array([look["tick"] for look in looks])
        _over_ticks(memory, ticks, looks, "memory", 1e6)
        _over_ticks(files, ticks, looks, "files", 1e9)
        memory.axvline(_SETTLED, color="black", ls="--", lw=0.8)
        memory.set_title(f"{of_runtime['ticks']:,} ticks {_TITLES[runtime]}, {of_runtime['faults']:,} faults")
        files.set_xlabel("ticks written down")
    panels[0, 0].set_ylabel("resident memory (MB)")
    panels[1, 0].set_ylabel("on disk (GB)")
    figure.savefig(picture, metadata={"Date": None})


def _over_ticks(panel: Axes, ticks: Any, looks: list[dict[str, Any]], what: str, unit: float) -> None:
    names = list(dict.fromkeys(name for look in looks for name in look[what]))
    for name in names:
        values = np.array([look[what].get(name, np.nan) for look in looks]) / unit
        panel.plot(ticks, values, lw=1.0, label=name)
    panel.set_ylim(0.0)
    panel.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


if __name__ == "__main__":
    main()
