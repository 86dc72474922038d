"""No estimator: act on what was measured, and on nothing where nothing was (the baseline of paper 000, section VII)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import Estimator
from agents.exchange import Channels, Fields, Heard
from analysis.models.arrays import Array, Mask


class LastMeasured(NamedTuple):
    """The measurements of this tick: relative positions (..., n, D) and which edges were seen (..., n)."""

    measured: Array
    seen: Mask


@dataclass(frozen=True)
class NoEstimator(Estimator[LastMeasured]):
    """The measurements themselves."""

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> LastMeasured:
        """Nothing measured yet."""
        shape = (*batch, brief.relative.shape[-2])
        return LastMeasured(np.zeros((*shape, brief.dimension)), np.zeros(shape, dtype=bool))

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: LastMeasured,  # noqa: ARG002
        measured: Array,
        seen: Mask,
    ) -> tuple[LastMeasured, Mapping[str, Fields]]:
        """Remember this tick's measurements."""
        return LastMeasured(measured, seen), {}

    def fuse(
        self,
        brief: Brief,
        state: LastMeasured,
        heard: Mapping[str, Heard],  # noqa: ARG002
        own: Own,  # noqa: ARG002
    ) -> tuple[LastMeasured, Estimate]:
        """The measurements."""
        covariance = brief.sensor.spread(state.measured)
        return state, Estimate(state.measured, state.seen, covariance, no_indicator(state.seen))
