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
    verdict = claims.flat("says", runs(*means), 2.0)
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
    assert claims.lower("says", runs(mean, noise=0.1), runs(1.0, noise=0.12)).holds is holds


def test_a_run_that_diverges_leaves_and_does_not_stay():
    error = np.full((10, 10), 0.1)
    error[:, 6:] = np.nan
    assert claims.leaves("says", SECONDS, error, 1.0, (4.0, None)).holds
    assert not claims.stays_below("says", SECONDS, error, 1.0, (4.0, None)).holds
    assert claims.stays_below("says", SECONDS, error, 1.0, (0.0, 5.0)).holds
    assert not claims.leaves("says", SECONDS, error, 1.0, (0.0, 5.0)).holds


def test_one_run_in_ten_may_differ():
    error = np.full((20, 10), 0.1)
    error[:2, 3] = 5.0
    assert claims.stays_below("says", SECONDS, error, 1.0, (0.0, None)).holds
    error[2, 3] = 5.0
    assert not claims.stays_below("says", SECONDS, error, 1.0, (0.0, None)).holds


def test_below_in_mean_names_the_first_moment_above():
    rng = np.random.default_rng(2)
    bound = 1.0 + 0.1 * rng.standard_normal((400, 10, 1))
    values = 0.5 + 0.1 * rng.standard_normal((400, 10, 3))
    assert claims.below_in_mean("says", SECONDS, values, bound).holds
    values[:, 7, 2] += 0.6
    verdict = claims.below_in_mean("says", SECONDS, values, bound)
    assert not verdict.holds
    assert "first at 7 s" in verdict.found
