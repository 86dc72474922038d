"""The estimator of places: its iterates, and what counts when messages are lost or agents forget."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from briefs import REST, brief, only
from measured_graphs import (
    LINE_OF_SIGHT,
    SPACES,
    edges_of,
    iterates,
    pairs,
    weighed,
)

from agents.estimators.jor import JacobiOverRelaxation, Side
from agents.exchange import Heard
from analysis.metrics import localization
from analysis.metrics.localization import centred, optimal
from analysis.models.jacobi import weights
from netem.core.channels import PLACE
from netem.core.links import Links

ESTIMATOR = JacobiOverRelaxation()


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
    return edges_of(links.agents, made_of(links, measured, seen, sensor), measured.shape[-1])


def made_of(links, measured, seen, sensor):
    slots = np.argwhere(seen & links.present).tolist()
    return weighed([(i, int(links.neighbours[i, slot]), measured[i, slot]) for i, slot in slots], sensor)


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


def test_agents_begin_where_they_are_told_each_by_its_number():
    agents, links, measured = team(1)
    start = np.random.default_rng(0).normal(size=(links.agents, 2))
    estimator = JacobiOverRelaxation(0.3, start=start.tolist())
    np.testing.assert_array_equal(estimator.init(agents, (links.agents,)).place, start)
    for row in range(links.agents):
        np.testing.assert_array_equal(estimator.init(agents.of(row), ()).place, start[row])
    # Theorem 4.1: they come to the optimum about the weighted centroid of where they began (20).
    state = estimator.init(agents, (links.agents,))
    for _ in range(3000):
        state, _ = one_tick(estimator, agents, links, state, measured, links.present)
    edges = known_from(links, measured, links.present, agents.sensor)
    began = localization.centroid(start, weights(edges))
    assert np.abs(began).max() > 0.01
    np.testing.assert_allclose(state.place, optimal(edges) + began, atol=1e-9)


def test_diagonals_dismiss_what_axes_have_to_do_with_each_other():
    agents, links, measured = team(3)
    estimator = JacobiOverRelaxation(0.4, covariance="diagonal")
    state = estimator.init(agents, (links.agents,))
    for _ in range(2000):
        state, _ = one_tick(estimator, agents, links, state, measured, links.present)
    made = made_of(links, measured, links.present, agents.sensor)
    diagonal = [one._replace(covariance=np.diag(np.diag(one.covariance))) for one in made]
    assert localization.distance(state.place, edges_of(links.agents, diagonal)) < 1e-9
    full = known_from(links, measured, links.present, agents.sensor)
    assert localization.distance(state.place, full) > 1e-3


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
        known, _ = ESTIMATOR._edges(agents, state.own, state.other)
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
    information, _ = ESTIMATOR._edges(agents, state.own, state.other)
    edges = known_from(links, measured, links.present & (others if heard else True), agents.sensor)
    for i, slot in np.argwhere(links.present & others).tolist():
        np.testing.assert_allclose(information[i, slot], edges.information[i, links.neighbours[i, slot]], rtol=1e-12)
    told_of = state.other.seen & links.present & (links.neighbours == restarted)
    np.testing.assert_array_equal(told_of, links.present & (links.neighbours == restarted) & (not heard))


@pytest.mark.parametrize("h", [0.0, 1.0, -0.3])
def test_a_step_that_is_no_share_is_refused(h):
    with pytest.raises(ValueError, match="h is a step between 0 and 1"):
        JacobiOverRelaxation(h)
