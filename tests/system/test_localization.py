"""Localization by Jacobi over-relaxation, against least squares written apart, dense eigenvalues, and paper 003."""

from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from briefs import REST, brief, only
from flying import plan_of
from judged import changed, tampered
from scripted import timeline

from affinet.planning.plan import PlanError
from affinet.runtimes.run import rehearse
from affinet.runtimes.side_by_side import side_by_side
from affinet.scenario import loading
from affinet.scenario.sections import ScenarioError
from affinet.studies.batch import fly_all
from affinet.verdicts import checkers, invariants
from affinet.verdicts.checkers import localized, smooth
from agents.estimators import jor
from agents.estimators.jor import JacobiOverRelaxation, Side
from agents.exchange import Heard
from analysis.claims import random_graphs
from analysis.metrics import localization
from analysis.metrics.localization import centred, centroid, optimal, ringing
from analysis.models import jacobi
from analysis.models.jacobi import EdgeInformation, spectrum, system, weights
from analysis.models.sensor import Sensor
from netem.core.channels import PLACE
from netem.core.links import Links
from netem.medium.verdict import Fate
from world.books.localized import FirstMeasurements

SPACES = pytest.mark.parametrize("dimension", [2, 3])
LINE_OF_SIGHT = {D: Sensor("line-of-sight", np.diag([0.15**2] + [0.1**2] * (D - 1))) for D in (2, 3)}


class Measurement(NamedTuple):
    """What agent i, a row, said of x_i - x_j, and how surely."""

    i: int
    j: int
    y: np.ndarray
    covariance: np.ndarray


def iteration(edges, step):
    """M_JOR = I - h D^-1 Upsilon (12), shape (..., N D, N D), with the step h."""
    matrix, _ = system(edges)
    own = weights(edges)
    rows = matrix.reshape(*own.shape[:-2], own.shape[-1], matrix.shape[-1])
    scaled = np.linalg.solve(own, rows).reshape(matrix.shape)
    return np.eye(matrix.shape[-1]) - step * scaled


def positive(size, rng):
    root = rng.normal(size=(size, size))
    return root @ root.T / size + 0.2 * np.eye(size)


def pairs(seed, agents=None):
    """A random connected graph, and where its randomness goes on."""
    rng = np.random.default_rng(seed)
    agents = int(rng.integers(3, 9)) if agents is None else agents
    tree = {(int(rng.integers(i)), i) for i in range(1, agents)}
    more = {(i, j) for i in range(agents) for j in range(i + 1, agents) if rng.random() < 0.3}
    return rng, agents, sorted(tree | more)


def campaign(seed, dimension=2):
    """Measurements on a random connected graph with full covariances; some edges are measured from one end, some from both."""
    rng, agents, joined = pairs(seed)
    made = []
    for i, j in joined:
        ends = [[(i, j)], [(j, i)], [(i, j), (j, i)]][rng.integers(3)]
        made += [Measurement(*end, rng.normal(size=dimension) * 3, positive(dimension, rng)) for end in ends]
    return agents, made, rng


def edges_of(agents, made, dimension=2):
    relative = np.zeros((agents, agents, dimension))
    information = np.zeros((agents, agents, dimension, dimension))
    for one in made:
        relative[one.i, one.j], information[one.i, one.j] = one.y, np.linalg.inv(one.covariance)
    return jacobi.together(relative, information)


def own_weights(agents, made, dimension=2):
    """Upsilon_ii: the information of all that was measured at agent i, or of it."""
    total = np.zeros((agents, dimension, dimension))
    for one in made:
        total[one.i] += np.linalg.inv(one.covariance)
        total[one.j] += np.linalg.inv(one.covariance)
    return total


def middle(place, own):
    """The weighted centroid (7)."""
    return np.linalg.inv(sum(own)) @ sum(w @ x for w, x in zip(own, place, strict=True))


def least_squares(agents, made, anchor, dimension=2):
    """Positions relative to an anchor (3)-(5): whitened measurements, the columns of the anchor left out."""
    rows, right = [], []
    for one in made:
        white = np.linalg.inv(np.linalg.cholesky(one.covariance))
        row = np.zeros((dimension, agents, dimension))
        row[:, one.i], row[:, one.j] = white, -white
        rows.append(np.delete(row, anchor, axis=1).reshape(dimension, -1))
        right.append(white @ one.y)
    found, *_ = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)
    return np.insert(found.reshape(agents - 1, dimension), anchor, 0.0, axis=0)


