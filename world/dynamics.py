"""Single-integrator dynamics (paper 000, eq. 4)."""

from __future__ import annotations

from world.formation import Array


def single_integrator(position: Array, velocity: Array, dt: float, disturbance: Array) -> Array:
    """z_k+1 = z_k + dt u_k + w_k, shape (..., N, D), in metres; the disturbance w is a displacement per tick."""
    return position + dt * velocity + disturbance
