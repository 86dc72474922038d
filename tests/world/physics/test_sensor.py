"""Range and bearing (paper 004, section 4.1.1): as printed, as drawn, and as flown."""

from dataclasses import replace

import numpy as np
import pytest
from briefs import brief, hears
from flying import plan_of
from offered import by_affinet

from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.wrong import ScenarioError
from agents.brief import Own
from analysis.models.sensor import Sensor, moments
from netem.medium.verdict import Verdict

SPACES = pytest.mark.parametrize("dimension", [2, 3])
MILLION = 1_000_000


def ranging(*deviations):
    """A sensor of range, and of one bearing or two."""
    return Sensor("range-bearing", np.diag(np.square(deviations)))


def placed(polar):
    """(4.2), and its counterpart in space: azimuth, then elevation."""
    reach, azimuth = polar[..., 0], polar[..., 1]
    elevation = polar[..., 2] if polar.shape[-1] == 3 else np.zeros_like(reach)
    x, y = reach * np.cos(azimuth) * np.cos(elevation), reach * np.sin(azimuth) * np.cos(elevation)
    return np.stack([x, y, reach * np.sin(elevation)], axis=-1)[..., : polar.shape[-1]]


def settings(dimension, number):
    """Means and deviations of range and bearings, from sharp to hopeless, in all directions."""
    rng = np.random.default_rng(dimension)
    reach, azimuth = rng.uniform(0.1, 10, number), rng.uniform(-np.pi, np.pi, number)
    elevation = rng.uniform(-np.pi / 2, np.pi / 2, number)
    means = np.stack([reach, azimuth, elevation], axis=-1)[:, :dimension]
    return zip(means, rng.uniform(0.01, 1.0, (number, dimension)), strict=True)


def at_rest(dimension):
    return Own(np.zeros(dimension), np.zeros(dimension))


def drawn(deviations, seed):
    return np.random.default_rng(seed).normal(size=(MILLION, len(deviations))) * deviations


def expected(noisy, deviations):
    """Mean, and second moments, of what becomes of normal noise: by quadrature, exact for angles to rounding."""
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    grid = np.stack(np.meshgrid(*[nodes] * len(deviations), indexing="ij"), axis=-1).reshape(-1, len(deviations))
    share = np.prod(np.stack(np.meshgrid(*[weights] * len(deviations), indexing="ij"), axis=-1), axis=-1).ravel()
    share /= share.sum()
    values = noisy(grid * deviations)
    return share @ values, np.einsum("k,ki,kj->ij", share, values, values)


def within_standard_errors(values, truth, number=5):
    """Whether the mean of draws (K, ...) is this."""
    error = values.std(axis=0) / np.sqrt(len(values))
    assert (np.abs(values.mean(axis=0) - truth) < number * error).all()


# As printed


def test_mean_and_covariance_in_the_plane_are_those_printed():
    for (mu_R, mu_theta), (sigma_R, sigma_theta) in settings(2, 500):
        mean, covariance = moments(np.array([mu_R, mu_theta]), np.array([sigma_R, sigma_theta]) ** 2)
        once, twice = np.exp(-(sigma_theta**2) / 2), np.exp(-2 * sigma_theta**2)
        np.testing.assert_allclose(
            mean, [mu_R * np.cos(mu_theta) * once, mu_R * np.sin(mu_theta) * once], rtol=0, atol=1e-12
        )
        both = mu_R**2 + sigma_R**2
        var_X = both * (0.5 + 0.5 * twice * np.cos(2 * mu_theta))
        var_X -= mu_R**2 * np.cos(mu_theta) ** 2 * np.exp(-(sigma_theta**2))
        var_Y = both * (0.5 - 0.5 * twice * np.cos(2 * mu_theta))
        var_Y -= mu_R**2 * np.sin(mu_theta) ** 2 * np.exp(-(sigma_theta**2))
        cov_XY = both * 0.5 * np.sin(2 * mu_theta) * twice
        cov_XY -= mu_R**2 * 0.5 * np.sin(2 * mu_theta) * np.exp(-(sigma_theta**2))
        np.testing.assert_allclose(covariance, [[var_X, cov_XY], [cov_XY, var_Y]], rtol=0, atol=1e-12)


