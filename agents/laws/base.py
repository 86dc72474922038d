"""What a control law is, and the stress force that all laws of a formation steer by.

A law is a frozen dataclass of its gains, with two pure methods over arrays with any leading axes. What else it may say has
defaults, which hold for laws that are no subclass too.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np

from agents.brief import Brief, Own, Reading
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.swarm import SwarmBrief
from agents.wants import Wants
from analysis.kernels.kernel import Plain, kernel
from analysis.models.arrays import Array, Mask
from analysis.models.finding import Finding

State = TypeVar("State")


class Law(Protocol[State]):
    """A control law for followers (docs/laws.md): `order`, `by_stress`, `init` and `command`; the rest may be left out.

    `order` is that of the bodies it steers, by a velocity (1), an acceleration (2) or a higher derivative; `by_stress` says
    whether it weighs the edges by the stress of the formation, which then must have one.
    """

    by_stress: ClassVar[bool]

    @property
    def order(self) -> int:
        """Of the bodies."""

    def init(self, brief: Brief, batch: tuple[int, ...]) -> State:
        """The state before the first tick, with `batch` as its leading axes."""

    def command(
        self, brief: Brief, state: State, tick: Reading, own: Own, estimate: Estimate, inputs: Heard
    ) -> tuple[State, Array]:
        """The state after this tick, and the input that its body flies until the next one; of leaders it is not flown.

        The input has shape (..., D), with the leading axes of `own.input`, in metres per second, or of double integrators per
        second squared.

        Parameters
        ----------
        brief, state
            Its place in the formation, and what it remembers.
        tick, own
            What its clock says, and what it knows of itself.
        estimate
            What its estimator believes of its edges: `relative`, shape (..., n, D), in metres, where `known`, shape (..., n).
        inputs
            What the neighbours said that they fly from the tick before on: `inputs.fields["velocity"]`, shape (..., n, D), and
            "acceleration" beside it of double integrators, where `inputs.fresh`, shape (..., n), says that it arrived.
        """

    @property
    def wants(self) -> Wants:
        """What it wants beyond what every agent gets; nothing by default."""
        return Wants()

    def checks(self, swarm: SwarmBrief) -> Sequence[Finding]:  # noqa: ARG002
        """What it finds of a swarm that is to fly it; an error refuses the scenario. Nothing by default."""
        return []

    def step_matrix(self, stress: Array, degree: Array, dt: float) -> Array | None:  # noqa: ARG002
        """One tick of the followers under a law that weighs edges by the stress; None, the default, where nobody knows it.

        With perfect estimates and leaders at rest the followers are a linear system per axis, which has to settle.

        Parameters
        ----------
        stress
            Follower block L_ff of the stress matrix, shape (F, F).
        degree
            gamma_i = sum_j l_ij of the followers, shape (F,).
        dt
            Tick, in seconds.

        Returns
        -------
        Array or None
            Step of the state the law has, shape (S, S): positions, and velocities, its integral or its last input.
        """
        return None

    @property
    def step_gain(self) -> float | None:
        """The gain on the stress force that decides on the step, per second; None, the default, where no single one does."""
        return None


class Nothing(NamedTuple):
    """The state of a law that remembers nothing."""


def stress_force(brief: Brief, estimate: Estimate) -> Array:
    """sum_j l_ij zhat_ij over the edges with an estimate, shape (..., D), in metres.

    It is 0 where the neighbours are in any affine image of their nominal places (paper 000, eq. 3) with the agent, and points
    away from where that would be: a follower that flies -alpha times it, alpha in 1/s, goes there (paper 000, Table II).

    Parameters
    ----------
    brief, estimate
        As a law is given them.
    """
    force: Array = _weighted(brief.stress, estimate.known, estimate.relative)
    return force


def weighted(stress: Array, of_neighbours: Array) -> Array:
    """Sum over the neighbours of their weights (..., n) by what is known of each (..., n, D), shape (..., D)."""
    summed: Array = _weighted(stress, np.ones(stress.shape[-1], dtype=bool), of_neighbours)
    return summed


@kernel("(n),(n),(n,D)->(D)", "d?d->d")
def _weighted(D: int) -> Plain:
    def plain(stress: Array, known: Mask, of_neighbours: Array, summed: Array) -> None:
        for axis in range(D):
            summed[axis] = 0.0
            for edge in range(len(known)):
                if known[edge]:
                    summed[axis] += stress[edge] * of_neighbours[edge, axis]

    return plain


def by_degree(summed: Array, degree: Array) -> Array:
    """What is summed over the neighbours (..., D) by gamma_i = sum_j l_ij (...); nothing for leaders that weigh nobody."""
    idle = (degree == 0.0)[..., None]
    return np.where(idle, 0.0, summed / np.where(idle, 1.0, degree[..., None]))
