"""How a target moves and spreads, against matrix exponentials; information, packed and unpacked."""

import numpy as np
from targets import ORDERS, van_loan

from analysis.models.information import numbers, packed, position, unpacked
from analysis.models.pursuit import diffusion, transition


@ORDERS
def test_the_target_moves_and_spreads_as_its_differential_equation_says(order):
    for seconds in (0.0, 0.05, 0.7, 3.0):
        A, W = van_loan(order, 1.7, seconds)
        np.testing.assert_allclose(transition(order, np.array(seconds)), A, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(diffusion(order, np.array(seconds), 1.7), W, rtol=1e-9, atol=1e-12)


def test_motion_over_many_times_is_that_over_each():
    seconds = np.array([[0.1, 0.2], [0.0, 2.0]])
    for place in np.ndindex(2, 2):
        np.testing.assert_array_equal(transition(3, seconds)[place], transition(3, seconds[place]))
        np.testing.assert_array_equal(diffusion(3, seconds, 2.0)[place], diffusion(3, seconds[place], 2.0))


@ORDERS
def test_information_is_packed_without_a_loss(order):
    rng = np.random.default_rng(order)
    root = rng.normal(size=(4, order, order))
    Q, y = root @ np.swapaxes(root, -1, -2) + np.eye(order), rng.normal(size=(4, order, 3))
    said = packed(Q, y)
    assert said.shape == (4, numbers(order, 3))
    for mine, again in zip((Q, y), unpacked(said, 3, order), strict=True):
        np.testing.assert_array_equal(mine, again)
    np.testing.assert_allclose(position(said, 3, order), (np.linalg.inv(Q) @ y)[:, 0], rtol=1e-9)
