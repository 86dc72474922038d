"""Verdicts on claims: each check holds where it should, does not where it should not, and says the figures."""

import numpy as np
import pytest

from analysis import claims

SECONDS = np.arange(10.0)


def runs(*means, noise=0.01):
    rng = np.random.default_rng(1)
    return np.array([[mean * (1 + noise * rng.standard_normal()) for _ in range(50)] for mean in means])


@pytest.mark.parametrize(
    ("means", "holds"), [((1.0, 1.2, 1.5), True), ((1.0, 1.2, 2.5), False), ((1.0, np.inf), False)]
)
def test_flat(means, holds):
    verdict = claims.flat("says", runs(*means), 2.0, "m²")
    assert verdict.holds is holds
    assert "largest over smallest" in verdict.found


@pytest.mark.parametrize(
    ("means", "others", "holds"),
    [
        ((0.9, 0.3), (1.0, 1.0), True),
        ((0.3, 0.9), (1.0, 1.0), False),
        ((0.4, 0.1), (1.0, 1.0), False),
        ((0.9, 0.6), (1.0, 1.0), False),
        ((0.9, 0.8, 0.3), (1.0, 1.0, 0.3), True),
        ((0.8, 0.9, 0.3), (1.0, 1.0, 0.3), False),
    ],
)
def test_approaches(means, others, holds):
    assert claims.approaches("says", runs(*means), runs(*others), 0.5).holds is holds


@pytest.mark.parametrize(("mean", "holds"), [(0.9, True), (0.999, False), (1.1, False)])
def test_lower_needs_three_standard_errors(mean, holds):
    assert claims.lower("says", runs(mean, noise=0.1), runs(1.0, noise=0.12), "m²").holds is holds


@pytest.mark.parametrize("check", [claims.leaves, claims.stays_below])
def test_a_span_without_a_moment_decides_nothing(check):
    with pytest.raises(ValueError, match=r"no moment lies in its span from 30 s on: the runs end at 9 s"):
        check("says", SECONDS, np.full((10, 10), 0.1), 1.0, (30.0, None), "m²")


def test_a_run_that_diverges_leaves_and_does_not_stay():
    error = np.full((10, 10), 0.1)
    error[:, 6:] = np.nan
    assert claims.leaves("says", SECONDS, error, 1.0, (4.0, None), "m²").holds
    assert not claims.stays_below("says", SECONDS, error, 1.0, (4.0, None), "m²").holds
    assert claims.stays_below("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").holds
    assert not claims.leaves("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").holds


def test_one_run_in_ten_may_differ():
    error = np.full((20, 10), 0.1)
    error[:2, 3] = 5.0
    assert claims.stays_below("says", SECONDS, error, 1.0, (0.0, None), "m²").holds
    error[2, 3] = 5.0
    assert not claims.stays_below("says", SECONDS, error, 1.0, (0.0, None), "m²").holds


def test_below_in_mean_names_the_first_moment_above():
    rng = np.random.default_rng(2)
    bound = 1.0 + 0.1 * rng.standard_normal((400, 10, 1))
    values = 0.5 + 0.1 * rng.standard_normal((400, 10, 3))
    assert claims.below_in_mean("says", SECONDS, values, bound).holds
    values[:, 7, 2] += 0.6
    verdict = claims.below_in_mean("says", SECONDS, values, bound)
    assert not verdict.holds
    assert "first at 7 s" in verdict.found


def test_a_ratio_comes_with_its_confidence_by_hand():
    # The ratio is 1; values less others are -1 and 1: a standard error of 1, over a mean of 2.
    values, others = np.array([1.0, 3.0]), np.array([2.0, 2.0])
    verdict = claims.ratio("says", values, others, (0.9, 1.1))
    assert verdict.holds
    assert "ratio 1, 95 % confidence 0.02 to 1.98 (asked 0.9 to 1.1)" in verdict.found


@pytest.mark.parametrize(
    ("between", "holds"),
    [((0.9, 1.1), True), ((1.9, 9.0), True), ((2.0, 9.0), False), ((-9.0, 0.1), True), ((-9.0, 0.01), False)],
)
def test_a_ratio_holds_where_its_confidence_reaches(between, holds):
    assert claims.ratio("says", np.array([1.0, 3.0]), np.array([2.0, 2.0]), between).holds is holds


def test_what_runs_have_in_common_leaves_their_ratio_sure():
    (others,) = runs(1.0, noise=0.5)
    assert not claims.ratio("says", 0.5 * others, others, (0.51, 0.6)).holds
    assert claims.ratio("says", 0.5 * others, others, (0.5, 0.6)).holds
    # Drawn apart, the same runs would leave it open.
    assert claims.ratio("says", 0.5 * others, others[::-1], (0.51, 0.6)).holds


def test_a_ratio_to_runs_that_diverged_does_not_hold():
    assert not claims.ratio("says", np.array([1.0, np.nan]), np.ones(2), (0.0, 9.0)).holds


def test_a_span_holds_both_of_its_ends():
    assert SECONDS[claims.within(SECONDS, (2.0, 4.0))].tolist() == [2.0, 3.0, 4.0]
    assert SECONDS[claims.within(SECONDS, (7.5, None))].tolist() == [8.0, 9.0]
