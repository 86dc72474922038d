"""Manoeuvres: the corridor of the benchmark, keyframes, hovering."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from world.formation import PRESETS
from world.maneuver import corridor, hover, keyframes

NOMINAL = 2.0 * PRESETS["zhao7"].nominal


@pytest.mark.parametrize(
    ("seconds", "theta", "offset"),
    [
        (0.0, [[1, 0], [0, 1]], [0, 0]),
        (25.0, [[1, 0], [0, 0.501]], [17.5, 0]),
        (55.0, [[0.501, 0.499], [-0.499, 0.501]], [41.998, 1.089]),
        (100.0, [[-1.185, -0.187], [0, -0.498]], [28.74, -17.5]),
    ],
)
def test_corridor_passes_the_checkpoints_of_the_benchmark(seconds, theta, offset):
    flown = corridor(np.array([seconds]))
    np.testing.assert_allclose(flown.theta[0], theta, atol=2e-3)
    np.testing.assert_allclose(flown.offset[0], offset, atol=2e-3)


def test_corridor_flies_on_a_line_from_110_to_120_seconds():
    singular = np.linalg.svd(corridor(np.linspace(110, 120, 21)).theta, compute_uv=False)
    assert (singular[:, 1] < 2e-3).all()
    assert (singular[:, 0] > 1.0).all()


def test_corridor_starts_at_twice_the_nominal_formation_of_zhao7():
    np.testing.assert_allclose(corridor(np.array([0.0])).target(0, NOMINAL), NOMINAL, atol=1e-12)


def test_corridor_passes_between_the_walls():
    targets = corridor(np.arange(0, 125, 0.05)).target(np.arange(2500)[:, None], NOMINAL)
    for x, y, width, height in ([18, 1.8, 5, 15], [18, -16.5, 5, 14.5], [18, -25, 5, 6.5]):
        within = (targets >= [x, y]) & (targets <= [x + width, y + height])
        assert not within.all(axis=-1).any()


def test_corridor_moves_without_jumps():
    step = np.diff(corridor(np.arange(0, 130, 0.01)).target(np.arange(13000)[:, None], NOMINAL), axis=0)
    assert 0.01 < np.linalg.norm(step, axis=-1).max() < 0.05  # at most 5 m/s


def test_hover_holds_the_nominal_formation():
    still = hover(np.arange(5.0), 3)
    nominal = np.random.default_rng(1).normal(size=(6, 3))
    np.testing.assert_array_equal(still.target(np.arange(5)[:, None], nominal), np.broadcast_to(nominal, (5, 6, 3)))
    np.testing.assert_array_equal(still.velocity(2, nominal, 0.1), np.zeros((6, 3)))


THETA = np.array([np.eye(2), [[1.0, 0.0], [0.0, 0.5]], [[0.0, 1.0], [-1.0, 0.0]], [[0.0, 2.0], [-2.0, 0.0]]])
OFFSET = np.array([[0.0, 0.0], [10.0, 0.0], [20.0, -4.0], [5.0, -4.0]])
TIMES = [2.0, 5.0, 9.0, 20.0]


def test_keyframes_are_hit():
    flown = keyframes(np.array(TIMES), TIMES, THETA, OFFSET)
    np.testing.assert_allclose(flown.theta, THETA, atol=1e-14)
    np.testing.assert_allclose(flown.offset, OFFSET, atol=1e-14)


def test_keyframes_rest_before_the_first_and_after_the_last():
    flown = keyframes(np.array([0.0, 1.0, 2.0, 20.0, 21.0, 99.0]), TIMES, THETA, OFFSET)
    np.testing.assert_allclose(flown.theta, np.repeat(THETA[[0, -1]], 3, axis=0), atol=1e-14)
    np.testing.assert_allclose(flown.offset, np.repeat(OFFSET[[0, -1]], 3, axis=0), atol=1e-14)


@settings(deadline=None, derandomize=True, database=None, max_examples=50)
@given(st.lists(st.floats(-10, 10), min_size=2, max_size=6))
def test_keyframes_do_not_overshoot(values):
    times = np.arange(len(values), dtype=float)
    seconds = np.arange(0, len(values) - 1, 1 / 16)
    offset = np.array(values)[:, None] * [1.0, -1.0]
    flown = keyframes(seconds, times, np.ones((len(values), 2, 2)), offset).offset
    before, after = offset[seconds.astype(int)], offset[seconds.astype(int) + 1]
    assert (flown >= np.minimum(before, after) - 1e-12).all()
    assert (flown <= np.maximum(before, after) + 1e-12).all()


def test_keyframes_fly_at_a_continuous_velocity():
    dt = 1e-3
    velocity = np.diff(keyframes(np.arange(3.0, 19.0, dt), TIMES, THETA, OFFSET).offset, axis=0) / dt
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.05


def test_keyframes_leave_rest_and_come_to_rest_at_a_continuous_velocity():
    dt = 1e-3
    velocity = np.diff(keyframes(np.arange(0.0, 25.0, dt), TIMES, THETA, OFFSET).offset, axis=0) / dt
    assert np.abs(np.diff(velocity, axis=0)).max() < 0.05


def test_target_of_many_ticks_is_the_target_of_each():
    flown, nominal = corridor(np.arange(0.0, 60.0, 7.0)), NOMINAL
    each = [flown.theta[k] @ p + flown.offset[k] for k in (1, 4) for p in nominal]
    np.testing.assert_allclose(flown.target(np.array([[1], [4]]), nominal), np.reshape(each, (2, 7, 2)), atol=1e-13)


def test_velocity_carries_the_target_of_this_tick_to_the_next():
    flown = corridor(np.arange(0.0, 60.0, 0.5))
    arrived = flown.target(40, NOMINAL) + 0.5 * flown.velocity(40, NOMINAL, 0.5)
    np.testing.assert_allclose(arrived, flown.target(41, NOMINAL), atol=1e-12)


FLOWN = keyframes(np.arange(0.0, 21.0, 0.5), TIMES, THETA, OFFSET)
LAST = len(FLOWN.theta) - 1


def test_after_its_last_tick_a_manoeuvre_rests():
    arrived = FLOWN.target(LAST, NOMINAL)
    assert (arrived != FLOWN.target(LAST - 4, NOMINAL)).any()
    for late in (LAST + 1, LAST + 1000):
        np.testing.assert_array_equal(FLOWN.target(late, NOMINAL), arrived)
        np.testing.assert_array_equal(FLOWN.velocity(late, NOMINAL, 0.5), 0.0)


def test_the_last_step_is_flown_and_the_next_is_none():
    moving = corridor(np.arange(0.0, 30.0, 0.5))
    last = len(moving.theta) - 1
    assert (moving.velocity(last - 1, NOMINAL, 0.5) != 0.0).any()
    np.testing.assert_array_equal(moving.velocity(last, NOMINAL, 0.5), 0.0)


def test_agents_whose_clocks_differ_have_the_targets_of_their_own_ticks():
    reading = np.array([0, 3, 20, LAST - 1, LAST, LAST + 5, 7])
    target, velocity = FLOWN.target(reading, NOMINAL), FLOWN.velocity(reading, NOMINAL, 0.5)
    assert target.shape == velocity.shape == NOMINAL.shape
    for agent, tick in enumerate(reading.tolist()):
        assert target[agent].tobytes() == FLOWN.target(tick, NOMINAL[agent]).tobytes()
        assert velocity[agent].tobytes() == FLOWN.velocity(tick, NOMINAL[agent], 0.5).tobytes()
    assert (target != FLOWN.target(3, NOMINAL)).any(axis=1).tolist() == [False, False, True, True, True, True, True]
