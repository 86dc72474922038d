"""Geometry-aware relative Kalman filtering (paper 000, Algorithm 3).

Where an edge is not measured, its filter is corrected by what the geometry says of it, trusted the less the more the
neighbours' perceived shapes disagree.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from agents.algebra import kalman
from agents.algebra.constraints import Constraint
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate
from agents.estimators.base import Estimator
from agents.estimators.conral import Agreement, ConsensusLocalization
from agents.estimators.ral import Perceived, RelativeAffineLocalization
from agents.estimators.rkf import EdgeFilters, Tracks
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding


class Fusion(NamedTuple):
    """The edge filters, and the state of the geometry that feeds them."""

    tracks: Tracks
    shape: Perceived | Agreement


@dataclass(frozen=True)
class GeometryAwareFilter(EdgeFilters, Estimator[Fusion]):
    """GA-RKF: RKF with the observation model (6).

    Parameters
    ----------
    geometry
        Where the perceived shape comes from: the agent's own fit, or the consensus with its neighbours.
    epsilon
        Step of that consensus (14).
    constraint
        The class of maps that the manoeuvre keeps to (Table III).
    penalty
        Whether the covariance of the geometric estimate is widened by psi_i I (6). Without, an edge still waits until psi
        is defined, so that this one thing differs.
    """

    geometry: Literal["ral", "conral"] = "conral"
    epsilon: float = 0.05
    constraint: Constraint = "affine"
    penalty: bool = True

    def channels(self, brief: Brief) -> Channels:
        """What the geometry broadcasts."""
        return self._shaper.channels(brief)

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Fusion:
        """All edges unknown, no shape perceived."""
        return Fusion(self.unknown(brief, batch), self._shaper.init(brief, batch))

    def missed(self, brief: Brief, state: Fusion, gap: Gap) -> Fusion:
        """Every edge coasts: an old shape told the filters already what it says. It ages."""
        return Fusion(self.coasted(brief, state.tracks, gap.ticks), self._shaper.missed(brief, state.shape, gap))

    def sense(self, brief: Brief, state: Fusion, measured: Array, seen: Mask) -> tuple[Fusion, Mapping[str, Fields]]:
        """Perceive the shape; the filters wait for what the neighbours say of it."""
        shape, said = self._shaper.sense(brief, state.shape, measured, seen)
        return state._replace(shape=shape), said

    def fuse(self, brief: Brief, state: Fusion, heard: Mapping[str, Heard], own: Own) -> tuple[Fusion, Estimate]:
        """Correct every edge by its measurement, or else by its place in the perceived shape."""
        seen = _perceived(state.shape).seen
        shape, observed = self._shaper.fuse(brief, state.shape, heard, own)
        # What lies outside its class a constrained map cannot see: alone it would be believed absolutely there.
        unseen = np.zeros_like(brief.sensor.common) if self.constraint == "affine" else brief.sensor.common
        R, usable = _doubted(observed.covariance, seen, observed.known, observed.psi, unseen, self.penalty)
        corrected = kalman.correct(*self.ahead(brief, state.tracks), observed.relative, R, usable)
        nis = np.where(seen, corrected.nis, np.nan)  # what the shape says is no measurement
        tracks = Tracks(*corrected._replace(nis=nis), state.tracks.known | usable)
        filtered = self.estimate(brief, tracks, observed.psi)
        reports = {**filtered.reports, **observed.reports}
        return Fusion(tracks, shape), filtered._replace(feasible=observed.feasible, reports=reports)

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Those of the geometry."""
        return self._shaper.checks(swarm)

    @cached_property
    def _shaper(self) -> Estimator[Any]:
        if self.geometry == "ral":
            return RelativeAffineLocalization(self.constraint)
        return ConsensusLocalization(self.epsilon, self.constraint)


def _perceived(shape: Perceived | Agreement) -> Perceived:
    return shape.perceived if isinstance(shape, Agreement) else shape


@kernel("(n,D,D),(n),(n),(),(D,D),()->(n,D,D),(n)", "d??dd?->d?")
def _doubted(D: int) -> Plain:
    """The covariances of what is observed, and where it may be used: (6)."""

    def plain(
        covariance: Array,
        seen: Mask,
        known: Mask,
        psi: float,
        unseen: Array,
        penalty: bool,
        R: Array,
        usable: Mask,
    ) -> None:
        trusted = math.isfinite(psi)
        for edge in range(len(seen)):
            usable[edge] = seen[edge] or (known[edge] and trusted)
            for i in range(D):
                for j in range(D):
                    R[edge, i, j] = covariance[edge, i, j]
                    if not seen[edge]:
                        R[edge, i, j] += unseen[i, j]
                        if penalty and trusted and i == j:
                            R[edge, i, j] += psi

    return plain
