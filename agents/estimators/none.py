"""No estimator: act on what was measured, and on nothing where nothing was (the baseline of paper 000, section VII)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.brief import Array, Brief, Mask, Own
from agents.estimators.base import Channels, Estimate, Fields, Heard, no_indicator


class Measured(NamedTuple):
    """The measurements of this tick: relative positions (..., n, D) and which edges were seen (..., n)."""

    measured: Array
    seen: Mask


@dataclass(frozen=True)
class NoEstimator:
    """The measurements themselves."""

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Measured:
        """Nothing measured yet."""
        shape = (*batch, brief.relative.shape[-2])
        return Measured(np.zeros((*shape, brief.dimension)), np.zeros(shape, dtype=bool))

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Measured,  # noqa: ARG002
        measured: Array,
        seen: Mask,
    ) -> tuple[Measured, Mapping[str, Fields]]:
        """Remember this tick's measurements."""
        return Measured(measured, seen), {}

    def fuse(
        self,
        brief: Brief,
        state: Measured,
        heard: Mapping[str, Heard],  # noqa: ARG002
        own: Own,  # noqa: ARG002
    ) -> tuple[Measured, Estimate]:
        """The measurements."""
        covariance = brief.sensor.spread(state.measured)
        return state, Estimate(state.measured, state.seen, covariance, no_indicator(state.seen))