@SPACES
def test_the_moments_are_the_integrals(dimension):
    for means, deviations in settings(dimension, 20):
        mean, second = expected(lambda noise, means=means: placed(means + noise), deviations)
        given, covariance = moments(means, deviations**2)
        np.testing.assert_allclose(given, mean, rtol=0, atol=1e-12)
        np.testing.assert_allclose(covariance + np.outer(given, given), second, rtol=0, atol=1e-11)


# As drawn


@pytest.mark.parametrize("means", [(3.0, 2.5), (3.0, 2.5, -0.7)])
def test_the_moments_are_those_of_a_million_draws(means):
    deviations = np.array([0.3, 0.4, 0.5])[: len(means)]
    position = placed(np.array(means) + drawn(deviations, seed=4))
    mean, covariance = moments(np.array(means), deviations**2)
    within_standard_errors(position, mean)
    within_standard_errors(position[:, :, None] * position[:, None, :], covariance + np.outer(mean, mean))


@pytest.mark.parametrize("true", [(-2.0, 1.5), (0.3, -0.1), (-2.0, 1.5, 1.0), (0.0, 0.2, -3.0)])
def test_what_it_says_is_right_in_the_mean_and_spread_as_it_claims(true):
    deviations = np.array([0.3, 0.4, 0.5])[: len(true)]
    sensor, true = ranging(*deviations), np.array(true)
    error = sensor.measured(true, drawn(deviations, seed=5)) - true
    within_standard_errors(error, np.zeros(len(true)))
    within_standard_errors(error[:, :, None] * error[:, None, :], sensor.spread(true))


@SPACES
def test_what_it_says_is_right_in_the_mean_to_rounding(dimension):
    for means, deviations in settings(dimension, 10):
        sensor, true = ranging(*deviations), placed(means)
        mean, second = expected(lambda noise, on=sensor, of=true: on.measured(of, noise), deviations)
        np.testing.assert_allclose(mean, true, rtol=0, atol=1e-12)
        np.testing.assert_allclose(sensor.spread(true), second - np.outer(mean, mean), rtol=1e-10, atol=1e-10)


def first_order(true, deviations):
    """Range errors along the line of sight, and bearing errors across it, as far as the lever is long."""
    reach, level = np.linalg.norm(true), np.hypot(true[0], true[1])
    azimuth, elevation = np.arctan2(true[1], true[0]), np.arcsin(true[2] / reach) if len(true) == 3 else 0.0
    along = placed(np.array([1.0, azimuth, elevation])[: len(true)])
    left = placed(np.array([1.0, azimuth + np.pi / 2, 0.0])[: len(true)])
    axes, lengths = [along, left], [1.0, level]
    if len(true) == 3:
        axes, lengths = [*axes, placed(np.array([1.0, azimuth, elevation + np.pi / 2]))], [*lengths, reach]
    turned = np.stack(axes, axis=-1)
    return turned @ np.diag((np.array(lengths) * deviations) ** 2) @ turned.T


ASIDE = pytest.mark.parametrize("true", [(3.0, -2.0), (3.0, -2.0, 1.0)])


@ASIDE
def test_small_errors_spread_as_at_first_order(true):
    true, coarse = np.array(true), np.array([1.0, 0.7, 0.5])[: len(true)]
    apart = []
    for small in (1e-1, 1e-2, 1e-3):
        expected = first_order(true, small * coarse)
        apart.append(np.abs(ranging(*small * coarse).spread(true) - expected).max() / np.abs(expected).max())
    assert 1e-7 < apart[2] < 1e-6
    assert apart[1] / apart[2] == pytest.approx(100, rel=0.02)
    assert apart[0] / apart[1] == pytest.approx(100, rel=0.1)


@ASIDE
@pytest.mark.parametrize("sigma", [1e-4, 1e-6, 1e-8])
def test_however_sharp_it_is_it_claims_what_is_left(true, sigma):
    true, deviations = np.array(true), np.full(len(true), sigma)
    np.testing.assert_allclose(ranging(*deviations).spread(true), first_order(true, deviations), rtol=1e-6, atol=0)


