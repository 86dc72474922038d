"""Intervals of means, differences, ratios and shares: scipy's where it has them, and as sure as they say."""

import numpy as np
import pytest
from scipy import stats

from analysis.claims import intervals
from analysis.claims.intervals import CONFIDENCE, Decision, Interval, all_of

HOLDS, FAILS, OPEN = Decision.HOLDS, Decision.DOES_NOT_HOLD, Decision.UNDECIDED
RUNS = [2, 5, 50]


def normal(runs, seed=1, mean=3.0, deviation=2.0):
    return mean + deviation * np.random.default_rng(seed).standard_normal(runs)


@pytest.mark.parametrize("runs", RUNS)
def test_a_mean_is_as_sure_as_students_t(runs):
    values = normal(runs)
    found = intervals.mean(values)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(CONFIDENCE)
    np.testing.assert_allclose([found.found, found.low, found.high], [values.mean(), *expected], rtol=1e-12)
    many = intervals.mean(values, tests=10)
    expected = stats.ttest_1samp(values, 0.0).confidence_interval(1 - (1 - CONFIDENCE) / 10)
    np.testing.assert_allclose([many.low, many.high], expected, rtol=1e-12)


@pytest.mark.parametrize("runs", RUNS)
def test_a_difference_of_pairs_is_as_sure_as_the_mean_of_differences(runs):
    values, others = normal(runs), normal(runs, 2) + normal(runs)
    found, expected = intervals.difference(values, others, paired=True), intervals.mean(values - others)
    np.testing.assert_allclose([found.low, found.high], [expected.low, expected.high], rtol=1e-9)


def test_what_runs_have_in_common_counts_only_where_they_are_paired():
    others = normal(50)
    values = others - 0.1
    together, apart = (intervals.difference(values, others, paired=paired) for paired in (True, False))
    assert together.decide(most=0.0) is HOLDS
    assert apart.decide(most=0.0) is OPEN
    assert intervals.ratio(0.9 * others, others, paired=True).decide(most=0.95) is HOLDS
    assert intervals.ratio(0.9 * others, others, paired=False).decide(most=0.95) is OPEN


def test_a_ratio_by_hand():
    # Where the other is known for sure, it is the interval of the mean, divided.
    values = normal(10)
    found, mean = intervals.ratio(values, np.full(10, 4.0), paired=False), intervals.mean(values)
    np.testing.assert_allclose([found.low, found.high], [mean.low / 4, mean.high / 4], rtol=1e-12)
    assert intervals.ratio(values, np.full(10, -4.0), paired=False).high == pytest.approx(-mean.low / 4)


def test_a_ratio_to_what_may_be_nothing_has_no_ends():
    found = intervals.ratio(normal(10), normal(10, 2, mean=0.1), paired=False)
    assert (found.low, found.high) == (-np.inf, np.inf)


@pytest.mark.parametrize("paired", [True, False])
@pytest.mark.parametrize("runs", [3, 20])
@pytest.mark.parametrize("kind", ["difference", "ratio"])
def test_intervals_miss_the_truth_as_often_as_they_say(kind, runs, paired):
    """Skewed a little, as errors are; with a part in common."""
    rng, missed, draws = np.random.default_rng(runs), 0, 600
    for _ in range(draws):
        common = rng.gamma(20.0, 0.05, runs)
        values = common + rng.gamma(20.0, 0.05, runs)
        others = (common if paired else rng.gamma(20.0, 0.05, runs)) + rng.gamma(20.0, 0.1, runs)
        found = getattr(intervals, kind)(values, others, paired=paired)
        truth = -1.0 if kind == "difference" else 2.0 / 3.0
        missed += not found.low <= truth <= found.high
    # Never more often than one in a hundred; where draws are apart the fewer degrees of freedom leave it surer.
    assert missed <= stats.binom.ppf(1 - 1e-6, draws, 1 - CONFIDENCE)
    assert missed > 0 or not paired


@pytest.mark.parametrize("runs", [1, 10, 50])
def test_a_share_is_as_sure_as_that_of_clopper_and_pearson(runs):
    for those in range(runs + 1):
        found = intervals.share(those, 0, runs)
        two_sided = stats.binomtest(those, runs).proportion_ci(2 * CONFIDENCE - 1)
        np.testing.assert_allclose([found.low, found.high], two_sided, rtol=1e-9, atol=1e-12)


def test_of_what_cannot_be_told_none_may_do_it_and_all_may():
    found, none, both = intervals.share(45, 5, 50), intervals.share(45, 0, 50), intervals.share(50, 0, 50)
    assert (found.low, found.high) == (none.low, both.high)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf])
def test_where_a_run_has_no_number_the_mean_has_no_ends_or_is_infinite(odd):
    values = normal(10)
    values[3] = odd
    found = intervals.mean(values)
    if np.isnan(odd):
        assert (found.low, found.high) == (-np.inf, np.inf)
    else:
        assert found.low == found.found == found.high == odd
    assert intervals.difference(values, values, paired=True).decide(least=0.0) is OPEN
    assert intervals.ratio(normal(10), values, paired=True).decide(most=2.0) is OPEN


@pytest.mark.parametrize("kind", [intervals.difference, intervals.ratio])
def test_one_run_says_nothing(kind):
    found = kind(np.array([1.0]), np.array([2.0]), paired=True)
    assert (found.low, found.high) == (-np.inf, np.inf)


def test_an_interval_decides_where_all_of_it_is_on_one_side():
    found = Interval(2.0, 1.0, 3.0)
    assert found.decide(least=1.0) is HOLDS
    assert found.decide(least=1.1) is OPEN
    assert found.decide(least=3.1) is FAILS
    assert found.decide(most=3.0) is HOLDS
    assert found.decide(most=0.9) is FAILS
    assert found.decide(0.5, 3.5) is HOLDS
    assert found.decide(1.5, 2.5) is OPEN


def test_all_parts_have_to_hold_and_there_is_one():
    assert all_of([HOLDS, HOLDS]) is HOLDS
    assert all_of([HOLDS, OPEN]) is OPEN
    assert all_of([HOLDS, OPEN, FAILS]) is FAILS
    assert all_of([]) is OPEN
