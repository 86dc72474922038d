"""Verdicts on claims: each check holds, fails or leaves open where it should, and says the figures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from analysis.claims import checks
from analysis.claims.falling import fall
from analysis.claims.intervals import Decision

HOLDS, FAILS, OPEN = Decision.HOLDS, Decision.DOES_NOT_HOLD, Decision.UNDECIDED
SECONDS = np.arange(10.0)
ALL = (0.0, None)


def runs(*means, noise=0.01, number=50, seed=1):
    rng = np.random.default_rng(seed)
    return np.array([[mean * (1 + noise * rng.standard_normal()) for _ in range(number)] for mean in means])


# Means of cases


@pytest.mark.parametrize(
    ("means", "decision"),
    [
        ((1.0, 1.2, 1.5), HOLDS),
        ((1.0, 1.2, 2.5), FAILS),
        ((1.0, 1.2, 2.0), OPEN),
        ((1.0, np.inf), FAILS),
        ((1.0, np.nan), OPEN),
        ((1.0, np.nan, 2.5), FAILS),
        ((1.0,), OPEN),
        ((0.0, 1.0), FAILS),
        ((0.0, 0.0), OPEN),
        ((-1.0, 1.0), FAILS),
    ],
)
def test_flat(means, decision):
    verdict = checks.flat("says", runs(*means), 2.0, "m²")
    assert verdict.decision is decision
    assert ("largest over smallest" in verdict.found) == (len(means) > 1)


@pytest.mark.parametrize(
    ("means", "others", "decision"),
    [
        ((0.9, 0.3), (1.0, 1.0), HOLDS),
        ((0.3, 0.9), (1.0, 1.0), FAILS),
        ((0.4, 0.1), (1.0, 1.0), FAILS),
        ((0.9, 0.6), (1.0, 1.0), FAILS),
        ((0.9, 0.45), (1.0, 1.0), OPEN),
        ((0.9, 0.8, 0.3), (1.0, 1.0, 0.3), HOLDS),
        ((0.8, 0.9, 0.3), (1.0, 1.0, 0.3), FAILS),
        ((0.8, 0.8, 0.3), (1.0, 1.0, 0.3), OPEN),
        ((0.9,), (1.0,), OPEN),
    ],
)
def test_approaches(means, others, decision):
    assert checks.approaches("says", runs(*means), runs(*others, seed=2), 0.5).decision is decision


@pytest.mark.parametrize(
    ("mean", "decision"), [(0.9, HOLDS), (0.999, OPEN), (1.1, FAILS), (np.inf, FAILS), (np.nan, OPEN)]
)
def test_lower_needs_an_interval_below(mean, decision):
    found = checks.lower("says", runs(mean, noise=0.1), runs(1.0, noise=0.12, seed=2), "m²", paired=True)
    assert found.decision is decision


def test_who_diverges_is_above_for_sure():
    others = runs(1.0, seed=2)
    others[0, 7] = np.inf
    assert checks.lower("says", runs(1.0), others, "m²", paired=True).decision is HOLDS


def test_two_runs_are_as_unsure_as_student_says():
    # Differences of 0.8 and 1.2: by 1.96 standard errors that would be sure, and by Student's 63.7 it is not.
    verdict = checks.lower("says", np.zeros((1, 2)), np.array([[0.8, 1.2]]), "m²", paired=True)
    assert verdict == checks.ClaimVerdict("says", OPEN, "lower by 1 (-11.7 to 13.7) m²")


@pytest.mark.parametrize(("by", "decision"), [(1e-12, FAILS), (1e-6, HOLDS), (0.0, FAILS)])
def test_what_is_lower_by_rounding_is_not_lower(by, decision):
    (others,) = runs(1.0)
    assert checks.lower("says", others[None] - by, others[None], "m²", paired=True).decision is decision


@pytest.mark.parametrize(
    ("between", "decision"),
    [((0.4, 0.6), HOLDS), ((0.5, 0.6), OPEN), ((0.51, 0.6), FAILS), ((-9.0, 0.4), FAILS)],
)
def test_a_ratio_holds_where_all_of_its_interval_is_inside(between, decision):
    verdict = checks.ratio("says", runs(0.5)[0], runs(1.0, seed=2)[0], between, paired=True)
    assert verdict.decision is decision
    assert f"asked {between[0]:g} to {between[1]:g}" in verdict.found


def test_more_noise_passes_no_more_easily():
    """Before: 2.6 with -0.68 to 5.88 was 0.95 to 1.1."""
    noisy = 2.6 + np.random.default_rng(1).standard_normal(4) * 3.0
    assert checks.ratio("says", noisy, np.ones(4), (0.95, 1.1), paired=True).decision is OPEN
    assert checks.value("says", noisy, 1.0, (0.95, 1.1), "m").decision is OPEN


@pytest.mark.parametrize(("level", "decision"), [(0.5, HOLDS), (0.55, OPEN), (0.7, FAILS)])
def test_a_value_is_that_printed_to_a_factor(level, decision):
    verdict = checks.value("says", runs(0.5)[0], level, (0.91, 1.1), "m")
    assert verdict.decision is decision
    assert f"asked {0.91 * level:.3g} to {1.1 * level:.3g}" in verdict.found


def test_a_value_below_nothing_is_between_multiples_of_it_too():
    assert checks.value("says", runs(-0.5)[0], -0.5, (0.9, 1.1), "m").decision is HOLDS


# Shares of runs


@pytest.mark.parametrize("check", [checks.leaves, checks.stays_below])
def test_a_span_without_a_moment_decides_nothing(check):
    with pytest.raises(ValueError, match=r"no moment lies in its span from 30 s on: the runs end at 9 s"):
        check("says", SECONDS, np.full((10, 10), 0.1), 1.0, (30.0, None), "m²")


@pytest.mark.parametrize(
    ("above", "stays", "leaves"),
    [(0, HOLDS, FAILS), (1, OPEN, FAILS), (5, OPEN, FAILS), (20, FAILS, FAILS), (49, FAILS, OPEN), (50, FAILS, HOLDS)],
)
def test_most_of_all_runs_do_it_for_sure_or_it_is_open(above, stays, leaves):
    error = np.full((50, 10), 0.1)
    error[:above, 6] = 5.0
    for check, decision in ((checks.stays_below, stays), (checks.leaves, leaves)):
        assert check("says", SECONDS, error, 1.0, ALL, "m²").decision is decision


def test_runs_are_counted_and_not_called_all():
    error = np.full((100, 10), 0.1)
    error[:2, 6] = 5.0
    verdict = checks.stays_below("says", SECONDS, error, 1.0, ALL, "m²")
    assert verdict.decision is HOLDS
    assert verdict.found == "98 of 100 runs stay below 1 m²; 92% to 100% of all, asked 90% at least"


def test_ten_runs_are_too_few():
    told = checks.stays_below("says", SECONDS, np.full((10, 10), 0.1), 1.0, ALL, "m²").found
    assert told.endswith("63% to 100% of all, asked 90% at least, which 44 such runs would show")
    for runs, decision in ((43, OPEN), (44, HOLDS)):
        assert checks.stays_below("says", SECONDS, np.full((runs, 10), 0.1), 1.0, ALL, "m²").decision is decision
    assert checks.stays_below("says", SECONDS, np.full((10, 10), 0.1), 1.0, ALL, "m²").decision is OPEN


def test_where_nobody_estimates_nothing_leaves():
    """Before: no number was above any level."""
    error = np.full((50, 10), np.nan)
    for check in (checks.leaves, checks.stays_below):
        verdict = check("says", SECONDS, error, 1.0, ALL, "m²")
        assert verdict.decision is OPEN
        assert "of 50 it cannot be told" in verdict.found
    error[:, 4] = 2.0  # that is above, whatever comes of it
    assert checks.leaves("says", SECONDS, error, 1.0, ALL, "m²").decision is HOLDS
    assert checks.stays_below("says", SECONDS, error, 1.0, ALL, "m²").decision is FAILS


def test_a_run_out_of_numbers_leaves_from_then_on():
    error = np.full((50, 10), 0.1)
    error[:, 6:] = np.inf
    assert checks.leaves("says", SECONDS, error, 1.0, (4.0, None), "m²").decision is HOLDS
    assert checks.stays_below("says", SECONDS, error, 1.0, (4.0, None), "m²").decision is FAILS
    assert checks.stays_below("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").decision is HOLDS
    assert checks.leaves("says", SECONDS, error, 1.0, (0.0, 5.0), "m²").decision is FAILS


# Bounds


def below_in_mean(values, bound, defined=None):
    everywhere = np.ones(values.shape, dtype=bool)
    return checks.below_in_mean("says", SECONDS, values, bound, everywhere if defined is None else defined)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("value", "bound"), [(np.inf, np.inf), (1.0, np.inf), (np.inf, 1.0)])
def test_nothing_infinite_is_below_in_mean_or_warns(value, bound):
    values, bounds = np.full((50, 3, 2), value), np.full((50, 3, 2), bound)
    found = checks.below_in_mean("says", SECONDS[:3], values, bounds, np.ones((50, 3, 2), dtype=bool))
    assert found.decision is not HOLDS


def test_below_in_mean_names_the_first_moment_above():
    rng = np.random.default_rng(2)
    bound = 1.0 + 0.1 * rng.standard_normal((400, 10, 3))
    values = 0.5 + 0.1 * rng.standard_normal((400, 10, 3))
    assert below_in_mean(values, bound).decision is HOLDS
    values[:, 7, 2] += 0.6
    verdict = below_in_mean(values, bound)
    assert verdict.decision is FAILS
    assert "first at 7 s" in verdict.found


@pytest.mark.parametrize("values", [np.full((400, 10, 3), np.nan), 0.1 * np.ones((1, 10, 3)), np.ones((400, 10, 3))])
def test_nothing_is_below_in_mean_of_no_number_of_one_run_or_by_nothing_at_all(values):
    noise = 1.0 + 0.1 * np.random.default_rng(3).standard_normal((len(values), 10, 1))
    verdict = below_in_mean(values, noise)
    assert verdict.decision is OPEN
    assert verdict.found.startswith("at 0 of 10 moments")


def test_where_nothing_is_defined_nothing_counts_and_a_moment_of_one_run_is_open():
    rng = np.random.default_rng(4)
    bound = 1.0 + 0.1 * rng.standard_normal((400, 10, 3))
    values = 0.5 + 0.1 * rng.standard_normal((400, 10, 3))
    defined = rng.random(values.shape) < 0.5
    values[~defined] = 9.0
    assert below_in_mean(values, bound, defined).decision is HOLDS
    assert below_in_mean(values, bound).decision is FAILS
    values[~defined] = np.nan
    assert below_in_mean(values, bound, defined).decision is HOLDS
    defined[1:, 4, 1] = False
    assert below_in_mean(values, bound, defined).decision is OPEN


def follows(values, others, defined=None):
    everywhere = np.ones(values.shape, dtype=bool)
    return checks.follows("says", SECONDS, values, others, everywhere if defined is None else defined, ALL)


FELL = np.exp(-SECONDS) + 0.01


@pytest.mark.parametrize(
    ("shape", "decision"),
    [(3.0 * FELL, HOLDS), (FELL**2, HOLDS), (FELL[::-1], FAILS), (FELL[[1, 0, 3, 2, 5, 4, 9, 8, 7, 6]], FAILS)],
    ids=["a multiple", "a power", "rises", "shuffled"],
)
def test_what_rises_and_falls_with_another_follows_it(shape, decision):
    rng = np.random.default_rng(5)
    error = FELL * (1.0 + 0.1 * rng.standard_normal((50, 1)))
    values = shape[:, None] * (1.0 + 1e-3 * rng.standard_normal((50, 10, 3)))
    assert follows(values, error).decision is decision
    assert follows(values[:19], error[:19]).decision is OPEN
    defined = rng.random(values.shape) < 0.9
    values[~defined] = np.nan
    assert follows(values, error, defined).decision is decision
    assert follows(values, error).decision is OPEN
    defined[:, 4, 1] = False
    assert follows(values, error, defined).decision is not HOLDS


def test_what_stands_still_follows_nothing():
    rising = np.tile(SECONDS, (20, 1))
    still, told = np.zeros((20, len(SECONDS), 1)), np.ones((20, len(SECONDS), 1), dtype=bool)
    assert checks.follows("says", SECONDS, still, rising, told, ALL).decision is OPEN
    half = np.where(SECONDS < 5.0, 0.0, 1.0)  # ties share their ranks
    verdict = checks.follows("says", SECONDS, np.tile(half[:, None], (20, 1, 1)), rising, told, ALL)
    assert verdict.decision is FAILS


def test_what_is_higher_is_said_to_be_higher():
    rng = np.random.default_rng(2)
    low, high = rng.normal(1.0, 0.1, (1, 50)), rng.normal(3.0, 0.1, (1, 50))
    assert checks.lower("says", high, low, "m", paired=True).found.startswith("higher by ")
    assert checks.lower("says", low, high, "m", paired=True).found.startswith("lower by ")


def test_noise_follows_nothing():
    rng = np.random.default_rng(6)
    assert follows(rng.random((50, 10, 1)), rng.random((50, 10))).decision is FAILS


@pytest.mark.parametrize(
    ("values", "decision"),
    [([0.5, 1.0], HOLDS), ([0.5, 1.1], FAILS), ([0.5, np.nan], OPEN), ([np.nan, 1.1], FAILS), ([], OPEN)],
)
def test_never_above(values, decision):
    verdict = checks.never_above("says", np.array(values), np.ones(len(values)))
    assert verdict.decision is decision
    assert f"of {len(values)} are not above" in verdict.found


def test_a_span_holds_both_of_its_ends():
    assert SECONDS[checks.within(SECONDS, (2.0, 4.0))].tolist() == [2.0, 3.0, 4.0]
    assert SECONDS[checks.within(SECONDS, (7.5, None))].tolist() == [8.0, 9.0]


# Straight lines on a logarithmic axis


LATER = np.linspace(0.0, 10.0, 101)
FALLS = np.exp(-0.7 * LATER)


def falling(*others, number=100):
    """Runs that fall exponentially, each from a height of its own; these in place of the first."""
    heights = np.linspace(0.5, 3.0, number)[:, None]
    return np.concatenate([np.stack(others), heights[len(others) :] * FALLS]) if others else heights * FALLS


def test_an_exponential_falls_along_a_line_at_its_rate():
    verdict = checks.exponential("says", LATER, falling(), ALL)
    assert verdict.says == "says"
    assert verdict.decision is HOLDS
    assert verdict.found.startswith(
        "100 of 100 runs fall along a line (R² at least 0.99), to 1/e at least, "
        "by no power law below order 10, by 0.7 1/s;"
    )


def test_an_exponential_under_a_little_noise_still_falls_along_a_line():
    noise = 1.0 + 0.02 * np.random.default_rng(3).standard_normal((100, 101))
    assert checks.exponential("says", LATER, falling() * noise, ALL).decision is HOLDS


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
    assert checks.exponential("says", LATER, other * np.linspace(0.5, 3.0, 20)[:, None], ALL).decision is FAILS


@pytest.mark.parametrize("order", [0.5, 1.0, 2.0, 4.0, 8.0])
@pytest.mark.parametrize("began", [-5.0, 0.0])
@pytest.mark.parametrize("falls_to", [0.9, np.exp(-1.0), 0.3, 0.1, 0.01])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_a_power_law_is_no_exponential_over_whatever_span(order, began, falls_to, noise):
    """Before: 1/t^2 from 10 to 18 s was one, as its logarithm is straight to R² of 0.99."""
    last = 10.0 * falls_to ** (-1.0 / order)
    seconds = np.linspace(10.0, last, 100)
    drawn = np.random.default_rng(5).standard_normal((60, 100))
    verdict = checks.exponential("says", seconds + began, seconds**-order * (1.0 + noise * drawn), ALL)
    assert verdict.decision is not HOLDS
    if noise == 0.0:
        assert verdict.decision is FAILS


def test_a_fall_too_short_or_too_noisy_for_its_curvature_is_open():
    for span, noise, decision in (((0.0, 10.0), 0.02, HOLDS), ((0.0, 1.6), 1e-3, HOLDS), ((0.0, 1.6), 0.02, OPEN)):
        drawn = 1.0 + noise * np.random.default_rng(4).standard_normal((100, 101))
        assert checks.exponential("says", LATER, falling() * drawn, span).decision is decision


def test_a_power_law_is_of_an_order_above_all_below_its_own():
    for began, order in ((1.0, 3.0), (20.0, 12.0)):
        found = fall(LATER, (began + LATER[None]) ** -order)
        for below in (order - 2.0, order + 4.0):
            (surely,), (unsure,) = found.exceeds(below)
            assert (surely, unsure) == (below < order, False)


def test_errors_that_are_alike_from_moment_to_moment_tell_less():
    rng = np.random.default_rng(6)
    noise = rng.standard_normal((1000, 101))
    for memory, share in ((0.0, 0.98), (0.5, 0.97), (0.9, 0.87)):
        alike = noise.copy()
        for tick in range(1, 101):
            alike[:, tick] = memory * alike[:, tick - 1] + np.sqrt(1.0 - memory**2) * noise[:, tick]
        found = fall(LATER, FALLS * np.exp(0.02 * alike))
        assert np.mean((found.low <= 0.0) & (found.high >= 0.0)) > share


def test_what_falls_by_next_to_nothing_or_at_two_moments_is_open():
    """Before: any two moments are on a line, and 3 m that became 2.99 m fell along one."""
    assert checks.exponential("says", LATER, falling(), (0.0, 0.1)).decision is OPEN
    slowly = 3.0 * np.exp(-3e-4 * LATER) * np.ones((100, 1))
    verdict = checks.exponential("says", LATER, slowly, ALL)
    assert verdict.decision is OPEN
    assert "0 of 100 runs fall along a line" in verdict.found


@pytest.mark.parametrize("rate", [1.0, 400.0])
def test_of_an_error_that_comes_to_nothing_there_is_no_logarithm(rate):
    seconds = np.arange(0.0, 5.0, 0.01)
    falling = np.exp(-rate * seconds) * np.ones((50, 1))
    falling[:, -1] = 0.0
    assert checks.exponential("says", seconds, falling, ALL).decision is OPEN


def test_an_exponential_is_looked_for_in_its_span_only():
    restless = np.where((LATER < 2.0) | (LATER > 6.0), 1.0 + np.sin(9.0 * LATER) ** 2, FALLS) * np.ones((100, 1))
    for span, decision in ((ALL, FAILS), ((2.0, None), FAILS), ((0.0, 6.0), FAILS), ((2.0, 6.0), HOLDS)):
        assert checks.exponential("says", LATER, restless, span).decision is decision
    with pytest.raises(ValueError, match="no moment lies in its span from 30 s on"):
        checks.exponential("says", LATER, restless, (30.0, None))


@pytest.mark.parametrize("last", [np.nan, np.inf, 0.0, 1.0], ids=["no number", "overflowed", "exact", "constant"])
def test_a_run_without_a_line_is_one_run_that_does_not_fall(last):
    verdict = checks.exponential("says", LATER, falling(np.where(LATER < 5.0, 1.0, last)), ALL)
    assert verdict.decision is HOLDS
    assert verdict.found.startswith("99 of 100 runs fall")
    rate = float(verdict.found.split("order 10, by ")[1].split(" 1/s")[0])
    assert 0.6 < rate < 0.8


# Every check, of what tells nothing


def first(error):
    return error.mean(axis=2)[:1]


def second(error):
    return error.mean(axis=2)[1:2]


EVERY = {
    "flat": lambda error: checks.flat("says", error.mean(axis=2), 2.0, "m"),
    "approaches": lambda error: checks.approaches("says", error.mean(axis=2), error[::-1].mean(axis=2), 0.5),
    "lower": lambda error: checks.lower("says", first(error), second(error), "m", paired=True),
    "lower, apart": lambda error: checks.lower("says", first(error), second(error), "m", paired=False),
    "ratio": lambda error: checks.ratio("says", *first(error), *second(error), (0.5, 2.0), paired=True),
    "value": lambda error: checks.value("says", *first(error), 1.0, (0.5, 2.0), "m"),
    "stays_below": lambda error: checks.stays_below("says", SECONDS, error[0], 1.0, ALL, "m"),
    "leaves": lambda error: checks.leaves("says", SECONDS, error[0], 1.0, ALL, "m"),
    "exponential": lambda error: checks.exponential("says", SECONDS, error[0], ALL),
    "below_in_mean": lambda error: below_in_mean(error[0][..., None], error[1][..., None]),
    "follows": lambda error: follows(error[0][..., None], error[1]),
    "never_above": lambda error: checks.never_above("says", error[0].ravel(), error[1].ravel()),
}
OF_RUNS = {
    name: check for name, check in EVERY.items() if name != "never_above"
}  # which is sure of every number it has


@pytest.mark.parametrize("check", EVERY.values(), ids=EVERY)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), number=st.integers(1, 60))
def test_nothing_holds_of_runs_that_are_without_a_number_at_some_moment(check, seed, number):
    rng = np.random.default_rng(seed)
    error = 0.1 * rng.random((3, number, 10))
    np.put_along_axis(error, rng.integers(10, size=(3, number, 1)), np.nan, axis=2)
    assert check(error).decision is not HOLDS


@pytest.mark.parametrize("check", OF_RUNS.values(), ids=OF_RUNS)
@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32 - 1), spread=st.floats(0.01, 100.0))
def test_one_run_decides_nothing(check, seed, spread):
    error = np.exp(spread * np.random.default_rng(seed).standard_normal((3, 1, 10)))
    assert check(error).decision is OPEN


@pytest.mark.parametrize("check", OF_RUNS.values(), ids=OF_RUNS)
def test_nothing_is_decided_where_no_run_has_a_number(check):
    assert check(np.full((3, 50, 10), np.nan)).decision is OPEN
