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
