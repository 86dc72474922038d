"""What the neighbours flew from the tick before: as heard, or predicted from what was heard before (paper 004, section 6.1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agents.exchange import Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import product
from analysis.models.arrays import Array
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited

_ROUNDING = 1e-9  # of the root of a random walk


class NeighbourInputs(NamedTuple):
    """Inputs of the neighbours in the last p ticks, newest first, (..., n, p, D), and their covariance (..., n, p, p).

    It is that of one axis: all have the same model, and are driven apart.
    """

    inputs: Array
    covariance: Array

    @property
    def last(self) -> tuple[Array, Array]:
        """The newest, shape (..., n, D), and its covariance, shape (..., n, D, D)."""
        return self.inputs[..., 0, :], self.covariance[..., 0, :1, None] * np.eye(self.inputs.shape[-1])


def at_rest(shape: tuple[int, ...], dimension: int, order: int) -> NeighbourInputs:
    """Everybody at rest so far, surely; `shape` is (..., n)."""
    past = max(order, 1)
    return NeighbourInputs(np.zeros((*shape, past, dimension)), np.zeros((*shape, past, past)))


def hear(flown: NeighbourInputs, said: Heard, coefficients: Sequence[float], sigma: float) -> NeighbourInputs:
    """The inputs a tick later: those said are known, the others follow an autoregressive model (6.5).

    Parameters
    ----------
    flown
        As of the tick before.
    said
        What arrived on the channel of inputs, and is taken for what flew from the tick before.
    coefficients
        a_1 .. a_p of the model, the same for all axes; none leaves who is not heard at rest.
    sigma
        Standard deviation of what drives the model, per axis, in metres per second.

    Raises
    ------
    ValueError
        When the neighbours' inputs are accelerations.
    """
    refuse_accelerations(said)
    A = _companion(coefficients)
    expected = product(A, flown.inputs)
    spread = product(A, flown.covariance, A.T)
    spread[..., 0, 0] += sigma * sigma if len(coefficients) else 0.0
    fresh = said.fresh[..., None, None]
    newest = np.where(fresh, said.fields["velocity"][..., None, :], expected[..., :1, :])
    # What is said is known, and says nothing here of what was said before and lost.
    doubted = np.ones(A.shape, dtype=bool)
    doubted[0, :] = doubted[:, 0] = False
    return NeighbourInputs(
        np.concatenate([newest, expected[..., 1:, :]], axis=-2), np.where(~fresh | doubted, spread, 0.0)
    )


def _companion(coefficients: Sequence[float]) -> Array:
    """What takes the last p inputs a tick on: the newest by the model, the others a place further back."""
    order = max(len(coefficients), 1)
    A = np.eye(order, k=-1)
    A[0, : len(coefficients)] = coefficients
    return A


def refuse_growing(coefficients: Sequence[float]) -> None:
    """Refuse an autoregressive model whose inputs grow without end.

    Raises
    ------
    ValueError
        When a root of the model lies outside the unit circle.
    """
    roots = np.abs(np.roots([1.0, *(-a for a in coefficients)]))
    if roots.max(initial=0.0) > 1.0 + _ROUNDING:
        raise ValueError(f"inputs with the coefficients {list(coefficients)} grow without end; give smaller ones")


def in_time(swarm: SwarmBrief) -> list[Finding]:
    """What there is to say of inputs that are heard late, and taken for those of the tick."""
    if not swarm.late:
        return []
    says = "inputs are heard ticks late, and taken for those of this tick: the filters will be too sure of themselves"
    return [Finding("inputs", "note", says)]


def refuse_accelerations(said: Heard) -> None:
    """Fail where inputs are accelerations.

    Raises
    ------
    Unsuited
        When the agents are double integrators.
    """
    if "acceleration" in said.fields:
        raise Unsuited("this estimator predicts by inputs that are velocities; it is for single integrators")
