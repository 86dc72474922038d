"""The optimum of localization and how far agents are from it, against least squares written apart; ringing."""

import numpy as np
import pytest
from measured_graphs import (
    SPACES,
    Measurement,
    campaign,
    chain,
    edges_of,
    iterates,
    least_squares,
    middle,
    own_weights,
    positive,
)

from analysis.metrics import localization
from analysis.metrics.localization import centred, centroid, optimal, ringing
from analysis.models.jacobi import EdgeInformation, weights


@SPACES
def test_the_optimum_is_that_of_least_squares_with_any_agent_as_the_anchor(dimension):
    for seed in range(20):
        agents, made, _ = campaign(seed, dimension)
        own, found = own_weights(agents, made, dimension), optimal(edges_of(agents, made, dimension))
        for anchor in range(agents):
            best = least_squares(agents, made, anchor, dimension)
            np.testing.assert_allclose(found, best - middle(best, own), atol=1e-9)


def test_weights_and_centroid_are_those_of_definition_3_1():
    agents, made, rng = campaign(3)
    edges, own, place = edges_of(agents, made), own_weights(agents, made), rng.normal(size=(4, agents, 2))
    np.testing.assert_allclose(weights(edges), own, rtol=1e-12)
    np.testing.assert_allclose(centroid(place, own), [middle(one, own) for one in place], atol=1e-12)
    np.testing.assert_allclose(centroid(centred(place, own), own), np.zeros((4, 2)), atol=1e-12)
    # Not the plain mean.
    assert np.abs(centroid(place, own) - place.mean(axis=1)).max() > 0.01


def test_the_optimum_of_many_is_that_of_each_and_no_number_where_edges_do_not_join_all():
    rng = np.random.default_rng(0)
    covariance = positive(2, rng)
    joined = [Measurement(i, i + 1, rng.normal(size=2), covariance) for i in range(4)]
    all_of_them, split = edges_of(5, joined), edges_of(5, [joined[0], *joined[2:]])
    alone = optimal(all_of_them)
    both = optimal(EdgeInformation(*(np.stack(each) for each in zip(all_of_them, split, strict=True))))
    assert np.isfinite(alone).all()
    np.testing.assert_allclose(both[0], alone, atol=1e-12)
    assert np.isnan(both[1]).all()
    assert np.isnan(optimal(split)).all()


def test_how_far_agents_are_from_the_optimum_does_not_depend_on_the_common_frame():
    agents, made, rng = campaign(5)
    edges, own = edges_of(agents, made), own_weights(agents, made)
    off = rng.normal(size=(agents, 2))
    place = optimal(edges) + off
    expected = np.sqrt(((off - middle(off, own)) ** 2).sum(axis=-1).mean())
    assert localization.distance(place + np.array([7.0, -3.0]), edges) == pytest.approx(expected, rel=1e-9)
    assert localization.distance(optimal(edges) + 4.0, edges) == pytest.approx(0.0, abs=1e-12)


def test_agents_that_say_nothing_count_for_nothing_in_how_far_they_are_off():
    for seed in range(10):
        agents, made, rng = campaign(seed)
        edges, own = edges_of(agents, made), own_weights(agents, made)
        place = 5.0 + rng.normal(size=(4, agents, 2))
        off, best = place - optimal(edges), optimal(edges)
        whole = np.sqrt(((centred(place, own) - best) ** 2).sum(axis=-1).mean(axis=-1))
        np.testing.assert_allclose(localization.distance(place, edges), whole, rtol=1e-9)
        moved = centred(place, own)
        np.testing.assert_allclose(localization.beside(place, edges), moved, atol=1e-9)
        # One is silent in the second moment, another and it in the third, all in the fourth.
        gone = np.zeros((4, agents), dtype=bool)
        gone[1:, 1] = gone[2:, 0] = gone[3] = True
        partly = np.where(gone[..., None], np.nan, place)
        found, beside = localization.distance(partly, edges), localization.beside(partly, edges)
        for moment in range(3):
            told = ~gone[moment]
            left = off[moment, told] - middle(off[moment, told], own[told])
            assert found[moment] == pytest.approx(np.sqrt((left**2).sum(axis=-1).mean()), rel=1e-9)
            np.testing.assert_allclose(beside[moment, told], best[told] + left, atol=1e-9)
            assert np.isnan(beside[moment, gone[moment]]).all()
        assert np.isnan(found[3])
        assert np.isnan(beside[3]).all()


