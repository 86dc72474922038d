"""The offset of two clocks, measured over ways of any delay."""

import pytest

from netem.wire.offset import ClockOffset, measured


class Trips:
    """A clock here, and one `ahead` of it over there, with the delays of each way."""

    def __init__(self, ahead_s, ways):
        self.now_s, self._ahead_s, self._ways = 100.0, ahead_s, iter(ways)

    def ask(self):
        there, back = next(self._ways)
        self.now_s += there
        answered_s = self.now_s + self._ahead_s
        self.now_s += back
        return answered_s

    def clock(self):
        return self.now_s


@pytest.mark.parametrize("ahead_s", [-3.0, 0.0, 41.5])
def test_the_quickest_trip_says_it_and_half_of_it_is_how_wrong_it_may_be(ahead_s):
    trips = Trips(ahead_s, [(0.3, 0.1), (0.002, 0.004), (0.05, 0.01)])
    found = measured(trips.ask, trips.clock, rounds=3)
    assert found.uncertainty_s == pytest.approx(0.003)
    assert found.offset_s == pytest.approx(ahead_s - 0.001)


@pytest.mark.parametrize("ways", [(0.0, 0.01), (0.01, 0.0), (0.005, 0.005)])
def test_it_is_never_further_off_than_it_says_however_unlike_the_ways_are(ways):
    found = measured(*(lambda trips: (trips.ask, trips.clock))(Trips(7.0, [ways])), rounds=1)
    assert abs(found.offset_s - 7.0) <= found.uncertainty_s + 1e-9


def test_offsets_by_a_third_machine_add_up_and_so_does_how_wrong_they_may_be():
    to_coordinator, to_medium = ClockOffset(5.0, 0.1), ClockOffset(-2.0, 0.2).back
    assert to_coordinator.then(to_medium) == ClockOffset(7.0, pytest.approx(0.3))
