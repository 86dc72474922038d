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
from agents.algebra.kalman import move, observe
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate
from agents.estimators.base import Estimator
from agents.estimators.conral import Agreement, ConsensusLocalization
from agents.estimators.ral import Perceived, RelativeAffineLocalization
from agents.estimators.rkf import EdgeFilters, Tracks
from agents.exchange import Channels, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.kernels.kernel import Plain, kernel, scratch
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
        seen, tracks = _perceived(state.shape).seen, state.tracks
        shape, observed = self._shaper.fuse(brief, state.shape, heard, own)
        # What lies outside its class a constrained map cannot see: alone it would be believed absolutely there.
        unseen = np.zeros_like(brief.sensor.common) if self.constraint == "affine" else brief.sensor.common
        F, Q = kalman.motion(self.model, brief.dt, self.sigma_w)
        tracks = Tracks(
            *_filtered(
                *(tracks.mean, tracks.covariance, tracks.known, F, Q),
                *(observed.relative, observed.covariance, observed.known, seen),
                *(observed.psi[..., None], unseen, self.penalty),
            )
        )
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


@kernel("(S),(S,S),(),(O,O),(O,O),(D),(D,D),(),(),(),(D,D),()->(S),(S,S),(),()", "dd?dddd??dd?->ddd?")
def _filtered(S: int, O: int, D: int) -> Plain:  # noqa: E741
    """One edge a tick later: predicted, and corrected by its measurement, or else by what the shape says (6)."""
    rows = 4 * D

    def plain(
        mean: Array,
        P: Array,
        known: bool,
        F: Array,
        Q: Array,
        observed: Array,
        covariance: Array,
        placed: bool,
        seen: bool,
        psi: float,
        unseen: Array,
        penalty: bool,
        corrected: Array,
        left: Array,
        nis: Array,
        known_now: Mask,
    ) -> None:
        trusted = math.isfinite(psi)
        nis[0] = np.nan
        known_now[0] = known
        if not (seen or (placed and trusted)):
            move(mean, P, F, Q, corrected, left, scratch(O, O))
            return
        ahead, spread, R = scratch(1, S)[0], scratch(S, S), scratch(D, D)
        for i in range(D):
            for j in range(D):
                R[i, j] = covariance[i, j]
                if not seen:
                    R[i, j] += unseen[i, j]
                    if penalty and trusted and i == j:
                        R[i, j] += psi
        move(mean, P, F, Q, ahead, spread, scratch(O, O))
        surprise = observe(ahead, spread, observed, R, corrected, left, scratch(rows, D))
        if seen:  # what the shape says is no measurement
            nis[0] = surprise
        known_now[0] = True

    return plain
