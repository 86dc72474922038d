"""Verdicts on claims: each check holds where it should, does not where it should not, and says the figures."""

import numpy as np
import pytest

from analysis.claims import checks

SECONDS = np.arange(10.0)


def runs(*means, noise=0.01):
    rng = np.random.default_rng(1)
    return np.array([[mean * (1 + noise * rng.standard_normal()) for _ in range(50)] for mean in means])


@pytest.mark.parametrize(
    ("means", "holds"), [((1.0, 1.2, 1.5), True), ((1.0, 1.2, 2.5), False), ((1.0, np.inf), False)]
)
def test_flat(means, holds):
    verdict = checks.flat("says", runs(*means), 2.0, "m²")
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
    assert checks.approaches("says", runs(*means), runs(*others), 0.5).holds is holds


@pytest.mark.parametrize(("mean", "holds"), [(0.9, True), (0.999, False), (1.1, False)])
def test_lower_needs_three_standard_errors(mean, holds):
    assert checks.lower("says", runs(mean, noise=0.1), runs(1.0, noise=0.12), "m²").holds is holds


def test_the_standard_error_is_that_of_a_sample():
    # Differences of 0.6 and 1.4 deviate by 0.566 as a sample, and by 0.4 as if they were all there is.
    verdict = checks.lower("says", np.zeros((1, 2)), np.array([[0.6, 1.4]]), "m²")
    assert verdict.found == "lower by 1 m² (one s.e. 0.4)"
    assert not verdict.holds
    excess = np.array([0.6, 1.4])[:, None, None]
    assert checks.below_in_mean("says", np.zeros(1), excess, np.zeros((2, 1, 1))).holds


@pytest.mark.parametrize("check", [checks.leaves, checks.stays_below])
def test_a_span_without_a_moment_decides_nothing(check):
    with pytest.raises(ValueError, match=r"no moment lies in its span from 30 s on: the runs end at 9 s"):
        check("says", SECONDS, np.full((10, 10), 0.1), 1.0, (30.0, None), "m²")


def test_a_run_that_diverges_leaves_and_does_not_stay():
    error = np.full((10, 10), 0.1)
    error[:, 6:] = np.nan
    assert checks.leaves("says", SECONDS, error, 1.0, (4.0, None), "m²").holds
    assert not checks.stays_below("says", SECONDS, error, 1.0, (4.0, None), "m²").holds
    assert checks.stays_below("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").holds
    assert not checks.leaves("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").holds


def test_one_run_in_ten_may_differ():
    error = np.full((20, 10), 0.1)
    error[:2, 3] = 5.0
    assert checks.stays_below("says", SECONDS, error, 1.0, (0.0, None), "m²").holds
    error[2, 3] = 5.0
    assert not checks.stays_below("says", SECONDS, error, 1.0, (0.0, None), "m²").holds


def test_below_in_mean_names_the_first_moment_above():
    rng = np.random.default_rng(2)
    bound = 1.0 + 0.1 * rng.standard_normal((400, 10, 1))
    values = 0.5 + 0.1 * rng.standard_normal((400, 10, 3))
    assert checks.below_in_mean("says", SECONDS, values, bound).holds
    values[:, 7, 2] += 0.6
    verdict = checks.below_in_mean("says", SECONDS, values, bound)
    assert not verdict.holds
    assert "first at 7 s" in verdict.found


def test_a_ratio_comes_with_its_confidence_by_hand():
    # The ratio is 1; values less others are -1 and 1: a standard error of 1, over a mean of 2.
    values, others = np.array([1.0, 3.0]), np.array([2.0, 2.0])
    verdict = checks.ratio("says", values, others, (0.9, 1.1))
    assert verdict.holds
    assert "ratio 1, 95 % confidence 0.02 to 1.98 (asked 0.9 to 1.1)" in verdict.found


@pytest.mark.parametrize(
    ("between", "holds"),
    [((0.9, 1.1), True), ((1.9, 9.0), True), ((2.0, 9.0), False), ((-9.0, 0.1), True), ((-9.0, 0.01), False)],
)
def test_a_ratio_holds_where_its_confidence_reaches(between, holds):
    assert checks.ratio("says", np.array([1.0, 3.0]), np.array([2.0, 2.0]), between).holds is holds


