"""Chains of integrators (paper 000, eq. 4; paper 002, eq. 1), and bodies that do not obey."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from math import factorial

import numpy as np

from analysis.models.arrays import Array
from analysis.models.elementary import whole_power
from netem.faults.timeline import Conditions


def carried(derivatives: Sequence[Array], dt: float) -> Array:
    """A quantity a tick later, of which these are the value and its derivatives (...), the last of them held.

    z_k+1 = z_k + dt u_k for single integrators, z_k + dt zdot_k + dt^2 / 2 u_k for double ones, and so on.
    """
    value, *rates = derivatives
    return reduce(
        np.add, [whole_power(dt, order) / factorial(order) * rate for order, rate in enumerate(rates, 1)], value
    )


def flown(commanded: Array, coasting: Array, now: Conditions) -> Array:
    """The inputs that bodies fly, shape (N, D).

    Parameters
    ----------
    commanded, coasting
        What their agents command, and what a body without a command flies, so that it goes on as it did, shape (N, D).
    now
        Who has none; a body that holds does not fly at all.
    """
    return np.where(now.coasting[:, None], coasting, np.where(now.still[:, None], 0.0, commanded))
