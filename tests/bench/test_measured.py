"""Whether figures of a run have become worse than those of an earlier one: planted data."""

import numpy as np
import pytest
from speed.measured import Measured, exponent, of_twice_the_size, over_rounds, ratio, worse, worsened


def rounds_of(true, spread, seed, rounds=9):
    """Ratios of noisy rounds about a true one."""
    return over_rounds((true * np.exp(spread * np.random.default_rng(seed).standard_normal(rounds))).tolist())


@pytest.mark.parametrize(
    ("change", "spread", "expected"),
    [
        (1.5, 0.01, ["tick"]),
        (1.25, 0.01, ["tick"]),
        (1.15, 0.01, []),  # worse, but not by a fifth
        (1.0, 0.01, []),
        (0.5, 0.01, []),  # better
    ],
)
def test_a_ratio_that_is_a_fifth_worse_is_found_and_no_other(change, spread, expected):
    for seed in range(20):
        before, now = rounds_of(4.0, spread, seed), rounds_of(4.0 * change, spread, 100 + seed)
        assert worse({"tick": before}, {"tick": now}) == expected


def test_noise_alone_is_hardly_ever_worse_and_a_fall_beyond_it_nearly_always():
    same = [worse({"tick": rounds_of(1.0, 0.3, n)}, {"tick": rounds_of(1.0, 0.3, 1000 + n)}) for n in range(300)]
    fallen = [worse({"tick": rounds_of(1.0, 0.3, n)}, {"tick": rounds_of(3.0, 0.3, 1000 + n)}) for n in range(300)]
    assert sum(map(bool, same)) <= 3
    assert sum(map(bool, fallen)) >= 290
    # The medians alone would have cried wolf.
    jumps = [rounds_of(1.0, 0.3, 1000 + n).median / rounds_of(1.0, 0.3, n).median > 1.2 for n in range(300)]
    assert sum(jumps) > 10


def test_either_interval_can_excuse_a_ratio():
    sure, unsure_now, unsure_before = (
        Measured(1.3, 1.29, 1.31, 5),
        Measured(1.3, 1.0, 1.6, 5),
        Measured(1.0, 0.7, 1.2, 5),
    )
    before = Measured(1.0, 0.99, 1.01, 5)
    assert worse({"a": before}, {"a": sure}) == ["a"]
    assert worse({"a": before}, {"a": unsure_now}) == []
    assert worse({"a": unsure_before}, {"a": sure}) == []
    # What could have been larger now, or smaller before, excuses nothing.
    assert worse({"a": before._replace(low=0.1)}, {"a": sure._replace(high=9.0)}) == ["a"]


def test_without_doubt_the_share_is_that_of_the_medians():
    assert worsened(Measured(2.0, 2.0, 2.0, 5), Measured(3.0, 3.0, 3.0, 5)) == pytest.approx(0.5)
    assert worsened(Measured(2.0, 2.0, 2.0, 5), Measured(1.0, 1.0, 1.0, 5)) == pytest.approx(-0.5)


def test_only_what_both_runs_have_is_compared():
    found = Measured(1.0, 1.0, 1.0, 5)
    assert worse({"gone": found, "here": found}, {"here": found, "new": found._replace(median=9.0)}) == []


def test_the_interval_of_few_rounds_is_all_of_them_and_of_many_holds_the_median():
    assert over_rounds([3.0, 1.0, 2.0]) == Measured(2.0, 1.0, 3.0, 3)
    assert over_rounds([5.0, 1.0, 2.0, 4.0, 3.0]) == Measured(3.0, 1.0, 5.0, 5)
    assert over_rounds([float(n) for n in range(1, 10)]) == Measured(5.0, 2.0, 8.0, 9)
    rng = np.random.default_rng(0)
    intervals = [over_rounds(rng.standard_normal(15).tolist()) for _ in range(2000)]
    held = np.mean([low <= 0.0 <= high for _, low, high, _ in intervals])
    assert 0.95 < held < 0.98


def test_a_ratio_is_that_of_rounds_and_not_of_medians():
    # A machine that slows down by and by: every round has the ratio 2.
    assert ratio([2.0, 20.0, 200.0], [1.0, 10.0, 100.0]) == Measured(2.0, 2.0, 2.0, 3)
    assert ratio([2.0, 2.0, 2.0], [1.0, 2.0, 4.0]) == Measured(1.0, 0.5, 2.0, 3)


def test_the_exponent_of_a_power_is_found_whatever_the_speed_of_a_round():
    sizes = np.array([5.0, 10.0, 20.0, 40.0])
    costs = np.array([[1.0], [7.0], [0.2]]) * sizes**1.5
    found = exponent(sizes, costs)
    np.testing.assert_allclose(found[:3], 1.5)
    noisy = costs * np.exp(0.1 * np.random.default_rng(1).standard_normal(costs.shape))
    found = exponent(sizes, noisy)
    assert found.low < found.median < found.high
    assert found.median == pytest.approx(1.5, abs=0.2)


def test_steady_is_what_lies_within_a_fifth_of_its_median():
    assert Measured(12.0, 10.0, 14.4, 5).is_steady
    assert not Measured(12.0, 10.0, 14.41, 5).is_steady
    assert not Measured(12.0, 9.99, 14.0, 5).is_steady
    assert not Measured(12.0, 12.0, 12.0, 4).is_steady
    assert of_twice_the_size(Measured(2.0, 1.0, 3.0, 5)) == Measured(4.0, 2.0, 8.0, 5)
