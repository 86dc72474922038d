"""A picture of a run: where its agents flew, and its tracking error."""

from __future__ import annotations

import io

import numpy as np

from affinet.verdicts import told
from affinet.verdicts.evidence import Evidence

_LEADER, _FOLLOWER = "#d4a017", "#3b76c4"


def png(run: Evidence) -> bytes:
    """The picture, as a file holds it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # takes a while to import
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    FigureCanvasAgg(figure)
    paths, error = figure.subplots(1, 2)
    paths.set_title(told.title(run), parse_math=False)
    paths.set(xlabel="x (m)", ylabel="y (m)", aspect="equal")
    for number, leads in enumerate(run.plan.world.formation.is_leader.tolist()):
        x, y = run.position[:, number, :2].T
        colour = _LEADER if leads else _FOLLOWER
        paths.plot(x, y, color=colour, linewidth=1.0)
        paths.plot(x[-1:], y[-1:], "o", color=colour, markersize=5.0)
    error.set(xlabel="time (s)", ylabel="tracking error (m²)")
    error.plot(run.seconds, np.where(run.error > 0.0, run.error, np.nan), color="#555555", linewidth=1.0)
    error.set_yscale("log")
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=100)
    return file.getvalue()