def test_what_runs_have_in_common_leaves_their_ratio_sure():
    (others,) = runs(1.0, noise=0.5)
    assert not checks.ratio("says", 0.5 * others, others, (0.51, 0.6)).holds
    assert checks.ratio("says", 0.5 * others, others, (0.5, 0.6)).holds
    # Drawn apart, the same runs would leave it open.
    assert checks.ratio("says", 0.5 * others, others[::-1], (0.51, 0.6)).holds


def test_a_ratio_to_runs_that_diverged_does_not_hold():
    assert not checks.ratio("says", np.array([1.0, np.nan]), np.ones(2), (0.0, 9.0)).holds


def test_a_span_holds_both_of_its_ends():
    assert SECONDS[checks.within(SECONDS, (2.0, 4.0))].tolist() == [2.0, 3.0, 4.0]
    assert SECONDS[checks.within(SECONDS, (7.5, None))].tolist() == [8.0, 9.0]


# Straight lines on a logarithmic axis


LATER = np.linspace(0.0, 10.0, 101)
FALLS = np.exp(-0.7 * LATER)


def falling(*others, runs=20):
    """Runs that fall exponentially, each from a height of its own; these in place of the first."""
    heights = np.linspace(0.5, 3.0, runs)[:, None]
    return np.concatenate([np.stack(others), heights[len(others) :] * FALLS]) if others else heights * FALLS


def test_an_exponential_falls_along_a_line_at_its_rate():
    verdict = checks.exponential("says", LATER, falling(), (0.0, None))
    assert verdict.says == "says"
    assert verdict.holds
    assert verdict.found == "100% of the runs fall along a line (R² at least 0.99), by 0.7 1/s"


def test_an_exponential_under_a_little_noise_still_falls_along_a_line():
    noise = 1.0 + 0.02 * np.random.default_rng(3).standard_normal((20, 101))
    assert checks.exponential("says", LATER, falling() * noise, (0.0, None)).holds


@pytest.mark.parametrize(
    "other",
    [
        1.0 / (0.1 + LATER),
        1.0 / FALLS,
        np.exp(-0.05 * LATER**2),
        FALLS + 0.01,
        np.exp(-0.1 * LATER + np.sin(5.0 * LATER)),
    ],
    ids=["1/t", "growth", "bell", "floor", "waves"],
)
def test_what_does_not_fall_along_a_line_is_no_exponential(other):
    assert not checks.exponential("says", LATER, other * np.linspace(0.5, 3.0, 20)[:, None], (0.0, None)).holds


def test_runs_are_counted_one_in_ten_may_do_otherwise():
    verdict = checks.exponential("says", LATER, falling(1 / FALLS, 1 / (0.1 + LATER)), (0.0, None))
    assert verdict.holds
    assert verdict.found.startswith("90% of the runs fall")
    verdict = checks.exponential("says", LATER, falling(1 / FALLS, 1 / (0.1 + LATER), FALLS + 0.01), (0.0, None))
    assert not verdict.holds
    assert verdict.found.startswith("85% of the runs fall")


def test_an_exponential_is_looked_for_in_its_span_only():
    restless = np.where((LATER < 2.0) | (LATER > 6.0), 1.0 + np.sin(9.0 * LATER) ** 2, FALLS) * np.ones((20, 1))
    assert not checks.exponential("says", LATER, restless, (0.0, None)).holds
    assert not checks.exponential("says", LATER, restless, (2.0, None)).holds
    assert not checks.exponential("says", LATER, restless, (0.0, 6.0)).holds
    assert checks.exponential("says", LATER, restless, (2.0, 6.0)).holds
    with pytest.raises(ValueError, match="no moment lies in its span from 30 s on"):
        checks.exponential("says", LATER, restless, (30.0, None))


@pytest.mark.parametrize("last", [np.nan, np.inf, 0.0, 1.0], ids=["diverged", "overflowed", "exact", "constant"])
def test_a_run_without_a_line_is_one_run_that_does_not_fall(last):
    odd = np.where(LATER < 5.0, 1.0, last)
    verdict = checks.exponential("says", LATER, falling(odd), (0.0, None))
    assert verdict.holds
    assert verdict.found.startswith("95% of the runs fall")
    rate = float(verdict.found.split("by ")[1].split(" 1/s")[0])
    assert 0.6 < rate < 0.8
