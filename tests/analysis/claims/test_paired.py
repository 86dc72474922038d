"""Two methods that meet the same draws: ratios, medians and signs, with the error rates that they say they have."""

import numpy as np
import pytest
from scipy import stats

from analysis.claims.paired import Comparison, compared, larger, median, ratio

EXPERIMENTS, CONFIDENCE, MATTERS = 400, 0.95, 1.1


def errors(rng, runs, factor):
    """Errors of two methods over the same draws, skewed; those of the one are so many times the other's in the mean of logs."""
    common, own = rng.normal(size=runs), 0.3 * rng.normal(size=(2, runs))
    return np.exp(common + own[0]) * factor, np.exp(common + own[1])


def test_the_interval_of_a_ratio_holds_the_true_one_as_often_as_it_says():
    rng = np.random.default_rng(4)
    for factor in (0.5, 1.0, 3.0):
        found = [ratio(*errors(rng, 20, factor), np.inf, 1, CONFIDENCE) for _ in range(EXPERIMENTS)]
        covered = np.mean([one.low <= factor <= one.high for one in found])
        assert covered == pytest.approx(CONFIDENCE, abs=3 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / EXPERIMENTS))


def test_what_is_equal_is_hardly_ever_better_or_worse_however_many_are_compared():
    rng, tests = np.random.default_rng(5), 20
    wrong = 0
    for _ in range(EXPERIMENTS // 2):
        found = [compared(ratio(*errors(rng, 20, 1.0), np.inf, tests, CONFIDENCE), MATTERS) for _ in range(tests)]
        wrong += any(one in (Comparison.BETTER, Comparison.WORSE) for one in found)
    assert wrong <= (1 - CONFIDENCE) * EXPERIMENTS / 2 + 3 * np.sqrt(0.05 * 0.95 * EXPERIMENTS / 2)
    # Planted: without the correction nearly half of them are.
    alone = 0
    for _ in range(EXPERIMENTS // 2):
        found = [compared(ratio(*errors(rng, 20, 1.0), np.inf, 1, CONFIDENCE), MATTERS) for _ in range(tests)]
        alone += any(one in (Comparison.BETTER, Comparison.WORSE) for one in found)
    assert alone > 0.3 * EXPERIMENTS / 2


@pytest.mark.parametrize(
    ("factor", "decision"),
    [(0.5, Comparison.BETTER), (2.0, Comparison.WORSE), (1.0, Comparison.UNDECIDED), (1.02, Comparison.UNDECIDED)],
)
def test_what_differs_is_told_and_what_may_be_is_undecided(factor, decision):
    found = ratio(*errors(np.random.default_rng(6), 20, factor), np.inf, 1, CONFIDENCE)
    assert compared(found, MATTERS) is decision


def test_what_differs_by_less_than_matters_is_no_difference():
    one, other = errors(np.random.default_rng(7), 5000, 1.03)
    found = ratio(one, other, np.inf, 1, CONFIDENCE)
    assert found.low > 1.0
    assert compared(found, MATTERS) is Comparison.SAME
    assert compared(ratio(other, other, np.inf, 1, CONFIDENCE), MATTERS) is Comparison.SAME


def test_errors_beyond_the_worst_are_as_bad_as_each_other():
    one, other = np.array([1e9, np.inf, np.nan, 1.0]), np.array([10.0, 10.0, 10.0, 1.0])
    assert ratio(one, other, 10.0, 1, CONFIDENCE).found == pytest.approx(1.0)
    assert ratio(np.zeros(4), np.zeros(4), 10.0, 1, CONFIDENCE).found == 1.0


@pytest.mark.parametrize("runs", [6, 7, 12, 51])
def test_the_interval_of_a_median_is_that_of_order_statistics(runs):
    values = np.random.default_rng(runs).permutation(runs).astype(float)
    found = median(values, CONFIDENCE)
    # By the binomial distribution of a coin: no more than what the confidence leaves lies beyond either end.
    beyond = stats.binom.cdf(int(found.low), runs, 0.5)
    assert beyond <= (1 - CONFIDENCE) / 2 < stats.binom.cdf(int(found.low) + 1, runs, 0.5)
    assert found.high == runs - 1 - found.low
    assert found.found == np.median(values)


def test_the_interval_of_a_median_holds_it_as_often_as_it_says_and_of_few_runs_has_no_ends():
    rng = np.random.default_rng(8)
    found = [median(rng.exponential(size=15), CONFIDENCE) for _ in range(EXPERIMENTS)]
    assert np.mean([one.low <= np.log(2) <= one.high for one in found]) >= CONFIDENCE - 0.03
    few = median(np.arange(5.0), CONFIDENCE)
    assert (few.low, few.high) == (-np.inf, np.inf)
    never = median(np.array([1.0, 2.0, *[np.inf] * 8]), CONFIDENCE)
    assert (never.found, never.low, never.high) == (np.inf, 2.0, np.inf)


def test_signs_tell_which_is_larger_and_ties_tell_nothing():
    later, earlier = np.array([3.0, 4.0, np.inf, 5.0, 6.0, 7.0, 8.0, 9.0]), np.arange(8.0)
    assert larger(later, earlier, 1, CONFIDENCE) is Comparison.BETTER
    assert larger(earlier, later, 1, CONFIDENCE) is Comparison.WORSE
    assert larger(later, earlier, 10, CONFIDENCE) is Comparison.UNDECIDED
    assert larger(later, later, 1, CONFIDENCE) is Comparison.SAME
    assert larger(np.full(9, np.inf), np.full(9, np.inf), 1, CONFIDENCE) is Comparison.SAME
    assert larger(np.array([1.0, 2.0]), np.array([0.0, 2.0]), 1, CONFIDENCE) is Comparison.UNDECIDED
