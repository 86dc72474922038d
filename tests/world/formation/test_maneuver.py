"""Manoeuvres: the corridor of the benchmark, the ravine, keyframes, hovering."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.models.affine import Manoeuvre
from world.formation.manoeuvre import corridor, hover, keyframes, narrowest, ravine, turned
from world.formation.nominal import PRESETS

NOMINAL = 2.0 * PRESETS["zhao7"].nominal
OCTA10 = PRESETS["octa10"].nominal
DIAGONAL = np.sqrt(0.5)


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


def test_ravine_starts_at_the_nominal_formation_of_octa10():
    begun = ravine(np.array([0.0]))
    np.testing.assert_array_equal(begun.theta[0], np.eye(3))
    np.testing.assert_array_equal(begun.offset[0], np.zeros(3))
    np.testing.assert_array_equal(begun.target(0, OCTA10), OCTA10)


@pytest.mark.parametrize(
    ("seconds", "theta", "offset"),
    [
        # Speed that rises along half a cosine from 0 to 1 m/s in T covers t / 2 - T / (2 pi) sin(pi t / T) m.
        (4.0, np.eye(3), [2 - 4 / np.pi, 0, (1 - 3 / np.pi) / 4]),
        (9.0, np.eye(3), [5, 0, 1.5]),
        (16.0, np.diag([1, 0.7, 1]), [12, 0, 5 - (1 - 3 / np.pi) / 4]),
        (24.0, np.diag([1, 0.4, 1]), [20, 0, 6]),
        (28.0, np.diag([1, 0.7, 1]), [24, 0, 6]),
        (34.0, np.eye(3), [30, 0, 6]),
        (39.0, [[DIAGONAL, DIAGONAL, 0], [-DIAGONAL, DIAGONAL, 0], [0, 0, 1]], [32.5 + 5 / np.pi, -2.5 + 5 / np.pi, 6]),
        (47.0, [[0, 1, 0], [-1, 0, 0], [0, 0, 0.5]], [35, -8, 6]),
        (51.0, [[0, 1, 0], [-1, 0, 0], [0, 0, 0]], [35, -12, 6]),
        (56.0, [[0, 1, 0], [-1, 0, 0], [0, 0, 0.5]], [35, -17, 6]),
        (60.0, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], [35, -21, 6]),
    ],
)
def test_ravine_passes_its_checkpoints(seconds, theta, offset):
    flown = ravine(np.array([seconds]))
    np.testing.assert_allclose(flown.theta[0], theta, atol=0.01)
    np.testing.assert_allclose(flown.offset[0], offset, atol=1e-9)


def test_ravine_flies_everybody_through_a_slot_and_under_a_ceiling():
    seconds = np.array([21.0, 51.0])
    slot, ceiling = ravine(seconds).target(np.arange(2)[:, None], OCTA10)
    assert np.abs(slot[:, 1]).max() < 0.41 * np.abs(OCTA10[:, 1]).max()
    np.testing.assert_allclose(ceiling[:, 2], 6.0, atol=0.01)
    singular = np.linalg.svd(ravine(seconds).theta[1], compute_uv=False)
    assert singular[1] > 0.99
    assert singular[2] < 0.01 * singular[0]


def test_ravine_ends_after_a_quarter_turn():
    arrived = ravine(np.array([60.0])).target(0, OCTA10)
    np.testing.assert_allclose(arrived[[0, 2, 4]], [[35, -23, 6], [37, -21, 6], [35, -21, 8]], atol=0.01)


def test_ravine_moves_without_jumps_in_velocity():
    dt = 0.01
    targets = ravine(np.arange(0, 62, dt)).target(np.arange(6200)[:, None], OCTA10)
    assert np.linalg.norm(np.diff(targets, axis=0), axis=-1).max() < 2.0 * dt
    assert np.linalg.norm(np.diff(targets, n=2, axis=0), axis=-1).max() < dt**2  # 1 m/s2


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


IDENTITY, STILL = np.repeat(np.eye(2)[None], 2, axis=0), np.zeros((2, 2))
HALF_A_TURN = np.array([np.eye(2), -np.eye(2)])
QUARTER_TURN = np.array([np.eye(2), [[0.0, -1.0], [1.0, 0.0]]])


@pytest.mark.parametrize("turns", [0.5, 1.0, -1.0, 3.0])
def test_an_angle_turns_the_formation_which_keeps_its_shape_on_the_way(turns):
    angle = np.array([0.0, turns * 2.0 * np.pi])
    flown = keyframes(np.linspace(0.0, 10.0, 101), [0.0, 10.0], IDENTITY, STILL, angle)
    np.testing.assert_allclose(np.linalg.svd(flown.theta, compute_uv=False), 1.0, atol=1e-12)
    heading = np.unwrap(np.arctan2(flown.theta[:, 1, 0], flown.theta[:, 0, 0]))
    assert heading[-1] - heading[0] == pytest.approx(angle[1])
    assert heading[50] == pytest.approx(angle[1] / 2)
    assert (np.diff(heading) * np.sign(turns) >= 0.0).all()
    # A Hermite cubic from rest to rest is fastest in the middle, at 3/2 of its mean speed.
    speed = np.linalg.norm(flown.velocity(50, np.array([1.0, 0.0]), 0.1))
    assert speed == pytest.approx(1.5 * abs(angle[1]) / 10.0, rel=0.02)


def test_an_angle_turns_about_the_vertical_what_theta_makes():
    theta = np.repeat(np.diag([2.0, 1.0, 0.5])[None], 2, axis=0)
    flown = keyframes(np.array([0.0, 4.0]), [0.0, 4.0], theta, np.zeros((2, 3)), np.array([0.0, np.pi / 2]))
    np.testing.assert_allclose(flown.theta[1], [[0, -1, 0], [2, 0, 0], [0, 0, 0.5]], atol=1e-12)


@pytest.mark.parametrize(
    ("theta", "share"),
    [
        (HALF_A_TURN, 0.0),
        (QUARTER_TURN, np.sqrt(0.5)),
        (IDENTITY, 1.0),
        (np.array([np.eye(2), np.diag([1.0, 0.5])]), 1.0),
        (np.array([np.eye(2), np.diag([1.0, 0.0])]), 1.0),  # a line is what was asked for
    ],
)
def test_entries_that_go_straight_narrow_a_formation_that_turns(theta, share):
    assert narrowest([0.0, 1.0], theta) == pytest.approx(share, abs=1e-9)


def test_turns_are_told_from_keyframe_to_keyframe():
    assert turned(QUARTER_TURN, np.zeros(2)) == pytest.approx(np.pi / 2)
    assert turned(IDENTITY, np.array([0.0, 2 * np.pi])) == pytest.approx(2 * np.pi)
    about_x = np.array([np.eye(3), [[1, 0, 0], [0, 0, -1], [0, 1, 0]]])
    assert turned(about_x, np.zeros(2)) == pytest.approx(np.pi / 2)


def test_target_of_many_ticks_is_the_target_of_each():
    flown, nominal = corridor(np.arange(0.0, 60.0, 7.0)), NOMINAL
    each = [flown.theta[k] @ p + flown.offset[k] for k in (1, 4) for p in nominal]
    np.testing.assert_allclose(flown.target(np.array([[1], [4]]), nominal), np.reshape(each, (2, 7, 2)), atol=1e-13)


def test_velocity_carries_the_target_of_this_tick_to_the_next():
    flown = corridor(np.arange(0.0, 60.0, 0.5))
    arrived = flown.target(40, NOMINAL) + 0.5 * flown.velocity(40, NOMINAL, 0.5)
    np.testing.assert_allclose(arrived, flown.target(41, NOMINAL), atol=1e-12)


def test_velocities_and_accelerations_have_the_bits_of_differences_of_targets():
    ticks = np.arange(-3, len(FLOWN.offset) + 3)[:, None]
    before, here, after = (FLOWN.target(ticks + step, NOMINAL) for step in (-1, 0, 1))
    velocity, gained = (after - here) / 0.3, (here - before) / 0.3
    np.testing.assert_array_equal(FLOWN.velocity(ticks, NOMINAL, 0.3), velocity)
    np.testing.assert_array_equal(FLOWN.acceleration(ticks, NOMINAL, 0.3), (velocity - gained) / 0.3)
    assert velocity.any()


def test_acceleration_is_what_the_velocity_gains():
    # Offsets that grow with the square of the tick, and a scale that grows with its cube.
    ticks = np.arange(6.0)
    curve = Manoeuvre(ticks[:, None, None] ** 3 * np.eye(2), ticks[:, None] ** 2 * [1.0, -2.0])
    nominal = np.array([[1.0, 0.0], [0.0, 2.0]])
    gained = np.array([[2.0 + 6 * 3, -4.0], [2.0, -4.0 + 12 * 3]])
    np.testing.assert_allclose(curve.acceleration(3, nominal, 0.5), gained / 0.5**2)
    np.testing.assert_allclose(curve.acceleration(np.array([[3], [2]]), nominal, 0.5)[0], gained / 0.5**2)


def test_a_manoeuvre_starts_from_rest_and_ends_at_rest_at_once():
    moving = corridor(np.arange(10.0, 30.0, 0.5))
    last = len(moving.theta) - 1
    first, final = moving.velocity(0, NOMINAL, 0.5), moving.velocity(last - 1, NOMINAL, 0.5)
    assert (np.linalg.norm([first, final], axis=-1) > 0.5).all()
    np.testing.assert_allclose(moving.acceleration(0, NOMINAL, 0.5), first / 0.5)
    np.testing.assert_allclose(moving.acceleration(last, NOMINAL, 0.5), -final / 0.5)


FLOWN = keyframes(np.arange(0.0, 21.0, 0.5), TIMES, THETA, OFFSET)
LAST = len(FLOWN.theta) - 1


def test_before_its_first_tick_a_manoeuvre_rests():
    begun = FLOWN.target(0, NOMINAL)
    assert (begun != FLOWN.target(LAST, NOMINAL)).any()
    for early in (-1, -1000):
        np.testing.assert_array_equal(FLOWN.target(early, NOMINAL), begun)
        np.testing.assert_array_equal(FLOWN.velocity(early, NOMINAL, 0.5), 0.0)


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
