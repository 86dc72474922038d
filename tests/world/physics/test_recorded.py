"""A recorded flight in place of bodies and sensors."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of

from netem.faults.fault import Fault, Verb
from netem.faults.timeline import Timeline
from world.physics.recorded import RecordedFlight

TICKS = 4
PLAN = plan_of("corridor", "time.duration=0.04")
AGENTS, LINKS = PLAN.world.links.agents, len(PLAN.world.links)
RNG = np.random.default_rng(1)
FLIGHT = RecordedFlight(
    measured=RNG.normal(size=(TICKS, LINKS, 2)),
    position=RNG.normal(size=(TICKS + 1, AGENTS, 2)),
    input=RNG.normal(size=(TICKS, AGENTS, 2)),
)
WORLD = replace(PLAN.world, flight=FLIGHT)
CALM = Timeline(WORLD.links, []).at(0)


def test_it_says_what_was_sensed_and_where_that_led():
    scene = WORLD.begin()
    for tick in range(TICKS):
        np.testing.assert_array_equal(scene.position, FLIGHT.position[tick])
        measured = WORLD.measure(tick, scene, CALM)
        np.testing.assert_array_equal(measured, FLIGHT.measured[tick])
        flown = WORLD.flown(tick, scene, np.full((AGENTS, 2), 7.0), CALM)
        np.testing.assert_array_equal(flown, FLIGHT.input[tick])
        scene = WORLD.step(tick, scene, measured, flown, CALM)
    np.testing.assert_array_equal(scene.position, FLIGHT.position[TICKS])


def test_agents_are_told_what_they_have_flown_since_the_tick_before():
    np.testing.assert_array_equal(WORLD.told(0), np.zeros((AGENTS, 2)))
    np.testing.assert_array_equal(WORLD.told(2), FLIGHT.input[1])
    assert PLAN.world.told(2) is None


def test_a_frozen_sensor_says_again_what_it_said():
    frozen = Timeline(WORLD.links, [Fault(Verb.FREEZE, 1, 3, pairs=((1, 4),))])
    scene, row = WORLD.begin(), WORLD.links.index[1, 4]
    said = []
    for tick in range(TICKS):
        said.append(WORLD.measure(tick, scene, frozen.at(tick)))
        scene = WORLD.step(tick, scene, said[-1], FLIGHT.input[tick], frozen.at(tick))
    np.testing.assert_array_equal([one[row] for one in said[:3]], [FLIGHT.measured[0, row]] * 3)
    np.testing.assert_array_equal(said[3], FLIGHT.measured[3])


@pytest.mark.parametrize("place", [(0, 0, 0), (TICKS, AGENTS - 1, 1)])
def test_without_a_position_there_is_no_reference(place):
    position = FLIGHT.position.copy()
    position[place] = np.nan
    assert FLIGHT.has_reference
    assert not replace(FLIGHT, position=position).has_reference


def test_side_by_side_each_swarm_flies_it():
    two = FLIGHT.side_by_side(2)
    np.testing.assert_array_equal(two.measured[:, LINKS:], FLIGHT.measured)
    np.testing.assert_array_equal(two.position[:, :AGENTS], FLIGHT.position)
    assert two.input.shape == (TICKS, 2 * AGENTS, 2)
