"""Rates that change over time: a message waits until so many bits have been able to pass."""

from itertools import pairwise

import numpy as np
import pytest

from netem.impairments.rate import Rate
from netem.impairments.rate_over_time import RateOverTime

DT = 0.1


def changing(ticks, *rates, queue=1e9):
    return RateOverTime(DT, np.array(ticks), np.array(rates)[:, None], np.zeros(1), np.array([queue]))


def test_a_rate_that_never_changes_is_the_same_as_without_time():
    still, moving = Rate(np.array([1000.0]), np.zeros(1), np.array([300.0])), changing([0], 1000.0, queue=300.0)
    debt = still.begin()
    for tick in range(20):
        bits, offered = np.array([70.0, 50.0]), np.array([[True], [tick % 3 > 0]])
        one, other = (each.at(tick).admit(each.at(tick).rest(debt, DT), bits, offered) for each in (still, moving))
        for field, same in zip(one, other, strict=True):
            np.testing.assert_allclose(np.where(offered, field, 0.0), np.where(offered, same, 0.0), rtol=1e-12)
        debt = one.debt


@pytest.mark.parametrize(
    ("tick", "bits", "seconds"),
    [
        (0, 50.0, 0.05),  # within the first rate
        (0, 100.0, 0.1),  # just all of it
        (0, 110.0, 0.35),  # nothing passes for two ticks, then 200 bit/s
        (1, 10.0, 0.25),
        (2, 10.0, 0.15),
        (3, 10.0, 0.05),
        (9, 10.0, 0.05),  # the last rate holds
        (1, 0.0, 0.0),
    ],
)
def test_what_waits_passes_when_the_rates_to_come_let_it(tick, bits, seconds):
    limit = changing([0, 1, 3], 1000.0, 0.0, 200.0)
    np.testing.assert_allclose(limit.seconds(tick, np.array([[bits]])), [[seconds]], rtol=1e-12)


def test_after_the_last_rate_of_0_nothing_ever_passes():
    assert changing([0, 1], 1000.0, 0.0).seconds(0, np.array([[101.0]])) > 1e9


def test_debts_shrink_by_the_rate_of_the_tick_that_went_by():
    limit = changing([0, 1, 3], 1000.0, 0.0, 200.0)
    debt, held = np.array([150.0]), []
    for tick in range(1, 6):
        debt = limit.at(tick).rest(debt, DT)
        held.append(debt.item())
    np.testing.assert_allclose(held, [50.0, 50.0, 50.0, 30.0, 10.0])


def test_what_is_sent_arrives_when_it_has_passed_whatever_the_rates():
    """A queue under rates at random: the bits that have passed by a message's due time are those sent up to it."""
    rng = np.random.default_rng(2)
    rates = rng.choice([0.0, 300.0, 2000.0], 60)
    limit, debt, sent, due = changing(range(60), *rates), np.zeros(1), 0.0, []
    for tick in range(40):
        debt = limit.at(tick).rest(debt, DT) if tick else debt
        idle = tick * DT if debt <= 0.0 else None
        debt, _, wait = limit.at(tick).admit(debt, np.array([40.0]), np.ones((1, 1), dtype=bool))
        sent += 40.0
        due.append((tick, idle, tick * DT + wait.item()))
    for before, after in pairwise(due):
        begins = max(before[2], after[0] * DT) if after[1] is None else after[1]
        grid = np.clip(np.arange(61) * DT, begins, after[2])
        assert np.diff(grid) @ rates == pytest.approx(40.0, abs=1e-6)


def test_what_just_passes_before_a_rate_falls_to_0_does_not_wait_for_the_next():
    # 5.0 - 4.9 is a little less than 0.1: a message waited for 2.5 s for the sake of a part of a bit.
    for tick in range(1, 500):
        limit = RateOverTime(
            0.01, np.array([0, tick, 750]), np.array([[25600.0], [0.0], [1e5]]), np.zeros(1), np.ones(1)
        )
        before = max(0, tick - 10)
        waited = limit.seconds(before, np.array([[256.0 * (tick - before)]])).item()
        assert waited == pytest.approx(0.01 * (tick - before), abs=1e-9)
