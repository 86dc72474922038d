"""What the neighbours flew from the tick before: as heard, or predicted from what was heard before (paper 004, section 6.1)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from agents.exchange import Heard
from agents.swarm import SwarmBrief
from analysis.models.algebra import sum_over
from analysis.models.arrays import Array
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited

_ROUNDING = 1e-9  # of the root of a random walk


class NeighbourInputs(NamedTuple):
    """Inputs of the neighbours in the last p ticks, newest first, (..., n, p, D), and their covariances (..., n, p, D, D)."""

    inputs: Array
    covariance: Array

    @property
    def last(self) -> tuple[Array, Array]:
        """The newest, shape (..., n, D), and its covariance, shape (..., n, D, D)."""
        return self.inputs[..., 0, :], self.covariance[..., 0, :, :]


def at_rest(shape: tuple[int, ...], dimension: int, order: int) -> NeighbourInputs:
    """Everybody at rest so far, surely; `shape` is (..., n)."""
    past = (*shape, max(order, 1), dimension)
    return NeighbourInputs(np.zeros(past), np.zeros((*past, dimension)))


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
    dimension = flown.inputs.shape[-1]
    a = np.array(coefficients, dtype=np.float64)
    # One-step prediction (6.6) with its covariance (6.18), which is that of (6.10) where the past is known. As there, errors of
    # successive predictions count as independent: exact for p = 1, too sure of itself for longer models after several losses.
    expected = sum_over(flown.inputs[..., : len(a), :] * a[:, None], -2)
    spread = sum_over(flown.covariance[..., : len(a), :, :] * (a * a)[:, None, None], -3)
    spread = spread + (sigma * sigma if len(a) else 0.0) * np.eye(dimension)
    newest = np.where(said.fresh[..., None], said.fields["velocity"], expected)
    doubt = np.where(said.fresh[..., None, None], 0.0, spread)
    return NeighbourInputs(
        np.concatenate([newest[..., None, :], flown.inputs[..., :-1, :]], axis=-2),
        np.concatenate([doubt[..., None, :, :], flown.covariance[..., :-1, :, :]], axis=-3),
    )


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
