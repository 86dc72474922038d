"""The target: how it drifts and spreads over a tick, and what detectors say of it, how late."""

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from flying import plan_of
from pursuits import COARSE, NAME
from targets import target_of, van_loan

from affinet.runtimes.run import rehearse
from world.physics.target import MovingTarget


def step_of(target, dt=0.1, start=None, swarms=20_000, tick=3):
    start = np.zeros((target.order, 2)) if start is None else start
    chase_of = MovingTarget(target, dt, start)
    seeds, first = np.arange(swarms, dtype=np.uint64), np.ones(swarms, dtype=np.int64)
    return chase_of.step(tick, seeds, first, chase_of.begin(swarms, swarms)).target


@pytest.mark.parametrize("order", [1, 2, 3])
def test_over_a_tick_a_target_drifts_and_spreads_as_its_equation_says(order):
    start = np.random.default_rng(order).normal(size=(order, 2))
    target = target_of(order, intensity=2.0)
    moved = step_of(target, start=start)
    A, W = van_loan(order, 2.0, 0.1)
    deviation = np.sqrt(np.diag(W))[:, None]
    off = (moved - A @ start) / deviation
    assert np.abs(off.mean(axis=0)).max() < 4.5 / np.sqrt(len(off))
    scale = np.outer(deviation, deviation)
    for axis in range(2):
        np.testing.assert_allclose(np.cov(off[..., axis].T).reshape(order, order), W / scale, atol=0.04)
    # Axes are independent, and so are ticks.
    across = np.einsum("sid,sje->idje", off, off)[:, 0, :, 1] / len(off)
    assert np.abs(across).max() < 4.5 / np.sqrt(len(off))
    later = (step_of(target, start=start, tick=4) - A @ start) / deviation
    assert np.abs((off * later).mean(axis=0)).max() < 4.5 / np.sqrt(len(off))


def test_without_noise_a_target_keeps_its_velocity():
    start = np.array([[1.0, 2.0], [0.5, -1.0]])
    moved = step_of(target_of(intensity=0.0), start=start, swarms=3)
    np.testing.assert_allclose(moved, np.broadcast_to([start[0] + 0.1 * start[1], start[1]], (3, 2, 2)))
    run = rehearse(
        plan_of(
            NAME, *COARSE, "time.duration=0.3", "target.intensity=0", "target.position=[1,2]", "target.velocity=[3,0]"
        )
    )
    centre = run.arrays["target"] - run.plan.world.formation.nominal
    expected = np.array([1.0, 2.0]) + np.arange(30)[:, None] * 0.01 * np.array([3.0, 0.0])
    np.testing.assert_allclose(centre, np.broadcast_to(expected[:, None], centre.shape), atol=1e-12)


class Detection(NamedTuple):
    """Which agent's detector, when it began and was done, by which method, and how far off it was."""

    agent: int
    begun: int
    over: int
    method: int
    off: np.ndarray


@cache
def detections(agents=60, ticks=400):
    target = target_of(2, (7, 3), (0.04, 0.25))
    chase_of, who = MovingTarget(target, 0.05, np.zeros((2, 2))), np.arange(1, agents + 1)
    chase, made = chase_of.begin(1, agents), []
    began, method, where = np.zeros(agents, dtype=int), None, []
    for tick in range(ticks):
        said = chase_of.sighting(tick, 11, who, chase)
        where.append(chase.target[0, 0])
        for agent in np.flatnonzero(said.done).tolist():
            off = said.position[agent] - where[began[agent]]
            made.append(Detection(agent, int(began[agent]), tick, int(method[agent]), off))
            began[agent] = tick
        if method is not None:
            # A detector keeps its method until it is done.
            assert (said.done | (said.method == method)).all()
        else:
            assert not said.done.any()
        method = said.method
        chase = chase_of.step(tick, 11, who, chase)
    return made, target


def test_detections_are_done_a_latency_after_they_began():
    made, target = detections()
    assert len(made) > 3000
    for one in made:
        assert one.over - one.begun == target.latencies[one.method]
    # Not all together.
    assert len({tuple(each.over for each in made if each.agent == agent) for agent in range(10)}) == 10


def test_what_is_found_is_where_the_target_was_as_surely_as_the_method_says():
    made, target = detections()
    for method in range(2):
        off = np.array([one.off for one in made if one.method == method]) / np.sqrt(target.variances[method])
        assert np.abs(off.mean(axis=0)).max() < 4.5 / np.sqrt(len(off))
        np.testing.assert_allclose(np.cov(off.T), np.eye(2), atol=4.5 * np.sqrt(2 / len(off)))


def test_methods_are_about_equally_frequent_whatever_came_before():
    made, _ = detections()
    chosen = np.array([one.method for one in made])
    assert abs(chosen.mean() - 0.5) < 4 * 0.5 / np.sqrt(len(chosen))
    for agent in range(60):
        assert sum(one.agent == agent for one in made) > 10
    following = [
        (one.method, other.method)
        for agent in range(60)
        for one, other in pairwise(each for each in made if each.agent == agent)
    ]
    after = np.array([second for first, second in following if first == 0])
    assert abs(after.mean() - 0.5) < 4 * 0.5 / np.sqrt(len(after))
