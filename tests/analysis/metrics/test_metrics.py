"""The tracking error of paper 000, eq. 15, and the measures of paper 004."""

import numpy as np
import pytest
from scipy.linalg import orthogonal_procrustes

from analysis.metrics.errors import (
    covariance_trace,
    estimation_error,
    procrustes_error,
    rate_of_fall,
    tick_flown,
    tracking_error,
)
from analysis.models.small import triangle

TARGET = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
POSITION = np.array([[3.0, 4.0], [1.0, 2.0], [1.0, 1.0]])  # 5 m, 2 m and 1 m off


def test_tracking_error_is_the_mean_squared_distance_to_the_target():
    assert tracking_error(POSITION, TARGET, np.array([True, True, True])) == pytest.approx((25 + 4 + 1) / 3)


def test_departed_agents_leave_the_mean():
    assert tracking_error(POSITION, TARGET, np.array([False, True, True])) == pytest.approx((4 + 1) / 2)


def test_an_agent_that_is_lost_in_space_does_not_matter_once_it_departed():
    lost = np.where([[True], [False], [False]], np.nan, POSITION)
    assert tracking_error(lost, TARGET, np.array([False, True, True])) == pytest.approx((4 + 1) / 2)


def test_tracking_error_of_nobody_is_not_a_number():
    assert np.isnan(tracking_error(POSITION, TARGET, np.array([False, False, False])))


def test_tracking_error_keeps_the_leading_axes():
    present = np.array([[True, True, True], [True, False, False], [False, False, False]])
    errors = tracking_error(np.stack([POSITION] * 3), TARGET, present)
    np.testing.assert_allclose(errors, [10.0, 25.0, np.nan])


def test_tracking_error_is_zero_on_target_in_three_dimensions():
    here = np.random.default_rng(1).normal(size=(5, 3))
    assert tracking_error(here, here, np.ones(5, dtype=bool)) == 0.0


# How far a swarm is from its shape, wherever it is

SQUARE = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
ALL = np.ones(4, dtype=bool)


def orthogonal(dimension, *, mirrored):
    Q, _ = np.linalg.qr(np.random.default_rng(dimension).normal(size=(dimension, dimension)))
    return Q * np.where(np.arange(dimension) == 0, (-1 if mirrored else 1) * np.sign(np.linalg.det(Q)), 1.0)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
def test_procrustes_error_of_a_turned_mirrored_and_moved_copy_is_zero(dimension, mirrored):
    nominal = np.random.default_rng(1).normal(size=(6, dimension))
    turn = orthogonal(dimension, mirrored=mirrored)
    assert np.linalg.det(turn) == pytest.approx(-1 if mirrored else 1)
    copy = nominal @ turn + np.arange(10.0, 10.0 + dimension)
    assert procrustes_error(copy, nominal, np.ones(6, dtype=bool)) == pytest.approx(0.0, abs=1e-13)
    assert procrustes_error(1.1 * copy, nominal, np.ones(6, dtype=bool)) > 0.01


def test_procrustes_error_by_hand():
    # No turn makes up for a stretch: of four agents each is 0.5 (1, 1) off, or half a metre to the side.
    away = np.array([7.0, -3.0])
    assert procrustes_error(1.5 * SQUARE + away, SQUARE, ALL) == pytest.approx(np.sqrt(4 * 0.5) / 4)
    assert procrustes_error(SQUARE * [1.5, 1.0] + away, SQUARE, ALL) == pytest.approx(np.sqrt(4 * 0.25) / 4)


@pytest.mark.parametrize("dimension", [2, 3])
def test_procrustes_error_is_that_of_scipys_best_turn(dimension):
    nominal, position = np.random.default_rng(dimension).normal(size=(2, 7, dimension))
    Z, P = position - position.mean(axis=0), nominal - nominal.mean(axis=0)
    turn, _ = orthogonal_procrustes(Z, P)
    expected = np.linalg.norm(Z @ turn - P) / 7
    assert procrustes_error(position, nominal, np.ones(7, dtype=bool)) == pytest.approx(expected)


def test_absent_agents_are_left_out_of_the_shape():
    present = np.array([True, True, False, True])
    for lost in (99.0, np.nan):
        position = np.where(present[:, None], SQUARE * [1.5, 1.0], lost)
        few = procrustes_error(position[present], SQUARE[present], ALL[:3])
        assert few > 0.1
        assert procrustes_error(position, SQUARE, present) == pytest.approx(few)


@pytest.mark.parametrize("lost", [np.nan, np.inf])
def test_a_shape_with_a_position_that_is_no_number_has_no_error_and_the_other_ticks_keep_theirs(lost):
    positions = np.stack([SQUARE, 1.5 * SQUARE, SQUARE])
    positions[0, 2, 1] = lost
    with np.errstate(invalid="ignore"):
        errors = procrustes_error(positions, SQUARE, np.stack([ALL] * 3))
    np.testing.assert_allclose(errors, [np.nan, np.sqrt(2) / 4, 0.0], atol=1e-14)


# Paths


