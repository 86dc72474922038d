"""Single integrators (paper 000, eq. 4), double integrators, and bodies that do not obey."""

from __future__ import annotations

import numpy as np

from netem.timeline import Conditions
from world.formation import Array


def single_integrator(position: Array, velocity: Array, dt: float, disturbance: Array) -> Array:
    """z_k+1 = z_k + dt u_k + w_k, shape (..., N, D), in metres; the disturbance w is a displacement per tick."""
    return position + dt * velocity + disturbance


def double_integrator(position: Array, velocity: Array, acceleration: Array, dt: float, disturbance: Array) -> Array:
    """z_k+1 = z_k + dt zdot_k + dt^2 / 2 u_k + w_k, shape (..., N, D), in metres; w is a displacement per tick."""
    return position + dt * velocity + 0.5 * dt**2 * acceleration + disturbance


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
