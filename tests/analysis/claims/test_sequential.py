"""A share that is asked after a few runs, and after more: how often it is decided wrongly, and what its interval holds."""

import numpy as np
import pytest
from paths import DOCS
from planted_shares import ASKED, CONFIDENCE, EXPERIMENTS, MOST, rates, stopped, table
from scipy import stats

from analysis.claims.sequential import found, looks


def test_the_last_look_is_at_all_runs_and_the_risk_is_spent_and_no_more():
    for most in (1, 2, 3, 7, 25, 200, 1001):
        planned = looks(most, CONFIDENCE)
        numbers = [look.runs for look in planned]
        assert numbers[-1] == most
        assert numbers == sorted(set(numbers))
        assert 2 * sum(1.0 - look.confidence for look in planned) == pytest.approx(1.0 - CONFIDENCE)
    assert [look.runs for look in looks(200, CONFIDENCE)] == [25, 50, 100, 200]


def test_the_interval_is_that_of_clopper_and_pearson():
    for look in looks(40, 0.9):
        interval = found(33, 40, look)
        exact = stats.binomtest(33, 40).proportion_ci(2 * look.confidence - 1.0, method="exact")
        assert (interval.found, interval.low, interval.high) == pytest.approx(
            (33 / 40, exact.low, exact.high), rel=1e-9
        )


def test_of_runs_that_tell_nothing_nothing_is_known():
    interval = found(0, 0, looks(8, CONFIDENCE)[-1])
    assert np.isnan(interval.found)
    assert (interval.low, interval.high) == (0.0, 1.0)


def test_the_interval_holds_the_true_share_as_often_as_it_says():
    for share, of in rates().items():
        assert of.covered >= CONFIDENCE - 2 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / EXPERIMENTS), share


def test_what_is_false_does_not_hold_and_what_is_true_does_not_fail():
    risk = (1 - CONFIDENCE) / 2
    slack = 3 * np.sqrt(risk * (1 - risk) / EXPERIMENTS)
    assert all(of.holds <= risk + slack for share, of in rates().items() if share <= ASKED)
    assert all(of.fails <= risk + slack for share, of in rates().items() if share >= ASKED)
    # Planted: at the very edge it errs, both ways.
    assert min(rates()[ASKED].holds, rates()[ASKED].fails) > 0.0


def test_what_is_clear_is_decided_early():
    assert (rates()[0.5].fails, rates()[0.5].runs) == (1.0, pytest.approx(25, abs=0.5))
    assert rates()[1.0] == (1.0, 0.0, 1.0, 100.0)
    assert rates()[0.8].runs < MOST / 3
    # Nothing tells .95 from .95: it takes all there are.
    assert rates()[ASKED].runs > 0.9 * MOST


def test_the_page_has_what_came_out():
    page = (DOCS / "accuracy.md").read_text(encoding="utf-8")
    assert "\n".join(table()) in page


def test_looking_again_and_again_without_parting_the_risk_would_err_more_often():
    """Planted: an interval of the whole confidence at every look."""
    planned, runs, half = looks(MOST, CONFIDENCE), np.random.default_rng(3).random((EXPERIMENTS, MOST)) < 0.5, 0.5
    slack = 2 * np.sqrt(CONFIDENCE * (1 - CONFIDENCE) / EXPERIMENTS)

    def covered(planned):
        intervals = [stopped(passes, planned, half)[1] for passes in runs]
        return np.mean([interval.low <= half <= interval.high for interval in intervals])

    assert covered([look._replace(confidence=(1 + CONFIDENCE) / 2) for look in planned]) < CONFIDENCE - slack
    assert covered(planned) >= CONFIDENCE - slack
