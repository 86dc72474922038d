"""When agents wake: at moments that are a pure function of seed, agent and number, by clocks that may drift."""

from dataclasses import replace
from itertools import pairwise

import pytest

from agents.timer import OwnClock, Timer

EVEN = Timer(period=0.1, phase=0.02, jitter=0.0, drift=0.0, listens=0.04, factor=1.0, seed=1, agent=3)
SWINGING = Timer(period=0.1, phase=0.02, jitter=0.04, drift=0.0, listens=0.02, factor=1.0, seed=1, agent=3)


def moments(timer, number=600):
    return [timer.moment(n) for n in range(number)]


def test_an_even_timer_wakes_at_its_phase_in_every_period():
    assert moments(EVEN, 3) == pytest.approx([0.02, 0.12, 0.22])


def test_jitter_stays_within_its_bounds_fills_them_and_keeps_the_order():
    swings = [moment - even for moment, even in zip(moments(SWINGING), moments(EVEN), strict=True)]
    assert -0.04 <= min(swings) < -0.039
    assert 0.039 < max(swings) <= 0.04
    assert abs(sum(swings)) / len(swings) < 0.004
    assert all(one < other for one, other in pairwise(moments(SWINGING)))


def test_jitter_is_drawn_by_seed_and_agent_and_not_by_what_was_asked_before():
    forwards, backwards = moments(SWINGING), [SWINGING.moment(n) for n in reversed(range(600))][::-1]
    assert forwards == backwards
    assert forwards != moments(replace(SWINGING, seed=2))
    assert forwards != moments(replace(SWINGING, agent=4))


@pytest.mark.parametrize("timer", [EVEN, SWINGING])
@pytest.mark.parametrize("own_s", [-1.0, 0.0, 0.02, 0.0999, 0.1201, 7.77])
def test_the_next_time_to_wake_is_the_first_that_is_later(timer, own_s):
    following = timer.after(own_s, 0)
    assert timer.moment(following) > own_s
    assert following == 0 or timer.moment(following - 1) <= own_s


def test_nobody_wakes_for_the_same_time_twice():
    assert EVEN.after(0.0, 5) == 5


@pytest.mark.parametrize("drift", [-0.5, 0.0, 0.25])
def test_a_clock_that_drifts_says_so_and_is_read_backwards(drift):
    clock = OwnClock.right(drift)
    assert clock.says(8.0) == pytest.approx(8.0 * (1.0 + drift))
    assert clock.when(clock.says(3.3)) == pytest.approx(3.3)


def test_a_clock_that_begins_to_gain_goes_on_from_what_it_said():
    clock = OwnClock.right(0.0).running(4.0, 2.0)
    assert clock.says(4.0) == pytest.approx(4.0)
    assert clock.says(5.0) == pytest.approx(6.0)
    assert clock.when(6.0) == pytest.approx(5.0)
