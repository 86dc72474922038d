"""RAL with consensus filtering (paper 000, Algorithm 2 and eq. 14): the neighbours' perceived shapes steady one's own.

An agent's consensus map starts from its first own fit, or from what its neighbours agree on if that comes first. Its edges
have the covariance (12) of those that the agent measures in this tick, or of all that it has where these are too few.

The indicator (16) is that of the local fits (10): consensus maps agree whether or not the formation is affine. An agent that
has no fit of its own holds its consensus map against those of its neighbours; who hears of no fit keeps to the last indicator,
which grows as it ages (docs/decisions/0016).

Under a constraint the local fits keep to it, and (14) averages them as it stands, so that its bound on the step holds. A mean
of rotations is none; the map in use is the nearest that keeps to the constraint.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import geometry
from agents.algebra.constraints import MAPS, Constraint
from agents.algebra.geometry import disagreement
from agents.brief import Brief, Gap, Own
from agents.estimate import Estimate
from agents.estimators.base import Estimator
from agents.estimators.ral import Perceived, RelativeAffineLocalization, complete
from agents.exchange import Channels, Field, Fields, Heard
from agents.swarm import SwarmBrief
from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding
from netem.core.channels import THETA


class Indicator(NamedTuple):
    """What (16) was when a fit was last heard, and how many ticks ago that is, both (...); NaN before."""

    heard: Array
    age: Array

    @property
    def psi(self) -> Array:
        """What it is by now: maps that drift apart differ by their age, and its square is what (16) means."""
        since = 1.0 + self.age
        return self.heard * since * since


class Agreement(NamedTuple):
    """What is perceived in this tick, the consensus map that outlasts it, with the H H^T of all nominal neighbours, and psi."""

    perceived: Perceived
    consensus: geometry.Fit
    indicator: Indicator


@dataclass(frozen=True)
class ConsensusLocalization(Estimator[Agreement]):
    """conRAL: the measurements, and Theta_i^con p_ij in place of the missing ones.

    Parameters
    ----------
    epsilon
        Step of the consensus (14); stable below 2 / (largest eigenvalue of the graph Laplacian + largest degree + 1).
    constraint
        The class of maps that the manoeuvre keeps to (Table III).
    """

    epsilon: float = 0.05
    constraint: Constraint = "affine"

    def channels(self, brief: Brief) -> Channels:
        """The local and the consensus map."""
        square, truth = Field((brief.dimension, brief.dimension)), Field((), bool)
        return {THETA: {"local": square, "feasible": truth, "consensus": square, "started": truth}}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Agreement:
        """Nothing perceived, nothing agreed."""
        perceived = RelativeAffineLocalization().init(brief, batch)
        nominal = np.broadcast_to(geometry.gram(brief.relative, brief.present), perceived.local.gram.shape)
        return Agreement(
            perceived, perceived.local._replace(gram=nominal), Indicator(np.full(batch, np.nan), np.zeros(batch))
        )

    def missed(self, brief: Brief, state: Agreement, gap: Gap) -> Agreement:  # noqa: ARG002
        """The indicator ages; the map stays, as where nobody is heard."""
        indicator = state.indicator
        return state._replace(indicator=indicator._replace(age=indicator.age + gap.ticks))

    def sense(
        self, brief: Brief, state: Agreement, measured: Array, seen: Mask
    ) -> tuple[Agreement, Mapping[str, Fields]]:
        """Fit the local map, and start the consensus from it if nothing was agreed yet."""
        local = MAPS[self.constraint].fit(brief.relative, measured, seen)
        consensus = _start(state.consensus, local.theta, local.feasible)
        said = {
            "local": local.theta,
            "feasible": local.feasible,
            "consensus": consensus.theta,
            "started": consensus.feasible,
        }
        return Agreement(Perceived(measured, seen, local), consensus, state.indicator), {THETA: said}

    def fuse(
        self,
        brief: Brief,
        state: Agreement,
        heard: Mapping[str, Heard],
        own: Own,  # noqa: ARG002
    ) -> tuple[Agreement, Estimate]:
        """One step of consensus; complete the measurements by its map."""
        said, local, before = heard[THETA], state.perceived.local, state.consensus
        fits, voices = said.fresh & said.fields["feasible"], said.fresh & said.fields["started"]
        *indicated, theta, started, gram = _agreed(
            *(local.theta, local.feasible, local.gram),
            *(before.theta, before.feasible, before.gram, self._in_use(before).theta),
            *(said.fields["local"], fits, said.fields["consensus"], voices),
            *(state.indicator.heard, state.indicator.age, self.epsilon),
        )
        indicator, consensus = Indicator(*indicated), geometry.Fit(theta, started, before.gram)
        shape = self._in_use(consensus)
        behind = geometry.Fit(shape.theta, started, gram)
        covariance = MAPS[self.constraint].covariance(behind, brief.relative, brief.sensor.common)
        estimate = complete(brief, state.perceived, shape, covariance, indicator.psi)
        return Agreement(state.perceived, consensus, indicator), estimate

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether the consensus (14) converges on the graph."""
        laplacian = swarm.laplacian
        bound = 2.0 / (np.linalg.eigvalsh(laplacian)[-1] + np.diag(laplacian).max() + 1.0)
        if self.epsilon <= 0.0:
            says = f"epsilon {self.epsilon:g}: nothing is agreed on; give one above 0, below {bound:.4f}"
        elif self.epsilon < bound:
            says = f"epsilon {self.epsilon:g} is below the bound {bound:.4f} of (14) on this graph"
            return [Finding("consensus", "ok", says)]
        else:
            says = f"epsilon {self.epsilon:g} is not below the bound {bound:.4f}: the consensus (14) diverges"
        return [Finding("consensus", "error", says)]

    def _in_use(self, consensus: geometry.Fit) -> geometry.Fit:
        if self.constraint == "affine":  # every map is one
            return consensus
        nearest = MAPS[self.constraint].nearest(consensus.theta)
        return consensus._replace(theta=np.where(consensus.feasible[..., None, None], nearest, 0.0))


