"""The world: what is sensed, and where the agents are in the next tick."""

from dataclasses import replace

import numpy as np
import pytest

from netem.links import Links
from world.formation import PRESETS, Formation
from world.maneuver import corridor, hover
from world.world import World

ZHAO7 = PRESETS["zhao7"]
NOBODY = np.zeros(7, dtype=bool)


@pytest.fixture
def world():
    return World(
        seed=1,
        dt=0.01,
        ticks=6000,
        formation=ZHAO7,
        links=Links.both_ways(7, ZHAO7.edges),
        manoeuvre=hover(np.arange(6001) * 0.01, 2),
        covariance=0.01 * np.eye(2),
        disturbance=0.0,
        spread=1.0,
    )


def noise_of(world, ticks):
    z = ZHAO7.nominal
    true = z[world.links.dst - 1] - z[world.links.src - 1]
    return np.concatenate([world.measure(tick, z) - true for tick in ticks])


@pytest.mark.parametrize("R", [[[0.01, 0.0], [0.0, 0.01]], [[0.01, 0.003], [0.003, 0.01]], [[4.0, -1.0], [-1.0, 0.5]]])
def test_sensor_noise_has_the_covariance_asked_for(world, R):
    drawn = noise_of(replace(world, covariance=np.array(R)), range(4200))
    assert len(drawn) > 1e5
    scale = np.sqrt(np.outer(np.diag(R), np.diag(R)))
    np.testing.assert_allclose(np.cov(drawn.T) / scale, R / scale, atol=0.015)
    np.testing.assert_allclose(drawn.mean(axis=0) / np.sqrt(np.diag(R)), 0.0, atol=0.015)


def test_sensor_noise_of_a_tick_says_nothing_of_the_next_and_of_other_links(world):
    drawn = noise_of(world, range(4000)).reshape(4000, 24, 2) / 0.1
    assert abs((drawn[1:] * drawn[:-1]).mean()) < 0.01
    assert abs((drawn[:, 1:] * drawn[:, :-1]).mean()) < 0.01


def test_measured_is_the_position_relative_to_the_neighbour(world):
    exact = replace(world, covariance=1e-24 * np.eye(2))
    z = np.random.default_rng(1).normal(size=(7, 2))
    row = exact.links.index[4, 2]  # what 2 sees of 4
    np.testing.assert_allclose(exact.measure(0, z)[row], z[1] - z[3], atol=1e-10)


def test_noise_is_added_to_what_is_sensed_wherever_the_agents_are(world):
    z = np.random.default_rng(1).normal(size=(7, 2))
    moved = world.measure(3, z) - world.measure(3, np.zeros((7, 2)))
    np.testing.assert_allclose(moved, z[world.links.dst - 1] - z[world.links.src - 1], atol=1e-12)


def test_noise_of_a_link_is_the_same_whatever_other_agents_exist(world):
    few = Formation(ZHAO7.nominal[:3], ((1, 2), (1, 3)), (1, 2, 3))
    small = replace(world, formation=few, links=Links.both_ways(3, few.edges))
    for tick in (0, 1, 64, 5000):
        large_noise, small_noise = world.measure(tick, np.zeros((7, 2))), small.measure(tick, np.zeros((3, 2)))
        for link, row in small.links.index.items():
            assert small_noise[row].tobytes() == large_noise[world.links.index[link]].tobytes()


def test_noise_is_the_same_in_whatever_order_the_ticks_are_asked_for(world):
    z = ZHAO7.nominal
    forwards = {tick: world.measure(tick, z).tobytes() for tick in (0, 5, 70, 200)}
    backwards = {tick: replace(world).measure(tick, z).tobytes() for tick in (200, 70, 5, 0)}
    assert forwards == backwards
    assert len(set(forwards.values())) == 4


def test_another_seed_is_another_noise(world):
    assert not np.isclose(noise_of(world, [0]), noise_of(replace(world, seed=2), [0])).any()


def test_step_integrates_the_velocity(world):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    np.testing.assert_allclose(world.step(0, z, u, NOBODY), z + 0.01 * u, atol=1e-15)


def test_absent_agents_hold_still(world):
    z, u = np.random.default_rng(1).normal(size=(2, 7, 2))
    absent = np.array([0, 0, 0, 1, 0, 0, 1], dtype=bool)
    after = world.step(0, z, u, absent)
    np.testing.assert_array_equal(after[absent], z[absent])
    np.testing.assert_allclose(after[~absent], (z + 0.01 * u)[~absent], atol=1e-15)


def test_absent_agents_hold_still_under_disturbance_too(world):
    z = ZHAO7.nominal
    absent = np.array([0, 0, 0, 1, 0, 0, 1], dtype=bool)
    after = replace(world, disturbance=0.1).step(0, z, np.zeros((7, 2)), absent)
    np.testing.assert_array_equal(after[absent], z[absent])


def test_disturbance_is_a_displacement_per_tick_of_the_deviation_asked_for(world):
    gusty, origin = replace(world, disturbance=0.2), np.zeros((7, 2))
    drawn = np.array([gusty.step(tick, origin, origin, NOBODY) for tick in range(5000)])
    assert drawn.std() == pytest.approx(0.2, rel=0.02)
    np.testing.assert_allclose(np.corrcoef(drawn.reshape(5000, 14).T), np.eye(14), atol=0.06)


def test_disturbance_of_an_agent_is_the_same_whatever_other_agents_exist(world):
    few = Formation(ZHAO7.nominal[:3], ((1, 2), (1, 3)), (1, 2, 3))
    small = replace(world, formation=few, links=Links.both_ways(3, few.edges), disturbance=0.2)
    large = replace(world, disturbance=0.2)
    seven = large.step(9, np.zeros((7, 2)), np.zeros((7, 2)), NOBODY)
    three = small.step(9, np.zeros((3, 2)), np.zeros((3, 2)), NOBODY[:3])
    assert three.tobytes() == seven[:3].tobytes()


def test_leaders_start_on_their_targets_and_followers_about_theirs(world):
    flying = replace(world, manoeuvre=corridor(np.arange(6001) * 0.01), spread=0.5)
    starts = np.array([replace(flying, seed=seed).start() for seed in range(500)])
    offset = starts - flying.target(0)
    np.testing.assert_array_equal(offset[:, :3], 0.0)
    assert offset[:, 3:].std() == pytest.approx(0.5, rel=0.05)
    assert np.abs(offset[:, 3:].mean(axis=0)).max() < 0.1


def test_spread_zero_starts_everybody_on_target(world):
    np.testing.assert_array_equal(replace(world, spread=0.0).start(), ZHAO7.nominal)
