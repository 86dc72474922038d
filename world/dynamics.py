"""Single-integrator dynamics (paper 000, eq. 4), and bodies that do not obey."""

from __future__ import annotations

import numpy as np

from netem.timeline import Conditions
from world.formation import Array


def single_integrator(position: Array, velocity: Array, dt: float, disturbance: Array) -> Array:
    """z_k+1 = z_k + dt u_k + w_k, shape (..., N, D), in metres; the disturbance w is a displacement per tick."""
    return position + dt * velocity + disturbance


def flown(commanded: Array, before: Array, now: Conditions) -> Array:
    """The inputs that bodies fly, shape (N, D), in metres per second.

    Parameters
    ----------
    commanded, before
        What their agents command, and what they flew in the tick before, shape (N, D).
    now
        A body without a command flies on as it did; one that holds does not fly at all.
    """
    return np.where(now.coasting[:, None], before, np.where(now.still[:, None], 0.0, commanded))
