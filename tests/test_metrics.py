"""The tracking error of paper 000, eq. 15."""

import numpy as np
import pytest

from analysis.metrics import tracking_error

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
