"""The centre of a swarm as it is called: what an estimator of a user's own has in its place is checked in every tick."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from agents.estimators.base import Centre, CentreEstimate
from agents.loading import capabilities, returned
from agents.swarm import SwarmBrief
from analysis.models.arrays import Array, Mask
from netem.loading.calling import Calling
from netem.loading.given import readonly
from netem.loading.returned import WrongReturn, array, kind, pair


@dataclass(frozen=True)
class CheckedCentre:
    """The filter that hears everybody.

    Parameters
    ----------
    filter
        What estimates.
    swarm
        What it was made for.

    Raises
    ------
    UserCodeError
        By its methods: when the filter fails, or returns something else than was asked of it.
    """

    filter: Centre[Any]
    swarm: SwarmBrief

    def begin(self, batch: tuple[int, ...]) -> Any:
        """The state before the first tick, with `batch` as its leading axes."""
        with Calling(self.filter, "begin"):
            state = self.filter.begin(batch)
            returned.fresh(state, batch)
            return state

    def step(self, state: Any, measured: Array, seen: Mask, inputs: Array) -> tuple[Any, CentreEstimate]:
        """Take in what all measured (..., N, n, D), which of it was `seen` (..., N, n), and what they flew (..., N, D)."""
        batch, edges = seen.shape[:-2], measured.shape[-3:]
        with Calling(self.filter, "step"):
            before = readonly(state)
            told = self.filter.step(before, readonly(measured), readonly(seen), readonly(inputs))
            after, estimate = pair(told, "the state, and a CentreEstimate")
            returned.state(before, after, batch)
            if not isinstance(estimate, CentreEstimate):
                raise WrongReturn(f"must return a CentreEstimate, got {kind(estimate)}")
            array("relative", estimate.relative, "N, n, D", edges, batch)
            array("covariance", estimate.covariance, "N, n, D, D", (*edges, edges[-1]), batch)
            if estimate.nis is None:
                estimate = estimate._replace(nis=np.full(seen.shape, np.nan))
            array("nis", estimate.nis, "N, n", edges[:-1], batch)
            return after, estimate


def centre_of(estimator: Any, swarm: SwarmBrief) -> CheckedCentre | None:
    """The centre that an estimator wants for a swarm, if it wants one.

    Raises
    ------
    UserCodeError
        When it fails to say, or says something else.
    """
    filter_of_all = capabilities.centre(estimator, swarm)
    return None if filter_of_all is None else CheckedCentre(filter_of_all, swarm)
