"""The target: how it drifts and spreads over a tick, and what detectors say of it, how late."""

from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from flying import plan_of
from pursuits import ALONE, COARSE, NAME
from targets import at_random, drive_of, target_of, van_loan

from affinet.runtimes.rehearsing import rehearse
from world.formation.manoeuvre import course
from world.physics.target import MovingTarget


def step_of(target, dt=0.1, start=None, swarms=20_000, tick=3, intensity=None):
    start = np.zeros((target.order, 2)) if start is None else start
    chase_of = MovingTarget(
        target, dt, start, target.intensity if intensity is None else intensity, None, at_random(len(target.latencies))
    )
    seeds, first = np.arange(swarms, dtype=np.uint64), np.ones(swarms, dtype=np.int64)
    chase, drive = chase_of.begin(swarms, swarms), drive_of(chase_of, tick, seeds, swarms)
    return chase_of.step(tick, seeds, first, chase, drive).target


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


def test_what_drives_a_target_need_not_be_what_agents_take_it_for():
    driven = step_of(target_of(2, intensity=1.0), intensity=4.0, swarms=50)
    np.testing.assert_array_equal(driven, step_of(target_of(2, intensity=4.0), swarms=50))
    np.testing.assert_array_equal(step_of(target_of(2, intensity=1.0), intensity=0.0, swarms=50), np.zeros((50, 2, 2)))
    short = (NAME, *COARSE, "time.duration=0.3", ALONE)
    assumed, as_assumed, driven = (
        rehearse(plan_of(*short, *overrides)).arrays
        for overrides in ((), ("target.true_intensity=1",), ("target.true_intensity=4",))
    )
    np.testing.assert_array_equal(assumed["target"], as_assumed["target"])
    nominal = plan_of(*short).world.formation.nominal
    np.testing.assert_allclose(driven["target"] - nominal, 2 * (assumed["target"] - nominal), atol=1e-12)
    # Before a detection is done, agents are as sure of either.
    np.testing.assert_array_equal(driven["variance"][:9], assumed["variance"][:9])


def test_a_target_takes_the_path_it_is_given():
    points = "[{time=0.1,position=[1,2]},{time=0.3,position=[2,2]},{time=0.4,position=[2,5]}]"
    run = rehearse(plan_of(NAME, *COARSE, "time.duration=0.5", f"target.path={points}", ALONE))
    centre = (run.arrays["target"] - run.plan.world.formation.nominal)[:, 0]
    np.testing.assert_allclose(centre[[0, 10, 30, 40, 49]], [[1, 2], [1, 2], [2, 2], [2, 5], [2, 5]], atol=1e-12)
    assert ((centre[11:30, 0] > 1) & (centre[11:30, 0] < 2) & (centre[11:30, 1] == 2)).all()


def test_the_derivatives_along_a_course_are_those_of_its_position():
    seconds, points = np.arange(0.0, 1.0, 1e-4), np.array([[0.0, 1.0], [3.0, 1.0], [4.0, -1.0]])
    way = course(seconds, [0.2, 0.5, 0.9], points, 3)
    for order in (0, 1):
        slope = (way[2:, order] - way[:-2, order]) / 2e-4
        inside = np.all([np.abs(seconds[1:-1] - at) > 3e-4 for at in (0.2, 0.5, 0.9)], axis=0)
        np.testing.assert_allclose(slope[inside], way[1:-1, order + 1][inside], atol=1e-3)
    assert not way[seconds > 0.9][:, 1:].any()


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
    chase_of, who = (
        MovingTarget(target, 0.05, np.zeros((2, 2)), target.intensity, None, at_random(len(target.latencies))),
        np.arange(1, agents + 1),
    )
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
        chase = chase_of.step(tick, 11, who, chase, drive_of(chase_of, tick, 11))
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