@SPACES
def test_at_no_distance_it_still_knows_how_sure_it_is(dimension):
    sensor = ranging(*[0.05, 0.02, 0.02][:dimension])
    covariance = sensor.spread(np.zeros((4, dimension)))
    np.testing.assert_array_equal(covariance, covariance.swapaxes(-1, -2))
    assert np.linalg.eigvalsh(covariance).min() > 0
    assert 0.9 * 0.05**2 < np.trace(covariance[0]) < 1.1 * 0.05**2
    assert np.isfinite(sensor.measured(np.zeros(dimension), drawn(np.full(dimension, 0.05), seed=6)[:1000])).all()


@SPACES
def test_measurements_in_any_number_have_the_bits_of_each_alone(dimension):
    rng, sensor = np.random.default_rng(7), ranging(*[0.05, 0.02, 0.03][:dimension])
    true, noise = rng.normal(size=(5, 7, 3, dimension)), 0.05 * rng.normal(size=(5, 7, 3, dimension))
    said, spread = sensor.measured(true, noise), sensor.spread(true)
    assert spread.shape == (5, 7, 3, dimension, dimension)
    for place in np.ndindex(5, 7):
        assert sensor.measured(true[place], noise[place]).tobytes() == said[place].tobytes()
        assert sensor.spread(true[place]).tobytes() == spread[place].tobytes()
        assert sensor.spread(true[*place, 1]).tobytes() == spread[*place, 1].tobytes()


# Coordinates


@SPACES
def test_coordinates_are_read_as_they_are_with_one_covariance(dimension):
    rng = np.random.default_rng(8)
    covariance = np.diag(np.arange(1.0, dimension + 1)) + 0.1
    sensor = Sensor("coordinates", covariance)
    true, noise = rng.normal(size=(2, 4, dimension)), rng.normal(size=(2, 4, dimension))
    np.testing.assert_array_equal(sensor.measured(true, noise), true + noise)
    np.testing.assert_array_equal(sensor.spread(true), np.tile(covariance, (2, 4, 1, 1)))
    np.testing.assert_array_equal(sensor.common, covariance)


def test_ranges_and_bearings_have_no_covariance_in_common():
    with pytest.raises(ValueError, match=r"one covariance for all measurements.*choose another, or a sensor of coord"):
        _ = ranging(0.1, 0.1).common


# In a scenario


SHARP = "sensing={ sigma_range = 0.05, sigma_bearing = 0.02 }"
COARSE = ("time.dt=0.01", "record.enabled=false")
FILTERS = ["none", "mle", "rkf", "imm", "mmse", "edge-kf", "joint-kf", "silent-kf", "crkf"]


@pytest.mark.parametrize(("name", "bearings"), [("rigid", 1), ("ravine", 2)])
@pytest.mark.parametrize("samples", [1, 4])
def test_a_scenario_gives_deviations_of_one_reading_and_their_number(name, bearings, samples):
    over = SHARP.replace("}", f", samples = {samples} }}")
    sensor = plan_of(name, over, 'agents.estimator="rkf"').world.sensor
    assert sensor.reads == "range-bearing"
    np.testing.assert_allclose(sensor.covariance, np.diag([0.05**2] + [0.02**2] * bearings) / samples, rtol=1e-15)


@SPACES
@pytest.mark.parametrize("reads", ["range-bearing", "line-of-sight"])
def test_a_measurement_counts_by_where_it_is_expected_once_that_is_surer(reads, dimension):
    """Before: by where it says to be, so that its weight came from its own noise."""
    sensor = Sensor(reads, np.diag([0.01, 0.04, 0.09][:dimension]))
    measured, expected = np.random.default_rng(3).normal(size=(2, 20, dimension))
    sharp, vague = (size * np.broadcast_to(np.eye(dimension), (20, dimension, dimension)) for size in (1e-9, 1e9))
    for doubt, where in ((sharp, expected), (vague, measured)):
        place, R = sensor.observed(measured, expected, doubt)
        np.testing.assert_array_equal(place, measured)
        np.testing.assert_allclose(R, sensor.spread(where), atol=1e-8)
    mixed = np.where((np.arange(20) % 2 == 0)[:, None, None], sharp, vague)
    _, R = sensor.observed(measured, expected, mixed)
    np.testing.assert_allclose(R[::2], sensor.spread(expected)[::2], atol=1e-8)
    np.testing.assert_array_equal(R[1::2], sensor.spread(measured)[1::2])


