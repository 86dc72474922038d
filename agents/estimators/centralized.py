"""An agent's end of the centralized filter: it takes its edges as the centre tells them (`agents/centre/filter.py`)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from agents.algebra.inputs import refuse_accelerations
from agents.brief import Brief, Own
from agents.estimate import Estimate, no_indicator
from agents.estimators.base import refuse_negative
from agents.exchange import Channels, Fields, Heard
from analysis.models.arrays import Array, Mask
from netem.core.channels import CENTRE, INPUT


class Stateless(NamedTuple):
    """It remembers nothing: the centre does."""


@dataclass(frozen=True)
class CentralizedFilter:
    """CRKF, or C-Edge-KF: a process of its own hears all measurements and inputs, past the medium, and tells everybody.

    Parameters
    ----------
    prior_position
        Standard deviation of an agent's initial position, per axis, in metres.
    """

    prior_position: float = 1.0

    def __post_init__(self) -> None:
        refuse_negative(prior_position=self.prior_position)

    def channels(self, brief: Brief) -> Channels:  # noqa: ARG002
        """Nothing."""
        return {}

    def init(self, brief: Brief, batch: tuple[int, ...]) -> Stateless:  # noqa: ARG002
        """Nothing to remember."""
        brief.sensor.require_positions()  # the centre measures by it
        return Stateless()

    def sense(
        self,
        brief: Brief,  # noqa: ARG002
        state: Stateless,
        measured: Array,  # noqa: ARG002
        seen: Mask,  # noqa: ARG002
    ) -> tuple[Stateless, Mapping[str, Fields]]:
        """What is measured goes to the centre with every agent's measurements."""
        return state, {}

    def fuse(
        self,
        brief: Brief,
        state: Stateless,
        heard: Mapping[str, Heard],
        own: Own,  # noqa: ARG002
    ) -> tuple[Stateless, Estimate]:
        """What the centre tells."""
        refuse_accelerations(heard[INPUT])
        told = heard[CENTRE].fields
        known = np.broadcast_to(brief.present, told["relative"].shape[:-1])
        return state, Estimate(told["relative"], known, told["covariance"], no_indicator(known))
