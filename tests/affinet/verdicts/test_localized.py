"""Checkers of localization: agents are localized, and their estimates do not ring."""

import numpy as np
import pytest
from judged import changed, tampered
from localized_runs import FOUR, ROW, flown, known
from scripted import timeline

from affinet.verdicts import checkers, invariants
from affinet.verdicts.checkers import localized, smooth
from analysis.metrics.localization import centroid, ringing
from analysis.models.jacobi import weights


def elsewhere():
    """A run in which nobody localizes."""
    return flown(*FOUR, 'agents.estimator="none"', "time.duration=0.2")


def test_agents_that_came_to_the_optimum_are_localized():
    run = flown("time.duration=2")
    found = localized(1e-6, by=1.5)(run)
    assert (found.verdict, found.tick) == ("pass", None)
    assert found.checker == "localized(1e-06, by=1.5)"


def test_localized_fails_at_the_first_tick_in_which_they_are_too_far_off():
    run = flown("time.duration=2")
    found = localized(1e-6)(run)
    assert (found.verdict, found.tick) == ("fail", 0)
    place = changed(run.arrays["place"], (180, 2), run.arrays["place"][180, 2] + 1.0)
    found = localized(1e-3, by=1.5)(tampered(run, place=place))
    assert (found.verdict, found.tick) == ("fail", 180)
    assert "m off" in found.says
    assert localized(1e-3, by=1.81)(tampered(run, place=place)).verdict == "pass"


def test_those_left_are_localized_when_one_dies_and_stays_dead():
    dead = timeline({"verb": "kill", "at": 1.7, "agents": [4]})
    run = flown(dead, "network.availability=0.8", "time.duration=2")
    assert np.isnan(run.arrays["place"][-1, 3]).all()
    # What was lost has their centroid drift.
    assert np.linalg.norm(centroid(run.arrays["place"][169], weights(known(run)))) > 0.01
    found = localized(1e-3, by=1.5)(run)
    assert (found.verdict, found.tick) == ("pass", None)
    # One of those left is off.
    place = changed(run.arrays["place"], (180, 2), run.arrays["place"][180, 2] + 1.0)
    found = localized(1e-3, by=1.5)(tampered(run, place=place))
    assert (found.verdict, found.tick) == ("fail", 180)


def test_where_nobody_localizes_or_the_run_is_over_localized_is_vacuous():
    assert localized(1.0)(elsewhere()).verdict == "vacuous"
    assert localized(1.0, by=99.0)(flown("time.duration=2")).verdict == "vacuous"


def test_localized_is_vacuous_when_measurements_do_not_join_all_agents():
    alone = timeline({"verb": "partition", "at": 0, "groups": [[1, 2], [3, 4]]})
    found = localized(1.0)(flown(*FOUR, alone, "time.duration=0.2"))
    assert found.verdict == "vacuous"
    assert "join" in found.says


def test_localized_is_vacuous_when_nothing_was_measured():
    blind = timeline({"verb": "cut", "at": 0, "links": ["all"]})
    run = flown(*FOUR, blind, "time.duration=0.2")
    np.testing.assert_array_equal(run.arrays["place"], np.zeros((20, 4, 2)))
    assert localized(1.0)(run).verdict == "vacuous"


def test_estimates_that_ring_are_not_smooth():
    calm, rough = (flown(*ROW, "time.duration=0.6", f"agents.parameters.jor={{h={h}}}") for h in (0.49, 0.99))
    assert smooth(0.05)(calm).verdict == "pass"
    found = smooth(0.05)(rough)
    assert found.verdict == "fail"
    share = ringing(rough.arrays["place"]).mean()
    assert f"{share:.2%}" in found.says
    assert smooth(share + 1e-9)(rough).verdict == "pass"
    assert smooth(share - 1e-9)(rough).verdict == "fail"
    assert smooth(0.05)(elsewhere()).verdict == "vacuous"


@pytest.mark.parametrize(("text", "name"), [("localized(0.5, by=2)", "localized(0.5, by=2)"), ("smooth(0.1)",) * 2])
def test_words_name_these_checkers(text, name):
    assert invariants.parse(text).name == name
    assert {checkers.localized, checkers.smooth} <= set(invariants.NAMED.values())
