"""Targets, agents that watch them, and what a textbook says of what they find."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from briefs import brief
from scipy.linalg import expm

from agents.brief import Own
from agents.estimate import Estimate
from agents.estimators.target import TargetEstimator
from agents.exchange import Heard
from analysis.models.information import unpacked
from analysis.models.pursuit import Sighting, Target
from netem.core.channels import TARGET
from world.physics.detectors import Detectors
from world.physics.target import MovingTarget

ORDERS = pytest.mark.parametrize("order", [1, 2, 3, 4])


def at_random(methods):
    """Detectors that choose one of so many methods, all alike, and see their target."""
    return Detectors(np.full(methods, 1.0 / methods), None, 0.0, 0.0, 0.0)


def target_of(order=2, latencies=(20, 10), variances=(0.01, 0.1), intensity=1.0):
    return Target(order, intensity, np.array(latencies), np.array(variances))


def driven(order, intensity):
    """A and B W B' of a chain of integrators."""
    noise = np.zeros((order, order))
    noise[-1, -1] = intensity
    return np.eye(order, k=1), noise


@cache
def van_loan(order, intensity, seconds):
    """A_d and W_d from one matrix exponential."""
    A, noise = driven(order, intensity)
    whole = expm(seconds * np.block([[-A, noise], [np.zeros((order, order)), A.T]]))
    forward = whole[order:, order:].T
    return forward, forward @ whole[:order, order:]


class Tick(NamedTuple):
    """What came of a tick of an agent, or of many."""

    truth: np.ndarray
    sighting: Sighting
    before: object
    state: object
    estimate: Estimate


def drive_of(chase_of, tick, seeds, swarms=1):
    """What noise does to targets in a tick."""
    return chase_of.drive(np.array([tick]), seeds, swarms)[0]


def watch(estimator, target, *, dt=0.05, ticks=100, runs=1, seed=0, dimension=2, prior=(1.0, 1.0)):
    """Agents, each after a target of its own, whose start is drawn as the prior says."""
    rng = np.random.default_rng(seed)
    chase_of = MovingTarget(
        target, dt, np.zeros((target.order, dimension)), target.intensity, None, at_random(len(target.latencies))
    )
    seeds, first = np.arange(1, runs + 1, dtype=np.uint64) + np.uint64(1000 * seed), np.ones(runs, dtype=np.int64)
    deviations = np.array([prior[0]] + [prior[1]] * (target.order - 1))[:, None]
    start = deviations * rng.normal(size=(runs, target.order, dimension))
    chase = chase_of.begin(runs, runs)._replace(target=start)
    alone = replace(brief(np.zeros((runs, 1, dimension))), dt=dt, target=target)
    state = estimator.init(alone, (runs,))
    heard = {
        channel: Heard({name: np.zeros((runs, 1, *field.shape)) for name, field in fields.items()}, alone.present)
        for channel, fields in estimator.channels(alone).items()
    }
    nothing = np.zeros((runs, dimension))
    for tick in range(ticks):
        sighting = chase_of.sighting(tick, seeds, first, chase)
        before, _ = estimator.sense(alone, state, alone.relative, alone.present)
        state, estimate = estimator.fuse(alone, before, heard, Own(nothing, nothing, tick, sighting=sighting))
        yield Tick(chase.target, sighting, before, state, estimate)
        chase = chase_of.step(tick, seeds, first, chase, drive_of(chase_of, tick, seeds, runs))


def informed(flown, order=2, dimension=2):
    """Mean and covariance that the information of ticks stands for."""
    Q, y = unpacked(np.stack([tick.estimate.reports["information"][:, 0] for tick in flown]), dimension, order)
    return np.linalg.solve(Q, y), np.linalg.inv(Q)


class Textbook:
    """The optimal estimates of one agent (5) and what follows from them (6), (7), number by number, axis by axis."""

    def __init__(self, sightings, target, dt, agent=0):
        self.target, self.dt, order = target, dt, target.order
        done = [0] + [tick for tick, sighting in enumerate(sightings) if sighting.done[agent]]
        axes = sightings[0].position.shape[-1]
        self.times, self.methods = done, [int(sightings[tick].method[agent]) for tick in done]
        self.means, self.covariances = [np.zeros((order, axes))], [np.eye(order)]  # the prior
        for (begun, over), method in zip(pairwise(done), self.methods, strict=False):
            assert over - begun == target.latencies[method]
            z, R = sightings[over].position[agent], target.variances[method]
            A, W = van_loan(order, target.intensity, (over - begun) * dt)
            x, P = self.means[-1], self.covariances[-1]
            # A measurement is taken in, and the posterior predicted to the time when it is known.
            gain = P[:, 0] / (P[0, 0] + R)
            mean = np.zeros_like(x)
            for axis in range(axes):
                mean[:, axis] = A @ (x[:, axis] + gain * (z[axis] - x[0, axis]))
            self.means.append(mean)
            self.covariances.append(A @ (P - np.outer(gain, P[0])) @ A.T + W)

    def latest(self, seconds):
        """Which estimate is the newest at a time, the later one at a detection."""
        return max(k for k, tick in enumerate(self.times) if tick * self.dt <= seconds + 1e-9)

    def predicted(self, k, seconds):
        A, W = van_loan(self.target.order, self.target.intensity, seconds - self.times[k] * self.dt)
        return A @ self.means[k], A @ self.covariances[k] @ A.T + W

    def smooth(self, seconds, alpha, k=None):
        """Information matrix and vector (7) at any time."""
        k = self.latest(seconds) if k is None else k
        information = []
        for number in (max(k - 1, 0), k):
            mean, P = self.predicted(number, seconds)
            information.append((np.linalg.inv(P), np.linalg.inv(P) @ mean))
        latency = self.target.latencies[self.methods[k]] * self.dt
        tau, power = (seconds - self.times[k] * self.dt) / latency, self.target.order + 1
        eta = tau**power / (tau**power + (alpha * (1 - tau)) ** power) if k else 1.0
        return tuple((1 - eta) * old + eta * new for old, new in zip(*information, strict=True))


OPTIMAL = TargetEstimator(output="optimal", fusion="none")
SMOOTH = TargetEstimator(fusion="none")


@cache
def agreed(seconds=0.526, dt=1e-3, latencies=(400, 200), order=2, **parameters):
    """Three agents in a triangle whose detections are theirs: what each says, tick by tick."""
    target = target_of(order, latencies)
    estimator = TargetEstimator(theta=10.0, **parameters)
    chase_of, who = (
        MovingTarget(target, dt, np.zeros((order, 2)), target.intensity, None, at_random(len(target.latencies))),
        np.array([1, 2, 3]),
    )
    chase, neighbours = chase_of.begin(1, 3), np.array([[1, 2], [0, 2], [0, 1]])
    agents = replace(brief(np.ones((3, 2, 2))), dt=dt, target=target)
    state, flown, nothing = estimator.init(agents, (3,)), [], np.zeros((3, 2))
    for tick in range(round(seconds / dt)):
        sighting = chase_of.sighting(tick, 5, who, chase)
        state, said = estimator.sense(agents, state, agents.relative, agents.present)
        heard = {TARGET: Heard({"information": said[TARGET]["information"][neighbours]}, agents.present)}
        state, estimate = estimator.fuse(agents, state, heard, Own(nothing, nothing, tick, sighting=sighting))
        flown.append((state, estimate, sighting, said))
        chase = chase_of.step(tick, 5, who, chase, drive_of(chase_of, tick, 5))
    return flown
