"""RAL with consensus filtering (paper 000, Algorithm 2 and eq. 14): the neighbours' perceived shapes steady one's own.

An agent's consensus map starts from its first own fit, or from what its neighbours agree on if that comes first. Equation
(12) gives no covariance for it; since it pools at least what all neighbours measure, (12) over the whole nominal neighbourhood
stands in.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.brief import Array, Brief, Mask
from agents.estimators import geometry
from agents.estimators.base import Channels, Estimate, Field, Fields, Heard
from agents.estimators.ral import THETA, Perceived, RelativeAffineLocalization, complete


class Agreement(NamedTuple):
    """What is perceived in this tick, and the consensus map that outlasts it."""

    perceived: Perceived
    consensus: geometry.Fit


@dataclass(frozen=True)
class ConsensusLocalization:
    """conRAL: the measurements, and Theta_i^con p_ij in place of the missing ones.

    Parameters
    ----------
    epsilon
        Step of the consensus (14); stable below 2 / (largest eigenvalue of the graph Laplacian + largest degree + 1).
    """

    epsilon: float = 0.05

    def channels(self, dimension: int) -> Channels:
        """The local and the consensus map."""
        square, truth = Field((dimension, dimension)), Field((), bool)
        return {THETA: {"local": square, "feasible": truth, "consensus": square, "started": truth}}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Agreement:
        """Nothing perceived, nothing agreed."""
        perceived = RelativeAffineLocalization().init(brief, batch)
        inverse, _ = geometry.gram(brief.relative, brief.present)
        pooled = np.broadcast_to(inverse, perceived.local.inverse.shape)
        return Agreement(perceived, perceived.local._replace(inverse=pooled))

    def sense(
        self, brief: Brief, state: Agreement, measured: Array, seen: Mask
    ) -> tuple[Agreement, Mapping[str, Fields]]:
        """Fit the local map, and start the consensus from it if nothing was agreed yet."""
        local = geometry.fit(brief.relative, measured, seen)
        consensus = _start(state.consensus, local.theta, local.feasible)
        said = {
            "local": local.theta,
            "feasible": local.feasible,
            "consensus": consensus.theta,
            "started": consensus.feasible,
        }
        return Agreement(Perceived(measured, seen, local), consensus), {THETA: said}

    def fuse(self, brief: Brief, state: Agreement, heard: Mapping[str, Heard]) -> tuple[Agreement, Estimate]:
        """One step of consensus; complete the measurements by its map."""
        perceived, said = state.perceived, heard[THETA]
        voices = said.fresh & said.fields["started"]
        psi = geometry.indicator(state.consensus, said.fields["consensus"], voices)
        consensus = self._step(state, said, voices)
        estimate = complete(brief, perceived.measured, perceived.seen, consensus, psi)
        return Agreement(perceived, consensus), estimate

    def _step(self, state: Agreement, said: Heard, voices: Mask) -> geometry.Fit:
        own, local = state.consensus, state.perceived.local
        fits = said.fresh & said.fields["feasible"]
        pull = (
            _sum(voices, said.fields["consensus"] - own.theta[..., None, :, :])
            + _sum(fits, said.fields["local"] - own.theta[..., None, :, :])
            + np.where(local.feasible[..., None, None], local.theta - own.theta, 0.0)
        )
        stepped = own._replace(theta=own.theta + self.epsilon * pull)
        number = voices.sum(axis=-1)
        agreed = _sum(voices, said.fields["consensus"]) / np.maximum(number, 1)[..., None, None]
        return _start(stepped, agreed, number > 0)


def _start(running: geometry.Fit, first: Array, given: Mask) -> geometry.Fit:
    theta = np.where(running.feasible[..., None, None], running.theta, first)
    return running._replace(theta=theta, feasible=running.feasible | given)


def _sum(counts: Mask, maps: Array) -> Array:
    total: Array = np.where(counts[..., None, None], maps, 0.0).sum(axis=-3)
    return total
