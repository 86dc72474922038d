"""Detectors: which method each uses next, what it misses, and what it takes for the target."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of
from pursuits import COARSE, FEW, NAME, refusal
from targets import at_random

from affinet.runtimes.rehearsing import rehearse

AT_RANDOM = at_random(2)
MANY = 20_000
WHO = np.tile(np.arange(1, 11), MANY // 10)
SEEDS = np.repeat(np.arange(1, MANY // 10 + 1, dtype=np.uint64), 10)
HERE, SURE = np.zeros((MANY, 2)), np.full(MANY, 0.1)


def chosen(detectors, turn=0, tick=3):
    return detectors.chosen(tick, SEEDS, WHO, np.full(MANY, turn))


def found(detectors):
    return detectors.found(3, SEEDS, WHO, HERE, SURE)


def share_is(mask, p):
    assert abs(mask.mean() - p) < 4.5 * np.sqrt(p * (1 - p) / MANY)


def test_methods_are_as_frequent_as_is_said():
    some = replace(AT_RANDOM, probabilities=np.array([0.2, 0.7, 0.1]))
    for method, p in enumerate((0.2, 0.7, 0.1)):
        share_is(chosen(some) == method, p)
    assert (chosen(some) != chosen(some, tick=4)).any()
    np.testing.assert_array_equal(chosen(some), chosen(some, turn=9))


def test_methods_go_by_turns_or_by_agent():
    by_turns = replace(AT_RANDOM, schedule=np.tile([0, 1, 1], (10, 1)))
    assert [int(chosen(by_turns, turn)[0]) for turn in range(7)] == [0, 1, 1, 0, 1, 1, 0]
    by_agent = replace(AT_RANDOM, schedule=(np.arange(10) % 3)[:, None])
    for turn in (0, 5):
        np.testing.assert_array_equal(chosen(by_agent, turn), (WHO - 1) % 3)


def test_a_share_of_detections_finds_nothing_and_the_others_find_what_they_did():
    sure, some = found(AT_RANDOM), found(replace(AT_RANDOM, misses=0.3))
    missed = np.isnan(some).any(axis=1)
    share_is(missed, 0.3)
    np.testing.assert_array_equal(some[~missed], sure[~missed])
    assert np.isnan(some[missed]).all()


def test_a_share_of_detections_finds_something_else():
    sure, some = found(AT_RANDOM), found(replace(AT_RANDOM, misses=0.3, false_positives=0.2, clutter=5.0))
    missed = np.isnan(some).any(axis=1)
    false = ~missed & (some != sure).any(axis=1)
    share_is(false, 0.2)
    share_is(missed, 0.3 * 0.8)
    assert some[false].std() == pytest.approx(5.0, rel=0.03)


OPTIMAL = 'agents.parameters.target={fusion="none",output="optimal"}'


def seen_by(run):
    """When each agent took in a detection: its optimal estimate jumped off what it predicted."""
    place, velocity = run.arrays["reference"][:, :, 0], run.arrays["reference"][:, :, 1]
    jumped = (np.abs(place[1:] - place[:-1] - 0.01 * velocity[:-1]) > 1e-9).any(axis=-1)
    return [np.flatnonzero(jumped[:, agent]) + 1 for agent in range(place.shape[1])]


def test_a_flight_keeps_to_the_methods_it_is_given():
    short = (NAME, *COARSE, FEW, "time.duration=0.9", OPTIMAL)
    turns = rehearse(plan_of(*short, "target.schedule=[1,2,2]"))
    for ticks in seen_by(turns):
        np.testing.assert_array_equal(ticks, [20, 30, 40, 60, 70, 80])
    each = rehearse(plan_of(*short, "target.methods=[1,2,1]"))
    for agent, ticks in enumerate(seen_by(each)):
        np.testing.assert_array_equal(ticks, np.arange(10, 90, 10) if agent == 1 else np.arange(20, 90, 20))


def test_who_finds_nothing_predicts():
    short = (NAME, *COARSE, FEW, "time.duration=0.9", OPTIMAL, "target.methods=[2,2,2]")
    nothing = rehearse(plan_of(*short, "target.misses=1"))
    assert not nothing.arrays["found"].any()
    assert (np.diff(nothing.arrays["variance"][:, 0]) > 0.0).all()
    assert nothing.outcome.verdict == "pass"
    ticks = np.concatenate(seen_by(rehearse(plan_of(*short, "target.misses=0.5"))))
    assert not (ticks % 10).any()
    assert 3 < len(ticks) < 21


def test_a_gate_keeps_what_is_not_the_target_out():
    short = (NAME, *COARSE, FEW, "time.duration=2", "target.false_positives=0.3", "target.clutter=20")
    how = 'agents.parameters.target={fusion="none",gate=%g}'
    off = {}
    for gate in (0.0, 4.0):
        run = rehearse(plan_of(*short, how % gate))
        target = run.arrays["target"] - run.plan.world.formation.nominal
        off[gate] = np.sqrt(((run.arrays["found"] - target) ** 2).sum(axis=-1).mean())
    assert off[4.0] < 0.3 * off[0.0]
    # Nothing is kept out of detections of the target alone, by a wide one.
    clean = [rehearse(plan_of(*short[:-2], how % gate)).arrays["found"] for gate in (0.0, 9.0)]
    np.testing.assert_array_equal(*clean)


@pytest.mark.parametrize(
    ("gate", "told"),
    # 1 - exp(-g^2 / 2) of what is off by two axes: half of it at 1.177
    [(0.0, []), (1.18, []), (1.17, ["gate = 1.17 lets 0.5 of"]), (0.1, ["gate = 0.1 lets 0.005 of"])],
)
def test_a_gate_that_turns_most_detections_away_is_told_of(gate, told):
    plan = plan_of(NAME, f'agents.parameters.target={{fusion="none",gate={gate}}}')
    found = [one.says for one in plan.findings if one.check == "detections"]
    assert [says.partition(" the ")[0] for says in found] == told


@pytest.mark.parametrize(
    ("said", "says"),
    [
        ("target.probabilities=[0.5]", "give a probability for each latency"),
        ("target.probabilities=[0.5,0.4]", "probabilities come to 0.9, not to 1"),
        ("target.schedule=[1,3]", "schedule has a method 3, and there are 2"),
        ("target.methods=[1,2]", "target.methods: give one for each of the 10 agents, in their order"),
        ("agents.parameters.target.gate=-1.0", "gate is a number of standard deviations, or 0, not -1"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(said, says):
    assert says in refusal(said)


def test_one_way_to_choose_methods_is_enough():
    said = refusal("target.schedule=[1]", "target.probabilities=[0.5,0.5]")
    assert "give one of probabilities and schedule: each says which method a detection uses" in said
