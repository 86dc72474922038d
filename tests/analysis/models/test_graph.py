"""The functional graph of a run, against loops over ticks, links and paths."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import null_space

from agents.algebra import geometry
from analysis.models import graph
from netem.core.links import Links
from world.formation.nominal import PRESETS
from world.formation.stress import equilibrium

ZHAO7, HEXA10 = PRESETS["zhao7"], PRESETS["hexa10"]
TICKS = 5
FRAMEWORKS = st.sampled_from(list(PRESETS.values()))


@st.composite
def flights(draw):
    """Links, and in which of a few ticks each was heard, shape (TICKS, L)."""
    agents = draw(st.integers(2, 7))
    edges = draw(st.sets(st.sampled_from(list(combinations(range(1, agents + 1), 2)))))
    links = Links.both_ways(agents, edges)
    return links, heard(len(links), draw(st.integers(0, 99)), draw(st.floats(0, 1)))


def heard(links, seed, availability=0.6):
    return np.random.default_rng(seed).random((TICKS, links)) < availability


def path(n):
    return symmetric(n, [(i, i + 1) for i in range(1, n)])


def star(n):
    return symmetric(n, [(1, i) for i in range(2, n + 1)])


def complete(n):
    return ~np.eye(n, dtype=bool)


def ring(n):
    return path(n) | symmetric(n, [(1, n)])


def symmetric(n, edges):
    links = Links.both_ways(n, edges)
    return graph.adjacency(np.ones(len(links), dtype=bool), links.src, links.dst, n)


def pairs(links, row):
    """(i, j) where i heard j."""
    return {(int(i), int(j)) for i, j, up in zip(links.dst, links.src, row, strict=True) if up}


def reached(roots, heard_by):
    """Agents that what the roots know gets to."""
    found, fresh = set(roots), set(roots)
    while fresh:
        fresh = {i for i, j in heard_by if j in fresh} - found
        found |= fresh
    return found


def adjacency_of(links, up):
    return graph.adjacency(up, links.src, links.dst, links.agents)


@settings(deadline=None, max_examples=50)
@given(flights())
def test_the_adjacency_says_who_heard_whom(flight):
    links, up = flight
    matrix = adjacency_of(links, up)
    assert matrix.shape == (TICKS, links.agents, links.agents)
    for tick in range(TICKS):
        assert {(int(i) + 1, int(j) + 1) for i, j in np.argwhere(matrix[tick])} == pairs(links, up[tick])


@settings(deadline=None, max_examples=50)
@given(flights())
def test_mutual_is_what_worked_both_ways(flight):
    links, up = flight
    both = graph.mutual(adjacency_of(links, up))
    for tick in range(TICKS):
        one_way = pairs(links, up[tick])
        expected = {(i, j) for i, j in one_way if (j, i) in one_way}
        assert {(int(i) + 1, int(j) + 1) for i, j in np.argwhere(both[tick])} == expected


@settings(deadline=None, max_examples=50)
@given(FRAMEWORKS, st.integers(0, 99))
def test_an_edge_is_up_when_both_its_links_are(formation, seed):
    links = Links.both_ways(formation.agents, formation.edges)
    up = heard(len(links), seed)
    expected = [[row[links.index[i, j]] and row[links.index[j, i]] for i, j in formation.edges] for row in up]
    assert graph.undirected(up, links.src, links.dst, formation.edges).tolist() == expected
    assert graph.undirected(up, links.src, links.dst, np.array(formation.edges)).tolist() == expected


def test_an_edge_without_links_is_never_up():
    links = Links.both_ways(3, [(1, 2)])
    everything = np.ones((1, len(links)), dtype=bool)
    assert graph.undirected(everything, links.src, links.dst, [(2, 1), (2, 3), (4, 1)]).tolist() == [
        [True, False, False]
    ]


@settings(deadline=None, max_examples=50)
@given(flights(), st.integers(1, TICKS + 2))
def test_joint_is_any_tick_of_the_window(flight, window):
    _, up = flight
    expected = [up[max(0, tick - window + 1) : tick + 1].any(axis=0) for tick in range(TICKS)]
    np.testing.assert_array_equal(graph.joint(up, window), expected)


def test_a_window_of_no_tick_is_refused():
    with pytest.raises(ValueError, match="a window of 0 ticks holds none"):
        graph.joint(np.ones((3, 2), dtype=bool), 0)


def test_halves_that_never_meet_in_one_tick_are_jointly_connected():
    links = Links.both_ways(3, [(1, 2), (2, 3)])
    up = np.array([links.touching(np.array([True, False, False])), links.touching(np.array([False, False, True]))] * 2)
    assert not graph.connected(adjacency_of(links, up)).any()
    assert graph.connected(adjacency_of(links, graph.joint(up, 2))).tolist() == [False, True, True, True]


def test_age_grows_until_something_newer_arrives():
    sent = np.array([[-1], [1], [-1], [2], [0], [5]])
    np.testing.assert_array_equal(graph.age(sent)[:, 0], [np.nan, 0, 1, 1, 2, 0])


def test_age_counts_from_the_ticks_of_the_rows():
    np.testing.assert_array_equal(graph.age(np.array([[-1], [9], [-1]]), np.array([8, 10, 12])), [[np.nan], [1], [3]])


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 999))
def test_age_against_a_loop(seed):
    rng = np.random.default_rng(seed)
    sent = np.where(
        rng.random((2, TICKS, 3)) < 0.5, rng.integers(0, np.arange(1, TICKS + 1)[:, None], (2, TICKS, 3)), -1
    )
    ages = graph.age(sent)
    assert ages.dtype == np.float64
    for run, tick, link in np.ndindex(sent.shape):
        newest = max(sent[run, : tick + 1, link])
        np.testing.assert_equal(ages[run, tick, link], tick - newest if newest >= 0 else np.nan)


@pytest.mark.parametrize("n", [2, 3, 7, 20])
def test_algebraic_connectivity_of_known_graphs(n):
    assert graph.algebraic_connectivity(complete(n)) == pytest.approx(n)
    assert graph.algebraic_connectivity(path(n)) == pytest.approx(2 - 2 * np.cos(np.pi / n))
    if n > 2:
        assert graph.algebraic_connectivity(star(n)) == pytest.approx(1)
        assert graph.algebraic_connectivity(ring(n)) == pytest.approx(2 - 2 * np.cos(2 * np.pi / n))


def test_a_link_that_works_one_way_connects_nothing():
    one_way = np.triu(complete(4))
    assert graph.algebraic_connectivity(one_way) == 0.0
    assert not graph.connected(one_way)


@settings(deadline=None, max_examples=50)
@given(flights())
def test_a_graph_is_connected_when_everybody_is_reached(flight):
    links, up = flight
    matrix = adjacency_of(links, up)
    expected = []
    for row in up:
        one_way = pairs(links, row)
        expected.append(len(reached({1}, {(i, j) for i, j in one_way if (j, i) in one_way})) == links.agents)
    assert graph.connected(matrix).tolist() == expected
    assert (graph.algebraic_connectivity(matrix) > 1e-9).tolist() == expected


@settings(deadline=None, max_examples=50)
@given(flights(), st.data())
def test_a_graph_is_rooted_when_everybody_is_reached_from_a_leader(flight, data):
    links, up = flight
    leaders = data.draw(st.lists(st.integers(1, links.agents), unique=True))
    expected = [len(reached(leaders, pairs(links, row))) == links.agents for row in up]
    assert graph.rooted(adjacency_of(links, up), leaders).tolist() == expected


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 9, 16, 17, 33])
def test_the_longest_path_is_followed_to_its_end(n):
    onward = np.eye(n, k=-1, dtype=bool)  # i hears i - 1 only
    assert graph.rooted(onward, [1])
    assert not graph.rooted(onward, np.array([2]))
    assert graph.connected(path(n))


def test_an_agent_alone_is_connected_and_rooted_in_itself():
    alone = np.zeros((1, 1), dtype=bool)
    assert graph.connected(alone)
    assert graph.rooted(alone, [1])


@settings(deadline=None, max_examples=50)
@given(FRAMEWORKS, st.integers(0, 99))
def test_feasible_is_the_rank_of_the_neighbours_heard(formation, seed):
    links = Links.both_ways(formation.agents, formation.edges)
    up = heard(len(links), seed, availability=0.4)
    found = graph.feasible(up, links.src, links.dst, formation.nominal)
    assert found.shape == (TICKS, formation.agents)
    for tick, i in np.ndindex(found.shape):
        neighbours = [j - 1 for dst, j in pairs(links, up[tick]) if dst == i + 1]
        H = formation.nominal[i] - formation.nominal[neighbours]
        assert found[tick, i] == (len(H) > 0 and np.linalg.matrix_rank(H) == formation.dimension)


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 99))
def test_feasible_agrees_with_the_estimators_in_space(seed):
    nominal = np.random.default_rng(seed).integers(0, 3, (7, 3)).astype(np.float64)  # many stand in one line or plane
    links = Links.both_ways(7, list(combinations(range(1, 8), 2)))
    up = heard(len(links), seed)
    relative = (nominal[:, None] - nominal)[np.arange(7)[:, None], links.neighbours]
    expected = geometry.regular(geometry.gram(relative, up[:, links.slots] & links.present))
    np.testing.assert_array_equal(graph.feasible(up, links.src, links.dst, nominal), expected)


def test_neighbours_in_line_or_none_at_all_do_not_determine_a_map():
    nominal = np.array([[0.0, 0.0], [0.1, 0.3], [0.2, 0.6], [1.0, 0.0]])
    src, dst = np.array([2, 3, 4]), np.array([1, 1, 1])
    heard_by_1 = np.array([[True, True, False], [True, False, True], [False, False, False]])
    assert graph.feasible(heard_by_1, src, dst, nominal)[:, 0].tolist() == [False, True, False]


def test_nobody_is_feasible_without_links():
    nobody = np.zeros(0, dtype=np.int64)
    found = graph.feasible(np.zeros((2, 0), dtype=bool), nobody, nobody, ZHAO7.nominal)
    assert found.tolist() == [[False] * ZHAO7.agents] * 2


def test_feasible_does_not_depend_on_the_unit():
    links = Links.both_ways(ZHAO7.agents, ZHAO7.edges)
    up = heard(len(links), 1)
    in_metres = graph.feasible(up, links.src, links.dst, ZHAO7.nominal)
    assert in_metres.any()
    for unit in (1e-6, 1e6):
        np.testing.assert_array_equal(graph.feasible(up, links.src, links.dst, unit * ZHAO7.nominal), in_metres)


def test_zhao7_has_one_stress_and_loses_it_with_any_edge():
    edges = len(ZHAO7.edges)
    assert graph.stress_dimension(np.ones(edges, dtype=bool), ZHAO7.edges, ZHAO7.nominal) == 1
    assert (graph.stress_dimension(~np.eye(edges, dtype=bool), ZHAO7.edges, ZHAO7.nominal) == 0).all()


def test_the_stresses_of_the_whole_framework_are_those_the_planner_chooses_from():
    everything = np.ones(len(HEXA10.edges), dtype=bool)
    assert graph.stress_dimension(everything, HEXA10.edges, HEXA10.nominal) == equilibrium(HEXA10).shape[1] == 13


@settings(deadline=None, max_examples=50)
@given(FRAMEWORKS, st.integers(0, 99))
def test_stress_dimension_is_the_nullity_of_the_balance(formation, seed):
    up = heard(len(formation.edges), seed, availability=0.9)
    found = graph.stress_dimension(up, np.array(formation.edges), formation.nominal)
    for tick in range(TICKS):
        balance = np.zeros((*formation.nominal.shape, up[tick].sum()))
        for column, (i, j) in enumerate(np.array(formation.edges)[up[tick]] - 1):
            balance[i, :, column] += formation.nominal[i] - formation.nominal[j]
            balance[j, :, column] += formation.nominal[j] - formation.nominal[i]
        assert found[tick] == null_space(balance.reshape(-1, up[tick].sum())).shape[1]


def test_three_in_line_have_a_stress_that_a_triangle_has_not():
    edges, up = [(1, 2), (2, 3), (1, 3)], np.ones(3, dtype=bool)
    assert graph.stress_dimension(up, edges, np.array([[0.1, 0.3], [0.2, 0.6], [0.7, 2.1]])) == 1
    assert graph.stress_dimension(up, edges, np.array([[0.1, 0.3], [0.2, 0.6], [0.7, 2.0]])) == 0


def test_no_edge_no_stress():
    assert graph.stress_dimension(np.zeros((2, 12), dtype=bool), ZHAO7.edges, ZHAO7.nominal).tolist() == [0, 0]
    assert graph.stress_dimension(np.zeros((2, 0), dtype=bool), [], ZHAO7.nominal).tolist() == [0, 0]


def test_leading_axes_are_runs_of_their_own():
    links = Links.both_ways(ZHAO7.agents, ZHAO7.edges)
    runs = np.stack([[heard(len(links), 3 * a + b, 0.9) for b in range(3)] for a in range(2)])

    def of(up):
        matrix, edges_up = adjacency_of(links, up), graph.undirected(up, links.src, links.dst, ZHAO7.edges)
        return (
            graph.mutual(matrix),
            edges_up,
            graph.joint(up, 2),
            graph.age(np.where(up, np.arange(TICKS)[:, None], -1)),
            graph.algebraic_connectivity(matrix),
            graph.connected(matrix),
            graph.rooted(matrix, ZHAO7.leaders),
            graph.feasible(up, links.src, links.dst, ZHAO7.nominal),
            graph.stress_dimension(edges_up, ZHAO7.edges, ZHAO7.nominal),
        )

    for a, b in np.ndindex(2, 3):
        for batched, single in zip(of(runs), of(runs[a, b]), strict=True):
            np.testing.assert_allclose(batched[a, b], single, atol=1e-12)
