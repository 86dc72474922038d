"""Checkers of a pursuit: the target is found, and agents agree on where it is."""

from functools import cache

import numpy as np
import pytest
from flying import plan_of
from judged import changed, tampered
from pursuits import ALONE, COARSE, NAME
from scripted import timeline

from affinet.runtimes.rehearsing import rehearse
from affinet.verdicts import invariants
from affinet.verdicts.pursued import agreed, found


@cache
def flown(*overrides, name=NAME):
    return rehearse(plan_of(name, *COARSE * (name == NAME), "time.duration=0.5", *overrides))


def off(run):
    steered, nominal = run.arrays["reference"][:, :, 0], run.plan.world.formation.nominal
    from_target = np.linalg.norm(steered - (run.arrays["target"] - nominal), axis=-1).max(axis=1)
    from_mean = np.linalg.norm(steered - steered.mean(axis=1, keepdims=True), axis=-1).max(axis=1)
    return from_target, from_mean


@pytest.mark.parametrize(("checker", "which"), [(found, 0), (agreed, 1)])
def test_the_farthest_agent_decides_from_the_time_on(checker, which):
    run = flown(ALONE)
    largest = off(run)[which][20:].max()
    assert largest > 0.0
    assert checker(largest * 1.001, by=0.2)(run).verdict == "pass"
    missed = checker(largest * 0.999, by=0.2)(run)
    assert missed.verdict == "fail"
    assert missed.tick == 20 + np.argmax(off(run)[which][20:])
    # One agent, in one tick.
    astray = tampered(run, reference=changed(run.arrays["reference"], (30, 6, 0), [90.0, 0.0]))
    told = checker(50.0)(astray)
    assert (told.verdict, told.tick) == ("fail", 30)
    assert "agent 7 is" in told.says
    assert checker(50.0, by=0.31)(astray).verdict == "pass"


def test_who_is_off_alike_agrees_and_has_not_found():
    run = flown(ALONE)
    steered = run.arrays["reference"].copy()
    steered[:, :, 0] = steered[:, :1, 0] + 100.0
    together = tampered(run, reference=steered)
    assert agreed(1e-9)(together).verdict == "pass"
    assert found(50.0)(together).verdict == "fail"


@pytest.mark.parametrize("checker", [found, agreed])
def test_who_is_dead_counts_for_nothing(checker):
    run = flown(ALONE, timeline({"verb": "kill", "agents": [3], "at": 0.1}))
    assert np.isnan(run.arrays["reference"][20:, 2]).all()
    assert checker(50.0)(run).verdict == "pass"


@pytest.mark.parametrize("checker", [found, agreed])
def test_what_was_not_put_to_the_test_is_vacuous(checker):
    resting = flown(name="localization")
    assert checker(1.0)(resting).verdict == "vacuous"
    assert checker(1.0, by=99.0)(flown(ALONE)).verdict == "vacuous"
    nobody = tampered(flown(ALONE), reference=flown(ALONE).arrays["reference"] * np.nan)
    assert checker(1.0)(nobody).verdict == "vacuous"


def test_one_who_speaks_alone_agrees_with_nobody():
    run = flown(ALONE, timeline({"verb": "kill", "agents": list(range(2, 11)), "at": 0.1}))
    told = agreed(50.0)(run)
    assert (told.verdict, told.says) == ("vacuous", "in some tick one agent alone said where it is")
    assert found(50.0)(run).verdict == "pass"


def test_words_name_these_checkers():
    assert invariants.parse("found(0.5, by=2)").name == "found(0.5, by=2)"
    assert invariants.parse("agreed(0.5)").name == "agreed(0.5, by=0)"
    with pytest.raises(ValueError, match="within is 0: give a finite number above 0"):
        found(0.0)
    with pytest.raises(ValueError, match="by is -1"):
        agreed(1.0, by=-1.0)
