"""Peers of a Monte-Carlo study: filterpy, batched NumPy, and one compiled loop. Each returns the estimates (T, R, L, D)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from speed.problem import Draws, Swarm

from analysis.models.arrays import Array
from netem.core import draws
from netem.core.draws import Purpose


def filterpy_objects(swarm: Swarm, given: Draws) -> Array:
    """One run: a `KalmanFilter` for every edge, one after the other."""
    filters = [edge_filter(swarm.F, swarm.Q, swarm.sigma, swarm.prior) for _ in swarm.src]
    position, velocity, heard = begin(swarm, given.start(swarm)[0])
    known, kept = np.zeros(len(swarm.src), dtype=bool), np.empty((swarm.ticks, 1, len(swarm.src), 2))
    for tick in range(swarm.ticks):
        (noise,), (seen,) = given.tick(swarm, tick)
        measured = position[swarm.dst] - position[swarm.src] + swarm.sigma * noise
        for edge, one in enumerate(filters):
            one.predict()
            if seen[edge]:
                one.update(measured[edge])
            kept[tick, 0, edge] = one.x[:2, 0]
        known |= seen
        heard[seen] = velocity[swarm.src[seen]]
        pull = swarm.stress[:, None] * (heard - swarm.alpha * np.where(known[:, None], kept[tick, 0], 0.0))
        steered = np.zeros_like(position)
        np.add.at(steered, swarm.dst, pull)
        velocity = led(swarm, tick, position, steered / swarm.degree[:, None])
        position = position + swarm.dt * velocity
    return kept


def edge_filter(F: Array, Q: Array, sigma: float, prior: Array) -> Any:
    """An edge's filter, by filterpy; its state has both axes of each derivative together."""
    from filterpy.kalman import KalmanFilter  # takes its time, and is no dependency of affinet's

    one = KalmanFilter(dim_x=6, dim_z=2)
    one.F, one.Q = np.kron(F, np.eye(2)), np.kron(Q, np.eye(2))
    one.H, one.R = np.eye(2, 6), sigma**2 * np.eye(2)
    one.P = np.diag(np.repeat(prior, 2) ** 2)
    return one


def begin(swarm: Swarm, scatter: Array) -> tuple[Array, Array, Array]:
    """Positions, velocities, and velocities heard, before the first tick."""
    position = swarm.target[0] + np.where(swarm.leader[:, None], 0.0, swarm.spread * scatter)
    return position, np.zeros_like(position), np.zeros((*position.shape[:-2], len(swarm.src), 2))


def led(swarm: Swarm, tick: int, position: Array, steered: Array) -> Array:
    """Velocities: leaders fly the manoeuvre, the others as steered."""
    target, following = swarm.target[tick], swarm.target[tick + 1]
    piloted = (following - target) / swarm.dt + swarm.leader_gain * (target - position)
    return np.where(swarm.leader[:, None], piloted, steered)


def batched_numpy(swarm: Swarm, given: Draws) -> Array:
    """All runs and edges as one stack."""
    F, Q = np.kron(swarm.F, np.eye(2)), np.kron(swarm.Q, np.eye(2))
    R = swarm.sigma**2 * np.eye(2)
    position, velocity, heard = begin(swarm, given.start(swarm))
    edges = heard.shape[:-1]
    x, known = np.zeros((*edges, 6)), np.zeros(edges, dtype=bool)
    P = np.broadcast_to(np.diag(np.repeat(swarm.prior, 2) ** 2), (*edges, 6, 6))
    sums = (np.arange(len(swarm.degree))[:, None] == swarm.dst) * swarm.stress  # of each agent's links, (N, L)
    kept = np.empty((swarm.ticks, *edges, 2))
    for tick in range(swarm.ticks):
        noise, seen = given.tick(swarm, tick)
        measured = position[:, swarm.dst] - position[:, swarm.src] + swarm.sigma * noise
        x, P = x @ F.T, F @ P @ F.T + Q
        K = P[..., :2] @ np.linalg.inv(P[..., :2, :2] + R)
        x = np.where(seen[..., None], x + (K @ (measured - x[..., :2])[..., None])[..., 0], x)
        P = np.where(seen[..., None, None], P - K @ P[..., :2, :], P)
        known |= seen
        kept[tick] = x[..., :2]
        heard = np.where(seen[..., None], velocity[:, swarm.src], heard)
        pull = heard - swarm.alpha * np.where(known[..., None], kept[tick], 0.0)
        velocity = led(swarm, tick, position, sums @ pull / swarm.degree[:, None])
        position = position + swarm.dt * velocity
    return kept


def compiled(swarm: Swarm, seeds: NDArray[np.uint64]) -> Array:
    """One loop over runs, ticks and edges, which draws by counters as affinet does: it needs no draws given."""
    kept = np.empty((swarm.ticks, len(seeds), len(swarm.src), 2))
    _compiled()(
        seeds, swarm.dt, swarm.sigma, swarm.loss, swarm.alpha, swarm.leader_gain, swarm.spread,
        swarm.src, swarm.dst, swarm.stress, swarm.degree, swarm.leader, swarm.target, swarm.F, swarm.Q, swarm.prior, kept,
    )  # fmt: skip
    return kept


