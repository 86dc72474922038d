"""The control law of paper 002 (11): a formation about a target, as far as the agent can know where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import ClassVar

import numpy as np

from agents.algebra import stability
from agents.brief import DERIVATIVES, Brief, Own, Reading
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.laws.base import Law, Nothing
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.models.arrays import Array
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited


@dataclass(frozen=True)
class Pursuit(Law[Nothing]):
    """u_i = p_i,m - sum_mu kappa_mu (x_i^(mu) - p_i,mu), with p_i,0 + d_i for mu = 0: a place about the target.

    The place d_i is the nominal position; p_i,mu are what the estimator reports as `reference`: position and derivatives.

    Parameters
    ----------
    kappa
        Gains on position, velocity and so on, one for each of the m times that bodies integrate their input: kappa_mu in
        1/s^(m - mu).
    """

    by_stress: ClassVar[bool] = False
    wants: ClassVar[Wants] = Wants(position=True)
    kappa: Sequence[float] = (1.0, 2.0)

    def __post_init__(self) -> None:
        if not 1 <= len(self.kappa) <= len(DERIVATIVES):
            raise ValueError(
                f"kappa needs a gain for each of 1 to {len(DERIVATIVES)} times that bodies integrate their input, "
                f"like [1.0, 2.0]; got {list(self.kappa)}"
            )
        if np.roots([1.0, *reversed(self.kappa)]).real.max() >= 0.0:
            raise ValueError(
                f"with kappa {list(self.kappa)} agents leave the reference: s^m + ... + kappa_0 is not Hurwitz"
            )

    @property
    def order(self) -> int:
        """m, of the bodies."""
        return len(self.kappa)

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Nothing:  # noqa: ARG002
        """Nothing to remember."""
        return Nothing()

    def command(
        self,
        brief: Brief,
        state: Nothing,
        tick: Reading,  # noqa: ARG002
        own: Own,
        estimate: Estimate,
        inputs: Heard,  # noqa: ARG002
    ) -> tuple[Nothing, Array]:
        """Go after the reference."""
        reference, flown = self._reference(estimate), self._flown(brief, own)
        pulls = [kappa * (flown[mu] - reference[..., mu, :]) for mu, kappa in enumerate(self.kappa)]
        return state, reduce(np.subtract, pulls, reference[..., self.order, :])

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:
        """Whether a tick is short enough for the pull toward the reference."""
        radius, gains = stability.radius(stability.chain_step(self.kappa, swarm.dt)), list(self.kappa)
        if radius < 1.0:
            settles = stability.settling_time(radius, swarm.dt)
            return [Finding("step", "ok", f"radius {radius:.6f} < 1 at dt {swarm.dt:g} s, kappa {gains}: {settles}")]
        too_long = f"the step is too long for kappa {gains}; lower it, or dt"
        return [Finding("step", "error", f"radius {radius:.4g} >= 1 at dt {swarm.dt:g} s: {too_long}")]

    def _flown(self, brief: Brief, own: Own) -> list[Array]:
        """Own position less that of the place, and its derivatives."""
        if own.position is None:
            raise Unsuited("this law steers by its own position, and has none")
        motion = [] if self.order == 1 else [own.velocity]
        if own.higher is not None:
            motion += [*np.moveaxis(own.higher, -2, 0)]
        return [own.position - brief.nominal, *motion]

    def _reference(self, estimate: Estimate) -> Array:
        reference = estimate.reports.get("reference")
        if reference is None or reference.shape[-2] <= self.order:
            raise Unsuited(
                f"this law follows a target and its derivatives up to {self.order}: the estimator has to report them, "
                f"and the target to be of order {self.order} at least"
            )
        return np.asarray(reference, dtype=np.float64)
