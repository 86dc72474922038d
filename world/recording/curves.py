"""What a recording shows as curves of the swarm: how far off it is, how well maps agree, and whether filters are consistent."""

from __future__ import annotations

import numpy as np
import rerun as rr

from analysis.metrics import consistency
from analysis.metrics.errors import procrustes_error
from analysis.models.arrays import Array, Mask
from analysis.models.elementary import log
from analysis.models.reports import NIS
from world.books.edges import of_swarms
from world.physics.world import World
from world.recording import palette
from world.recording.stage import Stage, Stretch

_LN10 = float(log(10.0))
_SHARES = (0.0, 0.1, 0.5, 0.9, 1.0)  # of a swarm, where its agents are too many for a curve each
_NAMES = ("the least", "10 %", "median", "90 %", "the most")


def decades(values: Array) -> Array:
    """Decimal logarithms, NaN where there is none."""
    positive = values > 0.0
    shown: Array = np.where(positive, log(np.where(positive, values, 1.0)) / _LN10, np.nan)
    return shown


class EachAgent:
    """A curve for each agent, or the spread of all where they are many.

    Parameters
    ----------
    stage, path
        Where.
    agents
        How many.
    """

    def __init__(self, stage: Stage, path: str, agents: int) -> None:
        self._stage, self._path, self._agents = stage, path, agents

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        few = self._agents <= palette.MOST_APART
        names = [str(agent) for agent in range(1, self._agents + 1)] if few else list(_NAMES)
        says = rr.SeriesLines(names=names, colors=np.array(palette.of_agents(len(names)), dtype=np.uint32))
        self._stage.still(self._path, says)

    def log(self, stretch: Stretch, values: Array) -> None:
        """Log numbers (T, N), NaN where there is none."""
        shown = values if self._agents <= palette.MOST_APART else _spread(values)
        self._stage.scalars(self._path, stretch.time, shown)


def _spread(values: Array) -> Array:
    """Quantiles (T, 5) of what is known of (T, N), NaN where nothing is."""
    known = ~np.isnan(values)
    shown = np.full((len(values), len(_SHARES)), np.nan)
    some = known.any(axis=1)
    shown[some] = np.nanquantile(values[some], _SHARES, axis=1).T
    return shown


class TrackingCurves:
    """Logs how far the swarm is from where it should be, and from its shape, and each agent from its place.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage, self._formation = stage, world.formation
        self._off = EachAgent(stage, "metrics/off", world.formation.agents)

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        self._off.begin()
        for name in ("tracking_error", "procrustes"):
            self._stage.still(f"metrics/{name}", rr.SeriesLines(names=name.replace("_", " "), colors=palette.PLAIN))

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        moments, present = stretch.moments, stretch.present
        self._stage.scalars("metrics/tracking_error", stretch.time, decades(moments.error[stretch.kept, None]))
        shape = procrustes_error(moments.position[stretch.kept], self._formation.nominal, present)
        self._stage.scalars("metrics/procrustes", stretch.time, decades(shape[:, None]))
        off = stretch.position - stretch.target
        squared = (off * off).sum(axis=-1)
        self._off.log(stretch, decades(np.where(present, np.sqrt(squared), np.nan)))


class MapCurves:
    """Logs how far the maps that agents perceive are apart, and who can fit none to what it measures.

    Parameters
    ----------
    stage
        Where.
    agents
        How many.
    """

    def __init__(self, stage: Stage, agents: int) -> None:
        self._stage, self._agents = stage, agents
        self._psi = EachAgent(stage, "metrics/psi", agents)

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        self._psi.begin()
        points = rr.SeriesPoints(
            names=[str(agent) for agent in range(1, self._agents + 1)],
            colors=np.array(palette.of_agents(self._agents), dtype=np.uint32),
            marker_sizes=2.0,
        )
        self._stage.still("metrics/infeasible", points)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        self._psi.log(stretch, decades(stretch.moments.psi[stretch.kept]))
        numbers = np.arange(1.0, self._agents + 1.0)
        none = stretch.moments.feasible[stretch.kept] == 0
        self._stage.scalars("metrics/infeasible", stretch.time, np.where(none, numbers, np.nan))


class ConsistencyCurves:
    """Logs whether filters are as wrong as they say: NEES and NIS over the edges, and the band they should lie in.

    Parameters
    ----------
    stage
        Where.
    world
        What is flown.
    """

    def __init__(self, stage: Stage, world: World) -> None:
        self._stage, self._world = stage, world

    def begin(self) -> None:
        """Log what does not change, in a part of the recording that has nothing yet."""
        says = rr.SeriesLines(
            names=["NEES", "NIS", *(f"{consistency.DRAWN:.0%} {end}" for end in ("from", "to"))],
            colors=np.array([palette.SENSING, palette.COMMS, palette.BAND, palette.BAND], dtype=np.uint32),
        )
        self._stage.still("metrics/consistency", says)

    def log(self, stretch: Stretch) -> None:
        """Log consecutive ticks."""
        self._stage.scalars("metrics/consistency", stretch.time, self._means(stretch, stretch.present))

    def _means(self, stretch: Stretch, present: Mask) -> Array:
        moments, kept = stretch.moments, stretch.kept
        edges = of_swarms(
            self._world,
            present=present,
            position=moments.position[kept],
            verdicts=moments.verdicts[kept, 0],
            estimate=moments.estimate[kept],
            covariance=moments.covariance[kept],
            known=moments.known[kept],
            nis=moments.reports[NIS][kept] if NIS in moments.reports else None,
        )
        errors = consistency.of_errors(edges.estimate, edges.true, edges.covariance, edges.known)
        innovations = consistency.of_innovations(edges.nis, edges.seen)
        number = np.maximum(errors.number, 1)
        bands = consistency.band(consistency.DRAWN, self._world.formation.dimension, number)
        return np.concatenate([errors.mean, innovations.mean, *bands], axis=-1)