@cache
def _compiled() -> Callable[..., None]:
    import ctypes

    import numba
    from numba.extending import get_cython_function_address

    address = get_cython_function_address("scipy.special.cython_special", "ndtri")
    ndtri = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)(address)
    philox, unit = numba.njit(draws.philox.plain), numba.njit(draws.unit.plain)
    word, half, high = np.uint64(0xFFFFFFFF), np.uint64(32), np.uint64(16)
    loss_draw, noise_draw, start_draw = (
        np.uint64(int(purpose) << 16) for purpose in (Purpose.LOSS, Purpose.SENSOR_NOISE, Purpose.INITIAL_POSITION)
    )

    @numba.njit
    def drawn(key, tick, src, dst, purpose):  # type: ignore[no-untyped-def]  # compiled by what it is called with
        ends = np.uint64(src) << high | np.uint64(dst)
        return philox((np.uint64(tick), ends, np.uint64(0), purpose), (key & word, key >> half))

    @numba.njit
    def fly(  # type: ignore[no-untyped-def]
        seeds, dt, sigma, loss, alpha, gain, spread, src, dst, stress, degree, leader, target, F, Q, prior, kept
    ):
        links, agents, ticks = len(src), len(degree), len(target) - 1
        FP, moved = np.empty((3, 3)), np.empty((6, 6))
        for run in range(len(seeds)):
            position, velocity, steered = target[0].copy(), np.zeros((agents, 2)), np.empty((agents, 2))
            heard, known = np.zeros((links, 2)), np.zeros(links, dtype=np.bool_)
            x, P, ahead = np.zeros((links, 6)), np.zeros((links, 6, 6)), np.empty(6)
            for edge in range(links):
                for row in range(6):
                    P[edge, row, row] = prior[row // 2] * prior[row // 2]
            for agent in range(agents):
                if not leader[agent]:
                    x0, x1, x2, x3 = drawn(seeds[run], 0, agent + 1, 0, start_draw)
                    position[agent, 0] += spread * ndtri(unit(x0, x1))
                    position[agent, 1] += spread * ndtri(unit(x2, x3))
            for tick in range(ticks):
                steered[:] = 0.0
                for edge in range(links):
                    of, by, here, cov = src[edge], dst[edge], x[edge], P[edge]
                    for axis in range(2):
                        for order in range(3):
                            ahead[2 * order + axis] = 0.0
                            for higher in range(order, 3):
                                ahead[2 * order + axis] += F[order, higher] * here[2 * higher + axis]
                        for other in range(2):
                            for row in range(3):
                                for column in range(3):
                                    FP[row, column] = 0.0
                                    for higher in range(row, 3):
                                        FP[row, column] += F[row, higher] * cov[2 * higher + axis, 2 * column + other]
                            for row in range(3):
                                for column in range(3):
                                    total = Q[row, column] if axis == other else 0.0
                                    for higher in range(column, 3):
                                        total += FP[row, higher] * F[column, higher]
                                    moved[2 * row + axis, 2 * column + other] = total
                    x0, x1, _, _ = drawn(seeds[run], tick, of + 1, by + 1, loss_draw)
                    seen = unit(x0, x1) >= loss
                    if seen:
                        x0, x1, x2, x3 = drawn(seeds[run], tick, of + 1, by + 1, noise_draw)
                        a, b = moved[0, 0] + sigma * sigma, moved[0, 1]
                        c, d = moved[1, 0], moved[1, 1] + sigma * sigma
                        off0 = position[by, 0] - position[of, 0] + sigma * ndtri(unit(x0, x1)) - ahead[0]
                        off1 = position[by, 1] - position[of, 1] + sigma * ndtri(unit(x2, x3)) - ahead[1]
                        by_det = 1.0 / (a * d - b * c)
                        for row in range(6):
                            k0 = (moved[row, 0] * d - moved[row, 1] * c) * by_det
                            k1 = (moved[row, 1] * a - moved[row, 0] * b) * by_det
                            here[row] = ahead[row] + k0 * off0 + k1 * off1
                            for column in range(6):
                                cov[row, column] = moved[row, column] - k0 * moved[0, column] - k1 * moved[1, column]
                        known[edge] = True
                        heard[edge] = velocity[of]
                    else:
                        here[:] = ahead
                        cov[:] = moved
                    for axis in range(2):
                        kept[tick, run, edge, axis] = here[axis]
                        pull = heard[edge, axis] - (alpha * here[axis] if known[edge] else 0.0)
                        steered[by, axis] += stress[edge] * pull
                for agent in range(agents):
                    for axis in range(2):
                        if leader[agent]:
                            goal = target[tick, agent, axis]
                            velocity[agent, axis] = (target[tick + 1, agent, axis] - goal) / dt + gain * (
                                goal - position[agent, axis]
                            )
                        else:
                            velocity[agent, axis] = steered[agent, axis] / degree[agent]
                        position[agent, axis] += dt * velocity[agent, axis]

    return fly