def test_steps_along_a_line_do_not_change_and_those_that_turn_do():
    straight = np.array([[[0.0, 0.0]], [[1.0, 2.0]], [[2.0, 4.0]]])
    back = np.array([[[0.0, 0.0]], [[3.0, 4.0]], [[0.0, 0.0]]])
    both = np.concatenate([straight, back], axis=-2)

    def change(path, *present):
        still = np.zeros_like(path[0])
        return tick_flown(path, still, still, np.array(present)).change

    assert change(straight, True) == 0.0
    assert change(back, True) == pytest.approx(100.0)
    assert change(both, True, True) == pytest.approx(50.0)
    assert change(both, True, False) == 0.0
    assert np.isnan(change(both, False, False))


def test_a_tick_is_flown_with_the_tracking_error_and_the_longest_input():
    rng = np.random.default_rng(1)
    path, target, steered = rng.normal(size=(3, 50, 7, 3)), *rng.normal(size=(2, 50, 7, 3))
    present = rng.random((50, 7)) < 0.7
    tick = tick_flown(path, target, steered, present)
    np.testing.assert_array_equal(tick.error, tracking_error(path[2], target, present))
    np.testing.assert_allclose(tick.longest, np.linalg.norm(steered, axis=-1).max(axis=-1), rtol=1e-15)


@pytest.mark.parametrize("lost", [np.nan, np.inf, -np.inf])
def test_whoever_has_left_the_numbers_is_infinitely_far_unless_absent(lost):
    position, present = np.stack([POSITION] * 3), np.ones((3, 3), dtype=bool)
    position[1:, 2, 1] = lost
    present[2, 2] = False
    with np.errstate(invalid="ignore"):
        tick = tick_flown((position, position, position), TARGET, np.zeros((3, 3, 2)), present)
    np.testing.assert_allclose(tick.error, [10.0, np.inf, 14.5])


@pytest.mark.parametrize("agent", [0, 1, 2])
def test_an_input_that_is_no_number_is_the_longest(agent):
    steered = np.array([[3.0, 4.0], [1.0, 0.0], [6.0, 8.0]])
    assert tick_flown([POSITION] * 3, TARGET, steered, np.array([True] * 3)).longest == 10.0
    steered[agent, 0] = np.nan
    assert np.isnan(tick_flown([POSITION] * 3, TARGET, steered, np.array([True] * 3)).longest)


def test_rate_of_fall_is_that_of_an_exponential_and_nowhere_else_a_number():
    seconds = np.array([0.0, 1.0, 1.5, 3.0])
    falls = 5.0 * np.exp(-0.3 * seconds)
    error = np.stack([falls, 1.0 / falls, np.full(4, 2.0), [1.0, 0.0, np.e, 1.0], [1.0, np.inf, np.nan, 1.0]])
    rates = rate_of_fall(seconds, error)
    assert np.isnan(rates[:, 0]).all()
    np.testing.assert_allclose(rates[:3, 1:], [[0.3] * 3, [-0.3] * 3, [0.0] * 3], atol=1e-12)
    np.testing.assert_allclose(rates[3:, 1:], [[np.nan, np.nan, 1.0 / 1.5], [np.nan] * 3])
    assert rate_of_fall(seconds[:1], error[:, :1]).shape == (5, 1)


# Estimates


@pytest.mark.parametrize("dimension", [2, 3])
def test_estimation_error_is_the_length_of_all_errors_together(dimension):
    position = np.zeros((2, 3, dimension))
    position[1, :, 0] = [0.0, 10.0, 30.0]
    neighbours = np.array([[1, 2], [0, 0], [1, 0]])
    estimate = np.zeros((2, 3, 2, dimension))
    estimate[1, ..., 0] = [[-10.0, -30.0], [10.0, 0.0], [20.0, 30.0]]
    known = np.array([[True, True], [True, False], [True, True]])
    true = position[:, :, None, :] - position[:, neighbours, :]
    np.testing.assert_array_equal(estimation_error(estimate, true, np.stack([known] * 2)), [0.0, 0.0])
    off = np.zeros((2, 3, 2, dimension))
    off[1, 0, 0, 0], off[1, 2, 1, -1], off[1, 1, 1] = 3.0, 4.0, np.nan  # the last is not known
    np.testing.assert_allclose(estimation_error(estimate + off, true, np.stack([known] * 2)), [0.0, 5.0])


def test_covariance_trace_by_hand():
    flat = np.array([[[1.0, 50.0, 2.0], [4.0, 60.0, 8.0]], [[16.0, 70.0, 32.0], [0.0, 0.0, 0.0]]])
    assert covariance_trace(flat, 2) == 63.0
    assert covariance_trace(np.array([[[1.0, 50.0, 60.0, 2.0, 70.0, 4.0]]]), 3) == 7.0


@pytest.mark.parametrize("dimension", [2, 3])
def test_covariance_trace_is_that_of_the_covariances(dimension):
    covariance = np.random.default_rng(1).normal(size=(5, 4, 3, dimension, dimension))
    expected = np.trace(covariance, axis1=-2, axis2=-1).sum(axis=(-2, -1))
    np.testing.assert_allclose(covariance_trace(triangle(covariance), dimension), expected)
