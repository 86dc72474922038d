"""What all Monte-Carlo peers compute: RKF on every edge of `corridor`, which closes the loop of formation control.

In each tick every link is measured with noise, and lost at random, the measurement and the velocity of the neighbour together;
each edge has a Kalman filter of a constant acceleration; followers steer by the stress, leaders by the manoeuvre.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from scipy.special import ndtri

from affinet.planning import making
from affinet.planning.plan import Plan
from affinet.scenario import loading
from agents.algebra import kalman
from agents.estimators.rkf import RelativeKalmanFilter
from agents.laws.single import VaryingVelocity
from analysis.models.arrays import Array, Integers, Mask
from netem.core.draws import Purpose, uniform

PATIENCE_S = 60.0


@dataclass(frozen=True)
class Swarm:
    """The numbers of a scenario, as who writes a simulation of his own would have them.

    Parameters
    ----------
    dt, sigma, loss, alpha, leader_gain, spread
        Tick, in seconds; deviation of measurements, in metres; probability of a loss; gains, per second; scatter, in metres.
    src, dst
        Links from one agent's row to another's, shape (L,).
    stress
        Of the links, shape (L,).
    degree
        Sum of the stress of each agent's links, shape (N,).
    leader
        Shape (N,).
    target
        Where the manoeuvre wants the agents, shape (T + 1, N, D), in metres.
    F, Q
        Of the derivatives of one axis, shape (3, 3).
    prior
        Deviations of position, velocity and acceleration before the first measurement.
    """

    dt: float
    sigma: float
    loss: float
    alpha: float
    leader_gain: float
    spread: float
    src: Integers
    dst: Integers
    stress: Array
    degree: Array
    leader: Mask
    target: Array
    F: Array
    Q: Array
    prior: Array

    @property
    def ticks(self) -> int:
        """How many there are."""
        return len(self.target) - 1


def planned(scenario: str, ticks: int, *overrides: str) -> Plan:
    """A shipped scenario for so many ticks, with RKF; a machine that is busy is no failure."""
    usual = (f"time.duration={ticks / 100:g}", f"time.patience={PATIENCE_S:g}", "agents.estimator='rkf'")
    return making.make(loading.load(scenario, [*usual, *overrides]))


def numbers(plan: Plan) -> Swarm:
    """Those of a plan that flies RKF and the varying-velocity law through independent losses."""
    world, given = plan.world, plan.scenario
    rkf, law = plan.estimator.build(), plan.law.build()
    assert isinstance(rkf, RelativeKalmanFilter)
    assert isinstance(law, VaryingVelocity)
    links, (layer,) = world.links, plan.profiles[0].chains
    F, Q = kalman.motion(rkf.model, world.dt, rkf.sigma_w)
    return Swarm(
        dt=world.dt,
        sigma=float(world.sensor.covariance[0, 0]) ** 0.5,
        loss=float(layer.loss[0, 0]),
        alpha=law.alpha,
        leader_gain=given.agents.leader_gain,
        spread=world.spread,
        src=links.src - 1,
        dst=links.dst - 1,
        stress=plan.brief.stress[links.present],
        degree=plan.brief.degree,
        leader=world.formation.is_leader,
        target=world.target(np.arange(world.ticks + 1)),
        F=F,
        Q=Q,
        prior=np.array([rkf.prior_position, rkf.prior_velocity, rkf.prior_acceleration]),
    )


class Draws(Protocol):
    """Random numbers of runs side by side."""

    def start(self, swarm: Swarm) -> Array:
        """Standard normal, of the agents before the first tick, shape (R, N, D)."""

    def tick(self, swarm: Swarm, tick: int) -> tuple[Array, Mask]:
        """Standard normal, of the measurements of a tick, shape (R, L, D); and what is not lost, shape (R, L)."""


class Generated:
    """As most would draw them."""

    def __init__(self, runs: int) -> None:
        self._runs, self._rng = runs, np.random.default_rng(1)

    def start(self, swarm: Swarm) -> Array:
        """Standard normal."""
        return self._rng.standard_normal((self._runs, len(swarm.degree), 2))

    def tick(self, swarm: Swarm, tick: int) -> tuple[Array, Mask]:  # noqa: ARG002
        """Normal and uniform draws."""
        links = (self._runs, len(swarm.src))
        return self._rng.standard_normal((*links, 2)), self._rng.random(links) >= swarm.loss


class Counted:
    """Those of affinet's runs with these seeds, to see that all compute the same."""

    def __init__(self, seeds: Sequence[int]) -> None:
        self._seeds = np.array(seeds, dtype=np.uint64)[:, None]

    def start(self, swarm: Swarm) -> Array:
        """Of the initial positions."""
        numbers = np.arange(1, len(swarm.degree) + 1)
        return np.asarray(ndtri(uniform(self._seeds, Purpose.INITIAL_POSITION, src=numbers, lanes=2)))

    def tick(self, swarm: Swarm, tick: int) -> tuple[Array, Mask]:
        """Of sensors and links."""
        of: dict[str, Any] = {"tick": tick, "src": swarm.src + 1, "dst": swarm.dst + 1}
        noise = np.asarray(ndtri(uniform(self._seeds, Purpose.SENSOR_NOISE, **of, lanes=2)))
        return noise, uniform(self._seeds, Purpose.LOSS, **of)[..., 0] >= swarm.loss