def test_what_is_expected_at_hand_is_not_measured_without_error():
    """As wrong as it is far, and it may be as far as the doubt says."""
    sensor = Sensor("line-of-sight", np.diag([0.02, 0.01]))
    _, R = sensor.observed(np.array([20.0, 0.0]), np.zeros(2), np.eye(2))
    np.testing.assert_allclose(R, 0.03 * np.eye(2))


@SPACES
@pytest.mark.parametrize("name", [name for name in FILTERS if name != "crkf"])
def test_estimators_trust_every_measurement_by_its_own_covariance(name, dimension, monkeypatch):
    counted = []

    def weight(sensor, *given, honest=Sensor.weight):
        counted.append(honest(sensor, *given))
        return counted[-1]

    monkeypatch.setattr(Sensor, "weight", weight)
    found = by_affinet("estimators")[name]
    estimator, rng = found.load()(), np.random.default_rng(9)
    sensor = ranging(*[0.1, 0.2, 0.3][:dimension])
    told = replace(brief(np.ones((1, dimension))), sensor=sensor)
    state = other = estimator.init(told, ())
    seen = np.ones(1, dtype=bool)
    for y in rng.normal(size=(5, 1, dimension)):
        counted.clear()
        state, _ = estimator.sense(told, state, y, seen)
        state, estimate = estimator.fuse(told, state, hears(seen, np.zeros((1, dimension))), at_rest(dimension))
        # As if there were a sensor for it alone.
        (R,) = counted or [sensor.spread(y)]
        alone = replace(told, sensor=Sensor("coordinates", R[0]))
        other, _ = estimator.sense(alone, other, y, seen)
        other, expected = estimator.fuse(alone, other, hears(seen, np.zeros((1, dimension))), at_rest(dimension))
        np.testing.assert_array_equal(estimate.relative, expected.relative)
        np.testing.assert_array_equal(estimate.covariance, expected.covariance)


@pytest.mark.parametrize("estimator", ["ral", "conral", "ga-rkf"])
def test_estimators_of_one_covariance_refuse_ranges_and_bearings_in_a_line_that_says_what_would_do(estimator):
    with pytest.raises(ScenarioError) as error:
        plan_of("rigid", *COARSE, SHARP, f'agents.estimator="{estimator}"')
    (line,) = str(error.value).splitlines()
    assert "agents: this estimator takes one covariance for all measurements" in line
    assert "choose another, or a sensor of coordinates" in line


# Nobody is pushed, so that measurements alone make the filters wrong; they begin as good as ignorant.


# What was measured is in the arrays


@pytest.mark.parametrize("given", [SHARP, "sensing={ covariance = [[0.01, 0.003], [0.003, 0.02]], samples = 2 }"])
def test_what_was_measured_is_where_the_neighbour_is_and_the_noise_of_the_sensor(given):
    plan = plan_of("rigid", *COARSE, "time.duration=2", given, 'agents.estimator="none"', "network.availability=0.5")
    arrays, links, sensor = rehearse(plan).arrays, plan.world.links, plan.world.sensor
    measured, position = arrays["measured"], arrays["position"][:-1]
    assert measured.shape == (200, len(links), 2)
    true = position[:, links.dst - 1] - position[:, links.src - 1]
    # Of every link, heard or not; by its own covariance, the noise is as long as a normal draw, in every direction.
    root = np.linalg.cholesky(sensor.spread(true))
    white = np.linalg.solve(root, (measured - true)[..., None])[..., 0].reshape(-1, 2)
    if sensor.reads == "coordinates":
        np.testing.assert_allclose(
            np.cov((measured - true).reshape(-1, 2).T), [[0.005, 0.0015], [0.0015, 0.01]], rtol=0.1
        )
    within_standard_errors(white, np.zeros(2))
    within_standard_errors(white[:, :, None] * white[:, None, :], np.eye(2))
    heard = (arrays["verdicts"][:, 0] == Verdict.DELIVERED)[:, links.slots] & links.present
    assert 0.45 < heard[:, links.present].mean() < 0.55
    np.testing.assert_array_equal(arrays["known"], heard)
    np.testing.assert_array_equal(arrays["estimate"][heard], measured[:, links.slots][heard])
