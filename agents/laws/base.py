"""What a control law is, and the stress force that all laws of a formation steer by.

A law is a frozen dataclass of its gains, with two pure methods over arrays with any leading axes.
"""

from __future__ import annotations

from typing import ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np

from agents.brief import Brief, Own, Reading
from agents.estimate import Estimate
from agents.exchange import Heard
from analysis.models.algebra import sum_over
from analysis.models.arrays import Array

State = TypeVar("State")


class Law(Protocol[State]):
    """A control law for followers.

    `order` is that of the bodies it steers, by a velocity (1), an acceleration (2) or a higher derivative; `by_stress` says
    whether it weighs the edges by the stress of the formation, which then must have one; `by_position` whether it needs the
    agent's own position.
    """

    by_stress: ClassVar[bool]
    by_position: ClassVar[bool]

    @property
    def order(self) -> int:
        """Of the bodies."""

    def init(self, brief: Brief, batch: tuple[int, ...]) -> State:
        """The state before the first tick, with `batch` as its leading axes."""

    def command(
        self, brief: Brief, state: State, tick: Reading, own: Own, estimate: Estimate, inputs: Heard
    ) -> tuple[State, Array]:
        """The input of this tick, shape (..., D), in metres per second, or per second squared.

        `inputs` is what the neighbours said of theirs.
        """


class Nothing(NamedTuple):
    """The state of a law that remembers nothing."""


def stress_force(brief: Brief, estimate: Estimate) -> Array:
    """sum_j l_ij zhat_ij over the edges with an estimate, shape (..., D), in metres."""
    return weighted(np.where(estimate.known, brief.stress, 0.0), estimate.relative)


def weighted(stress: Array, of_neighbours: Array) -> Array:
    """Sum over the neighbours of their weights (..., n) by what is known of each (..., n, D), shape (..., D)."""
    return sum_over(stress[..., None] * of_neighbours, -2)
