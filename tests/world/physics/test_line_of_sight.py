"""A sensor that is surer along the line of sight than across it: section VII of paper 003."""

import numpy as np
import pytest
from flying import plan_of
from localized_runs import FOUR, NAME
from measured_graphs import LINE_OF_SIGHT, SPACES

from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError


def turn(angle):
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def test_the_covariance_of_a_line_of_sight_is_that_of_section_vii():
    for distance, angle in zip((0.5, 2.0, 7.0, 1.0), (0.3, -2.0, 3.1, np.pi / 2), strict=True):
        R = turn(angle)
        expected = R.T @ np.diag([(0.15 * distance) ** 2, (0.1 * distance) ** 2]) @ R
        along = distance * np.array([np.cos(angle), np.sin(angle)])
        np.testing.assert_allclose(LINE_OF_SIGHT[2].spread(along), expected, atol=1e-14)


def test_the_covariance_printed_in_section_vii_is_one():
    printed = np.array([[0.0659, -0.0273], [-0.0273, 0.0954]])
    values, vectors = np.linalg.eigh(printed)
    distance = np.sqrt(values[0]) / 0.1  # its larger deviation must be that along, 0.15 of the same distance
    np.testing.assert_allclose(LINE_OF_SIGHT[2].spread(distance * vectors[:, 1]), printed, atol=1e-4)


@SPACES
def test_measurements_spread_as_a_line_of_sight_says(dimension):
    rng, sensor = np.random.default_rng(4), LINE_OF_SIGHT[dimension]
    for true in (np.array([2.0, -1.0, 0.5]), np.array([-3.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0])):
        true = true[:dimension]
        noise = rng.normal(size=(40_000, dimension)) @ np.linalg.cholesky(sensor.covariance).T
        said = sensor.measured(np.broadcast_to(true, noise.shape), noise)
        spread, size = sensor.spread(true), max(true @ true, 1e-9)
        np.testing.assert_allclose(said.mean(axis=0), true, atol=4 * 0.15 * np.sqrt(size / 40_000))
        np.testing.assert_allclose(np.cov(said.T), spread, atol=0.03 * 0.15**2 * size)
        across = np.eye(dimension) - np.outer(true, true) / size
        direct = 0.15**2 * np.outer(true, true) + 0.1**2 * (true @ true) * across
        np.testing.assert_allclose(spread, direct, atol=1e-15)


def test_a_mean_of_samples_spreads_less():
    one, four = (plan_of(NAME, f"sensing.samples={number}").world.sensor for number in (1, 4))
    line = np.array([1.0, 2.0])
    np.testing.assert_allclose(four.spread(line), one.spread(line) / 4)


@pytest.mark.parametrize(
    ("sensing", "says"),
    [
        ("{sigma_along=0.1}", "sigma_along and sigma_across"),
        ("{sigma_across=0.1}", "sigma_along and sigma_across"),
        ("{sigma_along=0.1,sigma_across=0.1,sigma=0.1}", "give sigma"),
        ("{sigma_along=0.1,sigma_across=0.1,covariance=[[1,0],[0,1]]}", "give sigma"),
        ("{sigma_along=0.1,sigma_across=0.1,sigma_range=0.1,sigma_bearing=0.1}", "give sigma"),
        ("{sigma_along=0.0,sigma_across=0.1}", "sigma_along"),
    ],
)
def test_deviations_along_and_across_go_together_and_exclude_others(sensing, says):
    with pytest.raises(ScenarioError, match=says):
        loading.load(NAME, [f"sensing={sensing}"])


def test_deviations_along_and_across_are_shares_of_the_distance():
    for dimension, nodes in ((2, FOUR[0]), (3, "formation.nodes=[[0,0,0],[3,1,1],[1,4,-2],[4,5,2]]")):
        sensor = plan_of(NAME, *FOUR, nodes, "sensing={sigma_along=0.2,sigma_across=0.05}").world.sensor
        assert sensor.reads == "line-of-sight"
        np.testing.assert_allclose(sensor.covariance, np.diag([0.04] + [0.0025] * (dimension - 1)))