def dense(edges):
    """D^-1 Upsilon, block by block."""
    agents, dimension = edges.pull.shape[-3], edges.pull.shape[-1]
    matrix = np.zeros((agents, dimension, agents, dimension))
    for i in range(agents):
        own = sum(edges.information[i])
        for j in range(agents):
            matrix[i, :, j] = np.eye(dimension) if i == j else -np.linalg.inv(own) @ edges.information[i, j]
    return matrix.reshape(agents * dimension, -1)


def radius(matrix):
    return np.abs(np.linalg.eigvals(matrix)).max()


def chain(agents=10, spread=None):
    """Agents in a row, each edge measured once, as surely as the others."""
    information, pull = np.zeros((agents, agents, 2, 2)), np.zeros((agents, agents, 2))
    precision = np.linalg.inv(np.eye(2) if spread is None else spread)
    for i in range(agents - 1):
        information[i, i + 1] = information[i + 1, i] = precision
        pull[i, i + 1], pull[i + 1, i] = precision @ [1.0, 0.3], -precision @ [1.0, 0.3]
    return EdgeInformation(information, pull)


def iterates(edges, h, start, number):
    """(12), agent by agent; the start first."""
    own, place = weights(edges), [start]
    shift = h * np.linalg.solve(own, edges.pull.sum(axis=-2)[..., None])[..., 0]
    for _ in range(number):
        place.append((iteration(edges, h) @ place[-1].ravel()).reshape(start.shape) + shift)
    return np.stack(place)


# The iteration


def limit(edges, h, start, doublings):
    """Where 2^doublings iterations (12) lead: an affine map, squared again and again."""
    own, eta = weights(edges), edges.pull.sum(axis=-2)
    M, shift = iteration(edges, h), h * np.linalg.solve(own, eta[..., None]).ravel()
    for _ in range(doublings):
        M, shift = M @ M, M @ shift + shift
    return (M @ start.ravel() + shift).reshape(start.shape)


def test_jor_comes_to_the_optimum_about_the_weighted_centroid_of_where_it_began():
    for seed in range(100):
        agents, made, rng = campaign(seed)
        edges, own = edges_of(agents, made), own_weights(agents, made)
        start, h = 5 * rng.normal(size=(agents, 2)), rng.uniform(0.1, 0.98)
        best = least_squares(agents, made, 0)
        expected = best - middle(best, own) + middle(start, own)  # (20)
        np.testing.assert_allclose(limit(edges, h, start, 16), expected, atol=1e-9)


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


# Rates