def test_where_edges_do_not_join_all_places_stay_where_they_are_and_nothing_is_said_of_how_far_off():
    rng = np.random.default_rng(0)
    apart = edges_of(4, [Measurement(i, i + 1, rng.normal(size=2), np.eye(2)) for i in (0, 2)])
    place = rng.normal(size=(3, 4, 2))
    np.testing.assert_array_equal(localization.beside(place, apart), place)
    assert np.isnan(localization.distance(place, apart)).all()


def test_ringing_by_hand():
    # Two agents on two axes: of four steps in the third moment, one goes back; in the fourth, three do.
    moved = np.array([[1, 1, 1, 1], [1, -2, 1, 1], [-1, 1, -1, 1], [0, 1, -1, -1]], dtype=float)
    place = np.concatenate([np.zeros((1, 4)), moved.cumsum(axis=0)]).reshape(5, 2, 2)
    np.testing.assert_allclose(ringing(place), [0.0, 0.0, 0.25, 0.75, 0.25])
    np.testing.assert_allclose(ringing(np.stack([place, np.zeros_like(place)])), [ringing(place), np.zeros(5)])


def test_a_chain_rings_with_a_step_near_one_and_not_below_one_half():
    rough, calm = (ringing(iterates(chain(), h, np.zeros((10, 2)), 100)) for h in (0.99, 0.49))
    assert rough.mean() > 0.8
    # The first to move are the ends, and it takes ticks for the middle to move at all.
    assert (rough[20:] > 0.9).all()
    np.testing.assert_array_equal(calm, np.zeros(101))


def truthful(seed, dimension, runs=400):
    """A random graph whose edges are measured as surely as they say: true places, and the edges of many campaigns."""
    agents, made, rng = campaign(seed, dimension)
    true = 3.0 * rng.normal(size=(agents, dimension))

    def measured():
        return [
            one._replace(y=true[one.i] - true[one.j] + np.linalg.cholesky(one.covariance) @ rng.normal(size=dimension))
            for one in made
        ]

    edges = [edges_of(agents, measured(), dimension) for _ in range(runs)]
    return true, EdgeInformation(*(np.stack(each) for each in zip(*edges, strict=True)))


@SPACES
def test_covariances_are_those_of_many_campaigns_with_an_anchor_and_about_the_centroid(dimension):
    true, edges = truthful(4, dimension, runs=4000)
    agents = len(true)
    place, covariance = localization.anchored(edges, 1)
    assert not place[:, 1].any()
    off = (place - (true - true[1])).reshape(len(place), -1)
    scale = np.abs(covariance[0]).max()
    np.testing.assert_allclose(off.T @ off / len(off) / scale, covariance[0] / scale, atol=0.1)
    about = (optimal(edges) - centred(true, weights(edges))).reshape(len(place), -1)
    spread = localization.spread(edges)
    np.testing.assert_allclose(about.T @ about / len(off) / scale, spread[0] / scale, atol=0.1)
    assert spread.shape == (4000, agents * dimension, agents * dimension)


def test_the_covariance_about_the_centroid_does_not_depend_on_the_anchor():
    agents, made, _ = campaign(7)
    edges = edges_of(agents, made)
    own = weights(edges)
    total = own.sum(axis=0)
    seen = np.eye(2 * agents) - np.tile(np.linalg.solve(total, np.hstack(own)), (agents, 1))
    for anchor in range(agents):
        _, covariance = localization.anchored(edges, anchor)
        np.testing.assert_allclose(seen @ covariance @ seen.T, localization.spread(edges), atol=1e-9)


@SPACES
def test_nees_of_places_is_the_dimension_wherever_the_origin_lies(dimension):
    true, edges = truthful(5, dimension)
    nees = localization.place_nees(optimal(edges) + 7.0, true, edges)
    agents = len(true)
    expected = np.sqrt(2.0 * dimension / (agents - 1) / len(nees))
    assert nees.mean() == pytest.approx(dimension, abs=4.5 * expected)
    # Half the covariance is twice the error.
    overconfident = EdgeInformation(2.0 * edges.information, 2.0 * edges.pull)
    np.testing.assert_allclose(localization.place_nees(optimal(edges), true, overconfident), 2.0 * nees)


def test_the_error_of_places_is_about_their_plain_centroid():
    rng = np.random.default_rng(1)
    true, off = rng.normal(size=(6, 2)), rng.normal(size=(6, 2))
    apart = off - off.mean(axis=0)
    expected = np.sqrt((apart**2).sum(axis=1).mean())
    assert localization.place_error(true + off + [5.0, -1.0], true) == pytest.approx(expected)
    assert localization.place_error(true + 4.0, true) == pytest.approx(0.0, abs=1e-12)
