"""The control law of paper 002 (11): a formation about a target, as far as the agent can know where it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from agents.brief import Array, Brief, Own, Reading
from agents.controllers import Nothing
from agents.estimators.base import Estimate, Heard


@dataclass(frozen=True)
class Pursuit:
    """u_i = p_i,2 - kappa_0 (p_i - p_i,0 - d_i) - kappa_1 (p_i' - p_i,1): a place about the target, for double integrators.

    The place d_i is the nominal position; p_i,mu are what the estimator reports as `reference`: position and derivatives.

    Parameters
    ----------
    kappa
        Gains on position and velocity, per second squared and per second.
    """

    order: ClassVar[int] = 2
    by_stress: ClassVar[bool] = False
    by_position: ClassVar[bool] = True
    kappa: Sequence[float] = (1.0, 2.0)

    def __post_init__(self) -> None:
        if len(self.kappa) != 2:
            raise ValueError(f"kappa are two gains, on position and velocity, not {self.kappa}")

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
        reference, position = _reference(estimate, self.order), _position(own)
        off = position - reference[..., 0, :] - brief.nominal
        behind = own.velocity - reference[..., 1, :]
        return state, reference[..., 2, :] - self.kappa[0] * off - self.kappa[1] * behind


@dataclass(frozen=True)
class FirstOrderPursuit:
    """u_i = p_i,1 - kappa_0 (p_i - p_i,0 - d_i): the same for single integrators, and a target of the first order.

    Parameters
    ----------
    kappa
        Gain on position, per second.
    """

    order: ClassVar[int] = 1
    by_stress: ClassVar[bool] = False
    by_position: ClassVar[bool] = True
    kappa: float = 1.0

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
        reference, position = _reference(estimate, self.order), _position(own)
        return state, reference[..., 1, :] - self.kappa * (position - reference[..., 0, :] - brief.nominal)


def _reference(estimate: Estimate, order: int) -> Array:
    reference = estimate.reports.get("reference")
    if reference is None or reference.shape[-2] <= order:
        raise ValueError(
            f"this law follows a target and its derivatives up to {order}; choose an estimator that reports them"
        )
    return np.asarray(reference, dtype=np.float64)


def _position(own: Own) -> Array:
    if own.position is None:
        raise ValueError("this law steers by its own position, and has none")
    return own.position