def test_rates_are_the_spectral_radii_of_the_iteration():
    for seed in range(20):
        agents, made, _ = campaign(seed)
        edges, own = edges_of(agents, made), own_weights(agents, made)
        for h, anchor in ((0.49, 0), (0.9, agents - 1)):
            M = iteration(edges, h)
            np.testing.assert_allclose(M, np.eye(2 * agents) - h * dense(edges), atol=1e-12)
            ones = np.tile(np.eye(2), (agents, 1))
            M_c = ones @ np.linalg.inv(sum(own)) @ np.concatenate(own, axis=1)
            kept = [row for row in range(2 * agents) if row // 2 != anchor]
            found = jacobi.rates(edges, h, anchor)
            assert found.centroid == pytest.approx(radius(M - M_c), abs=1e-9)
            assert found.anchor == pytest.approx(radius(M[np.ix_(kept, kept)]), abs=1e-9)


def test_an_anchor_never_makes_it_faster():
    centre, anchor = random_graphs.rates(1000, 10, 0.49).T
    assert (centre <= anchor + 1e-12).all()
    assert (centre < anchor - 1e-3).mean() > 0.9
    assert ((centre > 0.0) & (anchor < 1.0)).all()


def test_random_graphs_join_all_agents_and_are_the_same_for_the_same_seed():
    for seed in range(20):
        edges, again = (random_graphs.edges(seed, 10) for _ in range(2))
        assert np.isfinite(optimal(edges)).all()
        np.testing.assert_array_equal(edges.pull, again.pull)
    assert np.abs(random_graphs.edges(1, 10).pull - random_graphs.edges(2, 10).pull).max() > 0.1


@pytest.mark.parametrize("h", [0.1, 0.3, 0.49])
def test_below_one_half_the_eigenvalues_are_positive_and_as_many_as_dimensions_are_one(h):
    for dimension in (2, 3):
        for seed in range(30):
            agents, made, _ = campaign(seed, dimension)
            values = np.linalg.eigvals(iteration(edges_of(agents, made, dimension), h))
            assert np.abs(values.imag).max() < 1e-7
            assert values.real.min() > 0.0
            assert values.real.max() <= 1.0 + 1e-9
            assert (values.real > 1.0 - 1e-7).sum() == dimension


def test_a_chain_with_a_step_near_one_has_negative_eigenvalues():
    values = np.linalg.eigvals(iteration(chain(), 0.99)).real
    assert -1.0 < values.min() < -0.9
    assert np.linalg.eigvals(iteration(chain(), 0.49)).real.min() > 0.0


@SPACES
def test_the_spectrum_is_that_of_the_jacobi_matrix_in_ascending_order(dimension):
    for seed in range(10):
        agents, made, _ = campaign(seed, dimension)
        edges = edges_of(agents, made, dimension)
        found = spectrum(edges)
        np.testing.assert_allclose(found, np.sort(np.linalg.eigvals(dense(edges)).real), atol=1e-9)
        np.testing.assert_allclose(found[:dimension], 0.0, atol=1e-12)
        assert found[dimension] > 1e-4


def test_the_fastest_steps_are_those_of_section_v():
    for seed in range(20):
        edges = random_graphs.edges(seed, 6)
        values = np.sort(np.linalg.eigvals(dense(edges)).real)
        smooth, fast = (jacobi.step(edges, kind) for kind in ("smooth", "fast"))
        assert smooth == pytest.approx(1.0 / values[-1], rel=1e-9)
        assert fast == pytest.approx(2.0 / (values[2] + values[-1]), rel=1e-9)
        assert np.linalg.eigvals(iteration(edges, smooth)).real.min() == pytest.approx(0.0, abs=1e-9)
        best = jacobi.rates(edges, fast, 0).centroid
        assert all(jacobi.rates(edges, fast + off, 0).centroid > best for off in (-0.01, 0.01))


# Ringing


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


# The estimator


@cache
def team(seed, dimension=2, agents=None):
    """A brief for all agents of a random graph, its links, and what each measured of its neighbours."""
    rng, agents, joined = pairs(seed, agents)
    links = Links.both_ways(agents, [(i + 1, j + 1) for i, j in joined])
    place = 3 * rng.normal(size=(agents, dimension))
    relative = np.where(links.present[..., None], place[:, None] - place[links.neighbours], 0.0)
    sensor = LINE_OF_SIGHT[dimension]
    measured = relative + 0.2 * rng.normal(size=relative.shape) * links.present[..., None]
    return replace(brief(relative), back=links.back, sensor=sensor, present=links.present), links, measured


def one_tick(estimator, agents, links, state, measured, seen, fresh=None):
    """All agents, who hear at once what all say."""
    state, said = estimator.sense(agents, state, np.where(seen[..., None], measured, 0.0), seen)
    fields = {name: field[links.neighbours] for name, field in said[PLACE].items()}
    heard = {PLACE: Heard(fields, links.present if fresh is None else fresh)}
    return estimator.fuse(agents, state, heard, REST)


def known_from(links, measured, seen, sensor):
    """The edges of measurements in slots (N, n, D)."""
    made = []
    for i, slot in np.argwhere(seen & links.present).tolist():
        y = measured[i, slot]
        made.append(Measurement(i, int(links.neighbours[i, slot]), y, sensor.spread(y)))
    return edges_of(links.agents, made, measured.shape[-1])


@SPACES
@pytest.mark.parametrize("h", [0.3, 0.9])
def test_agents_who_hear_each_other_make_exactly_these_iterates(dimension, h):
    for seed in range(5):
        agents, links, measured = team(seed, dimension)
        estimator, rng = JacobiOverRelaxation(h), np.random.default_rng(seed)
        start = rng.normal(size=(links.agents, dimension))
        state = estimator.init(agents, (links.agents,))._replace(place=start)
        edges = known_from(links, measured, links.present, agents.sensor)
        for expected in iterates(edges, h, start, 30)[1:]:
            state, estimate = one_tick(estimator, agents, links, state, measured, links.present)
            np.testing.assert_allclose(estimate.reports["place"], expected, atol=1e-12)
            np.testing.assert_array_equal(state.place, estimate.reports["place"])


def test_it_begins_at_the_origin_and_stays_there_while_nobody_is_heard():
    agents, links, measured = team(1)
    estimator = JacobiOverRelaxation()
    state = estimator.init(agents, (links.agents,))
    nobody = np.zeros_like(links.present)
    for fresh in (nobody, nobody):
        state, estimate = one_tick(estimator, agents, links, state, measured, links.present, fresh)
        np.testing.assert_array_equal(estimate.reports["place"], np.zeros((links.agents, 2)))
        assert not estimate.known.any()
        assert np.isfinite(estimate.covariance).all()


def test_only_the_first_measurement_of_an_edge_counts():
    agents, links, measured = team(2)
    estimator = JacobiOverRelaxation(0.4)
    states = [estimator.init(agents, (links.agents,))] * 2
    rng = np.random.default_rng(1)
    for tick in range(10):
        later = measured + rng.normal(size=measured.shape) * (tick > 0)
        (states[0], once), (states[1], often) = (
            one_tick(estimator, agents, links, state, y, links.present)
            for state, y in zip(states, (measured, later), strict=True)
        )
        np.testing.assert_array_equal(once.reports["place"], often.reports["place"])


def test_a_message_that_is_lost_leaves_what_was_heard_before():
    agents, links, measured = team(4)
    h, rng = 0.4, np.random.default_rng(0)
    estimator, edges = JacobiOverRelaxation(h), known_from(links, measured, links.present, agents.sensor)
    state = estimator.init(agents, (links.agents,))
    state, _ = one_tick(estimator, agents, links, state, measured, links.present)
    remembered, own, pull = state.theirs.copy(), weights(edges), edges.pull.sum(axis=1)
    for _ in range(20):
        fresh, before = links.present & (rng.random(links.present.shape) < 0.5), state.place
        remembered = np.where(fresh[..., None], before[links.neighbours], remembered)
        state, _ = one_tick(estimator, agents, links, state, measured, links.present, fresh)
        for i in range(links.agents):
            drawn = pull[i] + sum(
                edges.information[i, j] @ remembered[i, slot]
                for slot, j in enumerate(links.neighbours[i].tolist())
                if links.present[i, slot]
            )
            expected = (1 - h) * before[i] + h * np.linalg.solve(own[i], drawn)
            np.testing.assert_allclose(state.place[i], expected, atol=1e-12)


def seen_from_the_lower_end(links):
    """Of every edge, only the agent with the lower number measures."""
    return links.present & (links.neighbours > np.arange(links.agents)[:, None])


def test_what_a_neighbour_measured_of_an_edge_counts_as_much_as_ones_own():
    agents, links, measured = team(6, agents=6)
    estimator, one_way = JacobiOverRelaxation(0.45), seen_from_the_lower_end(links)
    found = {}
    for name, seen in (("one", one_way), ("both", links.present)):
        state = estimator.init(agents, (links.agents,))
        for _ in range(600):
            state, _ = one_tick(estimator, agents, links, state, measured, seen)
        edges = known_from(links, measured, seen, agents.sensor)
        assert localization.distance(state.place, edges) < 1e-9
        # Both ends count the edge alike, with all that was measured of it.
        known, _ = jor._edges(agents, state.own, state.other)
        for i, slot in np.argwhere(links.present).tolist():
            j = links.neighbours[i, slot]
            np.testing.assert_allclose(known[i, slot], edges.information[i, j], rtol=1e-12)
            np.testing.assert_allclose(known[i, slot], known[j, links.back[i, slot]], rtol=1e-12)
        found[name] = known[links.present][0], centred(state.place, weights(edges))
    # Two measurements are surer than one, and move the answer.
    assert np.linalg.eigvalsh(found["both"][0] - found["one"][0]).min() > 0.0
    assert np.abs(found["one"][1] - found["both"][1]).max() > 0.01


def test_where_agents_are_is_all_that_is_told_and_no_edge_counts_as_estimated():
    agents, links, measured = team(7)
    estimator = JacobiOverRelaxation()
    state = estimator.init(agents, (links.agents,))
    for _ in range(3):
        state, estimate = one_tick(estimator, agents, links, state, measured, links.present)
        assert set(estimate.reports) == {"place"}
        assert np.abs(estimate.reports["place"]).max() > 0.1
        assert (estimate.known.shape, estimate.known.any()) == (links.present.shape, np.False_)
        np.testing.assert_array_equal(estimate.relative, np.zeros((*links.present.shape, 2)))
        np.testing.assert_array_equal(estimate.covariance, np.zeros((*links.present.shape, 2, 2)))
        assert np.isnan(estimate.psi).all()


@pytest.mark.parametrize("anchor", [False, True])
def test_only_an_anchor_stays_where_it_began(anchor):
    agents, links, measured = team(8, agents=5)
    agents = replace(agents, leader=only(5, 2))
    estimator = JacobiOverRelaxation(0.49, anchor)
    state = estimator.init(agents, (5,))
    for _ in range(900):
        state, _ = one_tick(estimator, agents, links, state, measured, links.present)
    best = optimal(known_from(links, measured, links.present, agents.sensor))
    if anchor:
        np.testing.assert_array_equal(state.place[2], np.zeros(2))
        np.testing.assert_allclose(state.place, best - best[2], atol=1e-8)
    else:
        np.testing.assert_allclose(state.place, best, atol=1e-8)


@pytest.mark.parametrize("heard", [True, False], ids=["heard", "lost"])
def test_a_measurement_that_its_agent_no_longer_has_is_forgotten_at_the_other_end_once_that_is_heard(heard):
    agents, links, measured = team(6, agents=6)
    estimator, restarted = JacobiOverRelaxation(), 2
    state, _ = one_tick(estimator, agents, links, estimator.init(agents, (6,)), measured, links.present)
    others = (np.arange(6) != restarted)[:, None]
    # It knows nothing any more, and measures nothing any more.
    own = Side(np.where(others[..., None], state.own.measured, 0.0), state.own.seen & others)
    state = state._replace(own=own, other=Side(np.where(others[..., None], state.other.measured, 0.0), own.seen))
    fresh = links.present if heard else links.present & (links.neighbours != restarted)
    state, _ = one_tick(estimator, agents, links, state, measured, links.present & others, fresh)
    information, _ = jor._edges(agents, state.own, state.other)
    edges = known_from(links, measured, links.present & (others if heard else True), agents.sensor)
    for i, slot in np.argwhere(links.present & others).tolist():
        np.testing.assert_allclose(information[i, slot], edges.information[i, links.neighbours[i, slot]], rtol=1e-12)
    told_of = state.other.seen & links.present & (links.neighbours == restarted)
    np.testing.assert_array_equal(told_of, links.present & (links.neighbours == restarted) & (not heard))


@pytest.mark.parametrize("h", [0.0, 1.0, -0.3])
def test_a_step_that_is_no_share_is_refused(h):
    with pytest.raises(ValueError, match="h is a step between 0 and 1"):
        JacobiOverRelaxation(h)


# In flight

NAME = "localization"
FOUR = (
    "formation.nodes=[[0,0],[3,1],[1,4],[4,5]]",
    'formation.edges=["1-2","1-3","2-3","2-4","3-4"]',
    "formation.leaders=[3]",
)


@cache
def flown(*overrides):
    return rehearse(plan_of(NAME, *overrides))


def known(run):
    world, arrays = run.plan.world, run.arrays
    return FirstMeasurements.of(world, run.timeline, arrays["measured"], arrays["fates"][:, 0]).edges()


def by_hand(run):
    """The edges of what was measured first, searched for tick by tick and link by link."""
    links, sensor, made = run.plan.world.links, run.plan.world.sensor, []
    for row, (src, dst) in enumerate(zip(links.src.tolist(), links.dst.tolist(), strict=True)):
        arrived = np.flatnonzero(run.arrays["fates"][:, 0, row] == Fate.DELIVERED)
        if len(arrived):
            y = run.arrays["measured"][arrived[0], row]
            made.append(Measurement(dst - 1, src - 1, y, sensor.spread(y)))
    return links.agents, made


def centre_of(run):
    return centroid(run.arrays["place"], weights(known(run)))


def test_without_losses_agents_come_to_the_optimum_and_their_centroid_stays():
    run = flown("time.duration=2")
    agents, made = by_hand(run)
    best = least_squares(agents, made, 4)
    own = own_weights(agents, made)
    np.testing.assert_allclose(run.arrays["place"][-1], best - middle(best, own), atol=1e-9)
    np.testing.assert_allclose(run.arrays["place"][-1], optimal(known(run)), atol=1e-9)
    assert np.abs(centre_of(run)).max() < 1e-12
    # That is not where they are: measurements are noisy.
    true = run.position[-1] - middle(run.position[-1], own)
    assert 0.05 < np.abs(best - middle(best, own) - true).max() < 3.0


def test_the_rate_is_the_one_that_is_told_before_the_flight():
    run = flown("time.duration=2")
    (told,) = (finding.says for finding in run.plan.findings if finding.check == "localization")
    off = localization.distance(run.arrays["place"], known(run))
    rate = jacobi.rates(known(run), 0.49, 0).centroid
    assert off[90] / off[60] == pytest.approx(rate**30, rel=0.05)
    # It is told from measurements without noise.
    assert float(told.split()[1]) == pytest.approx(rate, abs=0.03)


def test_the_check_tells_rates_and_the_fastest_steps_of_measurements_without_noise():
    nodes = np.array([[0, 0], [3, 1], [1, 4], [4, 5]], dtype=float)
    made = []
    for i, j in ((0, 1), (0, 2), (1, 2), (1, 3), (2, 3)):
        for one, other in ((i, j), (j, i)):
            y = nodes[one] - nodes[other]
            made.append(Measurement(one, other, y, LINE_OF_SIGHT[2].spread(y)))
    edges = edges_of(4, made)
    for anchor in ("false", "true"):
        plan = plan_of(NAME, *FOUR, f"agents.parameters.jor={{h=0.3,anchor={anchor}}}")
        (told,) = (finding for finding in plan.findings if finding.check == "localization")
        rates = jacobi.rates(edges, 0.3, 2)  # agent 3 leads
        chosen = rates.anchor if anchor == "true" else rates.centroid
        assert abs(rates.anchor - jacobi.rates(edges, 0.3, 0).anchor) > 1e-3
        assert told.level == "ok"
        assert told.says == (
            f"rate {chosen:.4f} a tick with h 0.3 (weighted centroid {rates.centroid:.4f}, agent 3 as the anchor "
            f"{rates.anchor:.4f}); h {jacobi.step(edges, 'smooth'):.3f} is the fastest without ringing, "
            f"{jacobi.step(edges, 'fast'):.3f} of all"
        )


@pytest.mark.parametrize("leaders", [[], [1, 2]], ids=str)
def test_an_anchor_is_exactly_one_agent_that_leads(leaders):
    chosen = f"formation.leaders={leaders}"
    with pytest.raises(PlanError) as told:
        plan_of(NAME, chosen, "agents.parameters.jor={anchor=true}")
    said = f"with an anchor exactly one agent leads: formation.leaders has {len(leaders)}"
    assert said in str(told.value)
    assert "\n" not in str(told.value)
    # Without an anchor any number may lead, and the rate is that with the first agent as the anchor.
    (told,) = (found for found in plan_of(NAME, chosen).findings if found.check == "localization")
    assert (told.level, "agent 1 as the anchor" in told.says) == ("ok", True)


def off_at_the_end(run):
    return float(localization.distance(run.arrays["place"][-1], known(run)))


def test_half_of_the_messages_are_lost_and_the_answer_is_the_same_about_a_centroid_that_drifts():
    run = flown("network.availability=0.5", "time.duration=4")
    assert off_at_the_end(run) < 1e-6
    assert np.linalg.norm(centre_of(run)[-1]) > 0.01
    # Once all is settled, it does not move any more.
    assert np.abs(centre_of(run)[-1] - centre_of(run)[-20]).max() < 1e-6


def test_messages_that_are_five_ticks_late_lead_to_the_same_answer():
    late, now = flown(*FOUR, "network.delay_ticks=5"), flown(*FOUR)
    assert off_at_the_end(late) < 1e-6
    assert off_at_the_end(now) < 1e-9
    reached = [np.argmax(localization.distance(run.arrays["place"], known(run)) < 1e-3) for run in (late, now)]
    assert reached[0] > reached[1] + 5


def test_after_a_partition_is_healed_all_come_to_the_same_answer():
    split = timeline({"verb": "partition", "at": 0, "until": 1.0, "groups": [[1, 2, 3, 4, 5], [6, 7, 8, 9, 10]]})
    run = flown(split, "time.duration=4")
    off = localization.distance(run.arrays["place"], known(run))
    assert off[99] > 0.5
    assert off[-1] < 1e-9
    # Under the partition each half comes to its own answer.
    assert np.abs(np.diff(run.arrays["place"][60:99, :5], axis=0)).max() < 1e-2


def test_who_joins_late_and_the_others_come_to_the_same_answer():
    late = timeline({"verb": "kill", "at": 0, "agents": [4]}, {"verb": "restart", "at": 1.0, "agents": [4]})
    run = flown(*FOUR, late, "time.duration=4")
    assert np.isnan(run.arrays["place"][:100, 3]).all()
    assert np.isfinite(run.arrays["place"][100:]).all()
    assert np.isfinite(run.arrays["place"][:, :3]).all()
    assert off_at_the_end(run) < 1e-9


@pytest.mark.parametrize("state", ["warm", "cold"])
def test_who_is_restarted_and_the_others_come_to_the_same_answer(state):
    again = timeline(
        {"verb": "kill", "at": 0.5, "agents": [4]}, {"verb": "restart", "at": 1.0, "agents": [4], "state": state}
    )
    run = flown(*FOUR, again, "time.duration=4")
    assert off_at_the_end(run) < 1e-9


def test_who_is_restarted_and_measures_nothing_any_more_and_the_others_come_to_the_same_answer():
    blind = timeline(
        {"verb": "kill", "at": 0.5, "agents": [4]},
        {"verb": "restart", "at": 1.0, "agents": [4], "state": "cold"},
        {"verb": "dropout", "at": 1.0, "links": ["2->4", "3->4"]},
    )
    run = flown(*FOUR, blind, "time.duration=4")
    with_its_own = flown(*FOUR, "time.duration=4")
    assert np.abs(known(run).information - known(with_its_own).information).max() > 0.1
    assert off_at_the_end(run) < 1e-9


def test_who_is_paused_at_first_and_the_others_come_to_the_same_answer():
    asleep = timeline({"verb": "pause", "at": 0, "until": 1.0, "agents": [4]})
    assert off_at_the_end(flown(*FOUR, asleep, "time.duration=4")) < 1e-9


def test_three_dimensions_lead_to_the_optimum_too():
    solid = (
        "formation.nodes=[[0,0,0],[3,1,1],[1,4,-2],[4,5,2],[2,2,5]]",
        'formation.edges=["1-2","1-3","2-3","2-4","3-4","4-5","1-5"]',
    )
    run = flown(*solid, "time.duration=4")
    agents, made = by_hand(run)
    best, own = least_squares(agents, made, 0, 3), own_weights(agents, made, 3)
    assert run.arrays["place"].shape[-1] == 3
    np.testing.assert_allclose(run.arrays["place"][-1], best - middle(best, own), atol=1e-9)


def test_an_anchor_stays_at_the_origin_and_all_come_to_the_optimum_relative_to_it():
    run = flown(*FOUR, "agents.parameters.jor={h=0.49,anchor=true}")
    place = run.arrays["place"]
    agents, made = by_hand(run)
    np.testing.assert_array_equal(place[:, 2], np.zeros((400, 2)))
    np.testing.assert_allclose(place[-1], least_squares(agents, made, 2), atol=1e-9)
    assert np.abs(place[-1]).max() > 1.0


def test_many_runs_are_looked_at_as_each_alone():
    overrides = (*FOUR, "time.duration=0.5", "network.availability=0.5", "agents.parameters.jor={h=0.9}")
    runs = fly_all(plan_of(NAME, *overrides), [5, 6, 7], every=1)
    for row, seed in enumerate((5, 6, 7)):
        alone = flown(*overrides, f"seed={seed}")
        edges, place = known(alone), alone.arrays["place"]
        centre = centroid(place, weights(edges))
        np.testing.assert_allclose(
            runs.quantities["localization"][row], localization.distance(place, edges), atol=1e-12
        )
        np.testing.assert_allclose(
            runs.quantities["drift"][row], np.linalg.norm(centre - centre[0], axis=-1), atol=1e-12
        )
        np.testing.assert_array_equal(runs.quantities["ringing"][row], ringing(place))
    np.testing.assert_array_equal(runs.first["place"], flown(*overrides, "seed=5").arrays["place"])
    assert runs.quantities["ringing"].max() > 0.0
    assert np.isnan(runs.quantities["found"]).all()
    # Nothing is said of neighbours that could be as wrong as it says.
    assert np.isnan(runs.quantities["nees"]).all()


ROW = (
    "formation.nodes=[[0,0],[1,0],[2,0],[3,0],[4,0],[5,0]]",
    'formation.edges=["1-2","2-3","3-4","4-5","5-6"]',
)


@pytest.mark.parametrize("every", [2, 3, 7])
def test_ringing_is_that_of_all_ticks_since_the_moment_before(every):
    plan = plan_of(NAME, *ROW, "time.duration=0.64", "agents.parameters.jor={h=0.99}")
    each, some = (fly_all(plan, [1, 2], every=ticks).quantities["ringing"] for ticks in (1, every))
    assert each.mean() > 0.5
    ticks = np.arange(0, 64, every)
    for row in range(2):
        expected = [each[row, max(tick - every + 1, 0) : tick + 1].mean() for tick in ticks]
        np.testing.assert_allclose(some[row], expected, atol=1e-12)
    counted = np.minimum(every, ticks + 1)
    np.testing.assert_allclose(some @ counted / counted.sum(), each[:, : ticks[-1] + 1].mean(axis=1), atol=1e-12)


# The sensor


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


# Links


def test_each_neighbour_has_the_agent_in_the_slot_that_is_told():
    for seed in range(20):
        _, agents, joined = pairs(seed)
        links = Links.both_ways(agents, [(i + 1, j + 1) for i, j in joined])
        for each in (links, links.side_by_side(3)):
            for i, slot in np.argwhere(each.present).tolist():
                neighbour = each.neighbours[i, slot]
                assert each.neighbours[neighbour, each.back[i, slot]] == i
                assert each.present[neighbour, each.back[i, slot]]
            assert (each.back[~each.present] == 0).all()


def test_briefs_of_swarms_side_by_side_tell_the_slots_of_each():
    plan = plan_of(NAME)
    together = side_by_side(plan, [1, 2, 3])
    np.testing.assert_array_equal(together.brief.back, together.world.links.back)
    np.testing.assert_array_equal(together.brief.back, np.tile(plan.brief.back, (3, 1)))
    assert (plan.brief.of(6).back == plan.brief.back[6]).all()


# Checkers


def elsewhere():
    """A run in which nobody localizes."""
    return flown(*FOUR, 'agents.estimator="none"', "time.duration=0.2")


def test_agents_that_came_to_the_optimum_are_localized():
    run = flown("time.duration=2")
    found = localized(1e-6, by=1.5)(run)
    assert (found.verdict, found.tick) == ("pass", None)
    assert found.checker == "localized(1e-06, by=1.5)"


def test_localized_fails_at_the_first_tick_in_which_they_are_too_far_off():
    run = flown("time.duration=2")
    found = localized(1e-6)(run)
    assert (found.verdict, found.tick) == ("fail", 0)
    place = changed(run.arrays["place"], (180, 2), run.arrays["place"][180, 2] + 1.0)
    found = localized(1e-3, by=1.5)(tampered(run, place=place))
    assert (found.verdict, found.tick) == ("fail", 180)
    assert "m off" in found.says
    assert localized(1e-3, by=1.81)(tampered(run, place=place)).verdict == "pass"


def test_those_left_are_localized_when_one_dies_and_stays_dead():
    dead = timeline({"verb": "kill", "at": 1.7, "agents": [4]})
    run = flown(dead, "network.availability=0.8", "time.duration=2")
    assert np.isnan(run.arrays["place"][-1, 3]).all()
    # What was lost has their centroid drift.
    assert np.linalg.norm(centroid(run.arrays["place"][169], weights(known(run)))) > 0.01
    found = localized(1e-3, by=1.5)(run)
    assert (found.verdict, found.tick) == ("pass", None)
    # One of those left is off.
    place = changed(run.arrays["place"], (180, 2), run.arrays["place"][180, 2] + 1.0)
    found = localized(1e-3, by=1.5)(tampered(run, place=place))
    assert (found.verdict, found.tick) == ("fail", 180)


def test_where_nobody_localizes_or_the_run_is_over_localized_is_vacuous():
    assert localized(1.0)(elsewhere()).verdict == "vacuous"
    assert localized(1.0, by=99.0)(flown("time.duration=2")).verdict == "vacuous"


def test_localized_is_vacuous_when_measurements_do_not_join_all_agents():
    alone = timeline({"verb": "partition", "at": 0, "groups": [[1, 2], [3, 4]]})
    found = localized(1.0)(flown(*FOUR, alone, "time.duration=0.2"))
    assert found.verdict == "vacuous"
    assert "join" in found.says


def test_localized_is_vacuous_when_nothing_was_measured():
    blind = timeline({"verb": "cut", "at": 0, "links": ["all"]})
    run = flown(*FOUR, blind, "time.duration=0.2")
    np.testing.assert_array_equal(run.arrays["place"], np.zeros((20, 4, 2)))
    assert localized(1.0)(run).verdict == "vacuous"


def test_estimates_that_ring_are_not_smooth():
    calm, rough = (flown(*ROW, "time.duration=0.6", f"agents.parameters.jor={{h={h}}}") for h in (0.49, 0.99))
    assert smooth(0.05)(calm).verdict == "pass"
    found = smooth(0.05)(rough)
    assert found.verdict == "fail"
    share = ringing(rough.arrays["place"]).mean()
    assert f"{share:.2%}" in found.says
    assert smooth(share + 1e-9)(rough).verdict == "pass"
    assert smooth(share - 1e-9)(rough).verdict == "fail"
    assert smooth(0.05)(elsewhere()).verdict == "vacuous"


@pytest.mark.parametrize(("text", "name"), [("localized(0.5, by=2)", "localized(0.5, by=2)"), ("smooth(0.1)",) * 2])
def test_words_name_these_checkers(text, name):
    assert invariants.parse(text).name == name
    assert {checkers.localized, checkers.smooth} <= set(invariants.NAMED.values())


def test_a_system_is_symmetric_and_blind_to_the_common_frame():
    agents, made, _ = campaign(11)
    matrix, eta = system(edges_of(agents, made))
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    np.testing.assert_allclose(matrix @ np.tile(np.eye(2), (agents, 1)), 0.0, atol=1e-12)
    np.testing.assert_allclose(eta.reshape(agents, 2).sum(axis=0), 0.0, atol=1e-12)