@kernel(
    "(D,D),(),(D,D),(D,D),(),(D,D),(D,D),(n,D,D),(n),(n,D,D),(n),(),(),()->(),(),(D,D),(),(D,D)",
    "d?dd?ddd?d?ddd->ddd?d",
)
def _agreed(D: int) -> Plain:
    def plain(
        local: Array,
        feasible: bool,
        seen: Array,
        own: Array,
        started: bool,
        nominal: Array,
        in_use: Array,
        fitted: Array,
        fits: Mask,
        consensus: Array,
        voices: Mask,
        heard: float,
        age: float,
        epsilon: float,
        heard_now: Array,
        age_now: Array,
        theta: Array,
        running: Mask,
        gram: Array,
    ) -> None:
        # Indicator (16), against the agent's own fit, or the consensus where it has none.
        indicated = np.nan
        if feasible:
            indicated = disagreement(local, fitted, fits)
        elif started:
            indicated = disagreement(in_use, fitted, fits)
        new = math.isfinite(indicated)
        heard_now[0] = indicated if new else heard
        age_now[0] = 0.0 if new else age + 1.0
        # Consensus (14); who has not started takes the mean of what the others agree on.
        number, weight = 0, 1 if feasible else 0
        for edge in range(len(voices)):
            number += voices[edge]
            weight += fits[edge]
        weight += number
        running[0] = started or number > 0
        for i in range(D):
            for j in range(D):
                agreed, drawn = 0.0, local[i, j]
                for edge in range(len(voices)):
                    if voices[edge]:
                        agreed += consensus[edge, i, j]
                    if fits[edge]:
                        drawn += fitted[edge, i, j]
                stepped = own[i, j] + epsilon * (drawn + agreed - weight * own[i, j])
                theta[i, j] = stepped if started else agreed / max(number, 1)
                gram[i, j] = seen[i, j] if feasible else nominal[i, j]

    return plain


def _start(running: geometry.Fit, first: Array, given: Mask) -> geometry.Fit:
    theta = np.where(running.feasible[..., None, None], running.theta, first)
    return running._replace(theta=theta, feasible=running.feasible | given)
