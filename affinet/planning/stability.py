"""Whether the gains hold the formation: the nominal closed loop, one tick at a time.

With perfect estimates and leaders at rest the followers are a linear system per axis; it settles when the spectral
radius of its step is below one.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import factorial

import numpy as np

from agents.laws.double import DoubleConstantVelocity, DoubleVaryingVelocity
from agents.laws.single import ConstantVelocity, Static, VaryingVelocity
from analysis.models.arrays import Array


def radius(matrix: Array) -> float:
    """Spectral radius."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def step_matrix(law: object, stress: Array, degree: Array, dt: float) -> Array | None:
    """One tick of the followers under a law of Table II, or its counterpart for double integrators.

    Parameters
    ----------
    law
        Of the followers.
    stress
        Follower block L_ff of the stress matrix, shape (F, F).
    degree
        gamma_i = sum_j l_ij of the followers, shape (F,).
    dt
        Tick, in seconds.

    Returns
    -------
    Array or None
        Step of the state the law has (positions, velocities, its integral or its last input); None for a law not known here.
    """
    followers = len(stress)
    identity = np.eye(followers)
    if isinstance(law, Static):
        return identity - dt * law.alpha * stress
    if isinstance(law, ConstantVelocity):
        at_once = law.alpha + law.eta
        return np.block([[identity - dt * at_once * stress, -dt * law.eta * identity], [stress, identity]])
    if isinstance(law, VaryingVelocity):
        share = stress / degree[:, None]
        held = (1.0 - law.relaxation) * identity
        if law.source != "feed-forward":
            held = held + law.relaxation * (identity - share)
        pull = -law.relaxation * law.alpha * share
        return np.block([[identity + dt * pull, dt * held], [pull, held]])
    if isinstance(law, DoubleConstantVelocity):
        pull = np.block([-law.position_gain * stress, -law.velocity_gain * stress])
        return np.block([[identity, dt * identity], [0.0 * identity, identity]]) + _integrated(pull, dt)
    if isinstance(law, DoubleVaryingVelocity):
        share = law.relaxation * stress / degree[:, None]
        law_of_state = np.block([-law.position_gain * share, -law.velocity_gain * share, identity - share])
        moves = np.block([[identity, dt * identity, 0.0 * identity], [0.0 * identity, identity, 0.0 * identity]])
        return np.vstack([moves + _integrated(law_of_state, dt), law_of_state])
    return None


def _integrated(acceleration: Array, dt: float) -> Array:
    """What accelerations, rows (F, S) over the state, do to positions and velocities in a tick, shape (2 F, S)."""
    return np.vstack([0.5 * dt**2 * acceleration, dt * acceleration])


def chain_step(gains: Sequence[float], dt: float) -> Array:
    """One tick of a body of order m that is drawn to a place and its derivatives, shape (m, m).

    Parameters
    ----------
    gains
        On what it is off in position, velocity and so on, m of them; its input is held for the tick.
    dt
        Tick, in seconds.
    """
    order = len(gains)
    taylor = np.array([dt**power / factorial(power) for power in range(order + 1)])
    free = sum((taylor[power] * np.eye(order, k=power) for power in range(order)), start=np.zeros((order, order)))
    return np.asarray(free - np.outer(taylor[:0:-1], gains), dtype=np.float64)


def stretch_eigenvalue(places: Array) -> float:
    """The largest eigenvalue of sum_j p_ij p_ij^T over all pairs of places (N, D), in square metres.

    Near their distances, places that the gradient of `hold_distances` draws together come closer by 2 gain times this a second.
    """
    agents, dimension = places.shape
    apart = places[:, None] - places[None]
    outer = apart[..., :, None] * apart[..., None, :]
    blocks = np.eye(agents)[:, :, None, None] * outer.sum(axis=1)[:, None] - outer
    return float(np.linalg.eigvalsh(np.swapaxes(blocks, 1, 2).reshape(agents * dimension, -1))[-1])


def one_tick_radius(stress: Array, degree: Array, relaxation: float) -> float:
    """Radius of the velocity iteration I - eta D^-1 L_ff: inputs heard one tick late (errata of Table II)."""
    return radius(np.eye(len(stress)) - relaxation * stress / degree[:, None])
