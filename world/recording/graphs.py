"""What a recording shows as curves of the graph that works: how connected it is, how old its news, and what it can hold."""

from __future__ import annotations

import numpy as np
import rerun as rr

from world.recording import palette
from world.recording.stage import Stage, Stretch

WIDE, NARROW = 4.0, 1.5  # where both have the same values the wide one can be seen behind the narrow one


class GraphCurves:
    """Logs connectivity, age of information and rigidity of the realised graph.

    Sensing and the last channel stand for their classes: channels that share their verdicts are alike.

    Parameters
    ----------
    stage
        Where.
    """

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        both = {
            "names": ["sensing", "comms"],
            "colors": np.array([palette.SENSING, palette.COMMS], dtype=np.uint32),
            "widths": [WIDE, NARROW],
        }
        for path in ("graph/connectivity", "graph/joint_connectivity", "graph/age"):
            self._stage.still(path, rr.SeriesLines(**both))
        self._stage.still("graph/feasible", rr.SeriesLines(names="feasible agents", colors=palette.LEADER))
        joint = rr.SeriesLines(names="stress dimension, joint", colors=0xC86BFFFF)
        self._stage.still("graph/stress_dimension", joint)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        realised, classes = stretch.realised, [0, -1]
        age = realised.age_s[:, classes]
        known = ~np.isnan(age)
        mean_age = np.where(known, age, 0.0).sum(axis=-1) / np.maximum(known.sum(axis=-1), 1)
        for name, values in (
            ("connectivity", realised.connectivity[:, classes]),
            ("joint_connectivity", realised.joint_connectivity[:, classes]),
            ("age", mean_age),
            ("feasible", realised.feasible.sum(axis=-1)[:, None].astype(np.float64)),
            ("stress_dimension", realised.stress_dimension[:, :1].astype(np.float64)),
        ):
            self._stage.scalars(f"graph/{name}", stretch.time, values)
