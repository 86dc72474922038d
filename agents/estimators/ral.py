"""Relative affine localization (paper 000, section IV-A): where an edge is not measured, its place in the perceived shape."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra import geometry
from agents.algebra.constraints import MAPS, Constraint
from agents.brief import Brief, Own
from agents.estimate import Estimate
from agents.estimators.base import Estimator
from agents.exchange import Channels, Field, Fields, Heard
from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from netem.core.channels import THETA


class Perceived(NamedTuple):
    """This tick's measurements (..., n, D), which edges were seen (..., n), and the map fitted to them."""

    measured: Array
    seen: Mask
    local: geometry.Fit


@dataclass(frozen=True)
class RelativeAffineLocalization(Estimator[Perceived]):
    """RAL: the measurements, and Theta_i p_ij in place of the missing ones.

    The printed Algorithm 2 replaces the measured edges instead; the input would then be Theta_i sum_j l_ij p_ij = 0 and the
    formation not controlled at all (errata).

    Parameters
    ----------
    constraint
        The class of maps that the manoeuvre keeps to (Table III).
    """

    constraint: Constraint = "affine"

    def channels(self, brief: Brief) -> Channels:
        """The local map, for the neighbours' convergence indicator."""
        return {THETA: {"local": Field((brief.dimension, brief.dimension)), "feasible": Field((), bool)}}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Perceived:
        """Nothing perceived yet."""
        shape = (*batch, *brief.relative.shape[-2:])
        square = (*batch, brief.dimension, brief.dimension)
        nothing = geometry.Fit(np.zeros(square), np.zeros(batch, dtype=bool), np.zeros(square))
        return Perceived(np.zeros(shape), np.zeros(shape[:-1], dtype=bool), nothing)

    def sense(
        self,
        brief: Brief,
        state: Perceived,  # noqa: ARG002
        measured: Array,
        seen: Mask,
    ) -> tuple[Perceived, Mapping[str, Fields]]:
        """Fit the local map."""
        local = MAPS[self.constraint].fit(brief.relative, measured, seen)
        return Perceived(measured, seen, local), {THETA: {"local": local.theta, "feasible": local.feasible}}

    def fuse(
        self,
        brief: Brief,
        state: Perceived,
        heard: Mapping[str, Heard],
        own: Own,  # noqa: ARG002
    ) -> tuple[Perceived, Estimate]:
        """Complete the measurements by the local map."""
        said = heard[THETA]
        psi = geometry.indicator(state.local, said.fields["local"], said.fresh & said.fields["feasible"])
        covariance = MAPS[self.constraint].covariance(state.local, brief.relative, brief.sensor.common)
        return state, complete(brief, state, state.local, covariance, psi)


def complete(brief: Brief, perceived: Perceived, shape: geometry.Fit, geometric: Array, psi: Array) -> Estimate:
    """Measured edges as measured, the others from a shape (Algorithm 2, lines 9-13, by the errata), which is reported.

    Parameters
    ----------
    brief, perceived
        Its place in the formation, and what it measured and heard.
    shape
        Fitted to its edges.
    geometric
        Covariance of the shape's edges, shape (..., n, D, D), in square metres.
    psi
        Its convergence indicator, shape (...).
    """
    relative, covariance, known, theta = _completed(
        perceived.measured,
        perceived.seen,
        brief.sensor.common,
        shape.theta,
        shape.feasible,
        geometric,
        brief.relative,
        brief.present,
    )
    return Estimate(relative, known, covariance, psi, feasible=perceived.local.feasible, reports={THETA: theta})


@kernel("(n,D),(n),(D,D),(D,D),(),(n,D,D),(n,D),(n)->(n,D),(n,D,D),(n),(D,D)", "d?dd?dd?->dd?d")
def _completed(D: int) -> Plain:
    def plain(
        measured: Array,
        seen: Mask,
        common: Array,
        theta: Array,
        feasible: bool,
        geometric: Array,
        nominal: Array,
        present: Mask,
        relative: Array,
        covariance: Array,
        known: Mask,
        reported: Array,
    ) -> None:
        for i in range(D):
            for j in range(D):
                reported[i, j] = theta[i, j] if feasible else np.nan
        for edge in range(len(seen)):
            known[edge] = present[edge] and (seen[edge] or feasible)
            for i in range(D):
                placed = 0.0
                for j in range(D):
                    placed += theta[i, j] * nominal[edge, j]
                    covariance[edge, i, j] = common[i, j] if seen[edge] else geometric[edge, i, j]
                relative[edge, i] = measured[edge, i] if seen[edge] else placed

    return plain
