"""What filters say of the neighbours' inputs: of the model of those that are not heard, and of how late others are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from agents.exchange import Heard
from agents.swarm import SwarmBrief
from analysis.models.finding import Finding
from analysis.models.unsuited import Unsuited

_ROUNDING = 1e-9  # of the root of a random walk


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


def late(swarm: SwarmBrief, sigma_n: float, memory: int) -> list[Finding]:
    """What there is to say of inputs that are heard late, and of those until then.

    Parameters
    ----------
    swarm
        With what makes messages late.
    sigma_n
        Standard deviation of what drives the model of inputs, per axis, in metres per second.
    memory
        For how many ticks the filter finds use for an input.
    """
    if not swarm.late:
        return []
    says = [f"inputs are heard late ({', '.join(map(str, swarm.late))}), and enter in the tick they were flown in"]
    if swarm.lateness > memory:
        enough = f", and with memory = {swarm.lateness} none do" if swarm.lateness < swarm.ticks else ""
        says.append(f"those more than {memory} ticks late (memory) count as lost{enough}")
    if sigma_n == 0.0:
        says.append(
            "until then they are guessed, and with sigma_n 0 not doubted, which makes the filter too sure of itself: "
            "'affinet fit RUN' finds coefficients and sigma_n"
        )
    return [Finding("inputs", "note", "; ".join(says))]


def refuse_accelerations(said: Heard) -> None:
    """Fail where inputs are accelerations.

    Raises
    ------
    Unsuited
        When the agents are double integrators.
    """
    if "acceleration" in said.fields:
        raise Unsuited("this estimator predicts by inputs that are velocities; it is for single integrators")
