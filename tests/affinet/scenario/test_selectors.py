"""Words for links, agents and groups: those of the graph against brute force, those of chance by what moves them."""

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from airs import edges_of
from hypothesis import given
from hypothesis import strategies as st

from affinet.scenario import selectors
from affinet.scenario.selectors import ChoiceKey
from analysis.models import cuts
from netem.core.links import Links
from world.formation import stress
from world.formation.nominal import PRESETS, Formation, NotRigid

ZHAO, HEXA = PRESETS["zhao7"], PRESETS["hexa10"]
LOT = ChoiceKey(seed=1, entry=1)
# Two triangles on the ends of a path: 1, 2, 3 - 4 - 5, 6, 7.
BARBELL = Formation(
    np.array([[0, 0], [0, 2], [1, 1], [2, 1], [3, 1], [4, 0], [4, 2]], dtype=np.float64),
    ((1, 2), (1, 3), (2, 3), (3, 4), (4, 5), (5, 6), (5, 7), (6, 7)),
    (1, 2, 6),
)


def over(formation):
    return Links.both_ways(formation.agents, formation.edges)


def links(selector, formation=ZHAO, lot=LOT):
    """The links that a word selects, as a set."""
    return set(selectors.pairs([selector], formation, over(formation), lot))


def agents(*words, formation=ZHAO, lot=LOT):
    return selectors.agents(words, formation, lot)


def both_ways(edges):
    return {way for i, j in edges for way in ((i, j), (j, i))}


# ---- words of agents


@pytest.mark.parametrize(
    ("words", "chosen"),
    [
        ([5], (5,)),
        ([5, 2], (5, 2)),
        ([5, 5], (5,)),
        (["leaders"], (1, 2, 3)),
        (["followers"], (4, 5, 6, 7)),
        (["all"], tuple(range(1, 8))),
        ([6, "leaders", 2], (6, 1, 2, 3)),
    ],
)
def test_agents_are_selected_by_number_and_role_each_once(words, chosen):
    assert agents(*words) == chosen


@pytest.mark.parametrize(
    "word", ["leader", "5", "", "2->4", "ring", "random", "random x", "random 2 links", "Random 2"]
)
def test_what_selects_no_agents_is_refused_with_the_ways_to_write_it(word):
    with pytest.raises(
        ValueError,
        match=rf"{word!r} selects no agents; (did you mean 'leaders'\? )?write a number, 'leaders', .*'random 2 leaders'",
    ):
        agents(word)


@pytest.mark.parametrize("word", ["random", "random -1", "random 2 leaders", "cut-vertices", "min-cuts", "rings"])
def test_what_selects_no_links_is_refused_with_the_ways_to_write_it(word):
    with pytest.raises(
        ValueError, match=rf"{word!r} selects no links; .*'random 3' or ring, bridges, min-cut, critical"
    ):
        links(word)


@pytest.mark.parametrize("number", [0, 8])
def test_agents_that_do_not_exist_are_refused(number):
    with pytest.raises(ValueError, match=f"agent {number} does not exist: agents are 1 to 7"):
        agents(number)


@pytest.mark.parametrize("word", [*selectors._OF_GRAPH, "random 3", "2->4", "leaders"])
def test_every_word_of_links_passes_its_check(word):
    assert selectors.check(word) == word


@pytest.mark.parametrize("word", [*selectors._AGENTS_OF_GRAPH, "random 3", "random 1 followers", "leaders", "all"])
def test_every_word_of_agents_passes_its_check(word):
    assert selectors.check_agents(word) == word


# ---- words of chance


def test_random_links_are_so_many_different_ones():
    chosen = selectors.pairs(["random 5"], ZHAO, over(ZHAO), LOT)
    assert len(chosen) == len(set(chosen)) == 5
    assert set(chosen) <= set(over(ZHAO).index)


@pytest.mark.parametrize(
    ("word", "among", "size"),
    [
        ("random 3", range(1, 8), 3),
        ("random 3 all", range(1, 8), 3),
        ("random 2 leaders", (1, 2, 3), 2),
        ("random 4 followers", (4, 5, 6, 7), 4),
    ],
)
def test_random_agents_are_so_many_of_those_named(word, among, size):
    drawn = [agents(word, lot=ChoiceKey(seed, 1)) for seed in range(40)]
    assert all(len(set(chosen)) == size and set(chosen) <= set(among) for chosen in drawn)
    assert {agent for chosen in drawn for agent in chosen} == set(among)  # anybody's turn may come


def test_a_random_choice_is_a_function_of_the_seed_and_the_entry_alone():
    lots = [ChoiceKey(seed, entry) for seed in range(4) for entry in range(1, 5)]
    for choose in (lambda lot: agents("random 3", lot=lot), lambda lot: links("random 6", lot=lot)):
        drawn = [choose(lot) for lot in lots]
        assert drawn == [choose(lot) for lot in lots]
        assert all(len({frozenset(row) for row in rows}) > 1 for rows in (drawn[:4], drawn[::4]))


def test_every_agent_is_as_likely():
    draws, share = 2000, 2 / 7
    counts = np.bincount(
        [one for seed in range(draws) for one in agents("random 2", lot=ChoiceKey(seed, 1))], minlength=8
    )
    assert counts[1:] == pytest.approx(draws * share, abs=5 * np.sqrt(draws * share * (1 - share)))


@pytest.mark.parametrize("seed", range(5))
def test_more_by_lot_are_those_and_others(seed):
    drawn = [set(agents(f"random {size}", lot=ChoiceKey(seed, 1))) for size in range(1, 8)]
    assert all(few < more for few, more in pairwise(drawn))


LARGER = replace(
    ZHAO, nominal=np.vstack([ZHAO.nominal, [[-2.0, 0.0]]]), edges=((1, 8), *ZHAO.edges, (2, 8), (5, 8), (7, 8))
)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("size", [1, 3, 5])
def test_one_agent_more_moves_nobody_elses_draw(seed, size):
    """Who is drawn among more is drawn among fewer too, unless he is new."""
    lot = ChoiceKey(seed, 2)
    few, many = (agents(f"random {size}", formation=each, lot=lot) for each in (ZHAO, LARGER))
    assert set(many) - {8} <= set(few)
    old, new = (links(f"random {3 * size}", formation=each, lot=lot) for each in (ZHAO, LARGER))
    assert {pair for pair in new if 8 not in pair} <= old


def test_the_order_of_edges_moves_no_draw():
    shuffled = replace(ZHAO, edges=ZHAO.edges[::-1])
    assert links("random 5") == links("random 5", formation=shuffled)


@pytest.mark.parametrize("size", [0, 25])
def test_more_links_than_there_are_cannot_be_chosen(size):
    with pytest.raises(ValueError, match=f"cannot choose {size} of 24 links"):
        links(f"random {size}")


@pytest.mark.parametrize(
    ("word", "says"), [("random 8", "8 of 7"), ("random 4 leaders", "4 of 3"), ("random 0", "0 of")]
)
def test_more_agents_than_there_are_cannot_be_chosen(word, says):
    with pytest.raises(ValueError, match=f"cannot choose {says}"):
        agents(word)


def test_outside_of_the_timeline_nothing_is_random():
    with pytest.raises(ValueError, match="a random choice is for the timeline only"):
        links("random 1", lot=None)


# ---- words of the graph


def test_the_ring_is_the_links_of_agents_in_succession_both_ways():
    assert links("ring") == both_ways([(1, 2), (4, 5), (6, 7)])
    assert links("ring", formation=BARBELL) == both_ways([(1, 2), (2, 3), (3, 4), (4, 5), (5, 6), (6, 7)])
    closed = replace(BARBELL, edges=(*BARBELL.edges, (1, 7)))
    assert links("ring", formation=closed) == links("ring", formation=BARBELL) | both_ways([(1, 7)])


def test_a_barbell_breaks_at_its_bar():
    assert links("bridges", formation=BARBELL) == both_ways([(3, 4), (4, 5)])
    assert agents("cut-vertices", formation=BARBELL) == (3, 4, 5)
    assert links("min-cut", formation=BARBELL) in (both_ways([(3, 4)]), both_ways([(4, 5)]))


@pytest.mark.parametrize("formation", PRESETS.values(), ids=PRESETS)
def test_a_rigid_formation_has_no_bridge_and_no_cut_vertex(formation):
    with pytest.raises(ValueError, match="no edge's loss disconnects the formation"):
        links("bridges", formation=formation)
    with pytest.raises(ValueError, match="no agent's loss disconnects the others"):
        agents("cut-vertices", formation=formation)


def test_without_agents_in_succession_there_is_no_ring():
    star = Formation(ZHAO.nominal[:5], ((1, 3), (1, 4), (2, 4), (2, 5), (3, 5)), (1, 2, 3))
    with pytest.raises(ValueError, match="no agents in succession are linked"):
        links("ring", formation=star)


@st.composite
def graphs(draw):
    """Connected graphs of few agents: a tree, and edges more."""
    size = draw(st.integers(2, 7))
    tree = [(draw(st.integers(1, n - 1)), n) for n in range(2, size + 1)]
    more = draw(st.lists(st.sampled_from(edges_of(size)), max_size=8))
    return size, list(dict.fromkeys([*tree, *more]))


def parts(nodes, edges):
    """The connected parts, by walking."""
    left, found = set(nodes), []
    while left:
        part = {left.pop()}
        while grown := {j for edge in edges for i, j in (edge, edge[::-1]) if i in part and j in left - part}:
            part |= grown
        left -= part
        found.append(part)
    return found


@given(graphs())
def test_bridges_are_the_edges_without_which_there_are_two_parts(graph):
    size, edges = graph
    brute = [one for one in edges if len(parts(range(1, size + 1), [edge for edge in edges if edge != one])) > 1]
    assert cuts.bridges(size, edges) == brute


@given(graphs())
def test_cut_vertices_are_the_agents_without_whom_the_others_are_in_parts(graph):
    size, edges = graph
    everybody = range(1, size + 1)
    brute = [
        one for one in everybody if len(parts(set(everybody) - {one}, [edge for edge in edges if one not in edge])) > 1
    ]
    assert cuts.cut_vertices(size, edges) == brute


@given(graphs())
def test_no_other_two_sides_have_fewer_edges_between_them_than_those_of_the_smallest_cut(graph):
    size, edges = graph
    side = set((np.flatnonzero(cuts.smallest_cut(size, edges)) + 1).tolist())

    def crossing(one):
        return sum((i in one) != (j in one) for i, j in edges)

    others = [{1, *rest} for number in range(size - 1) for rest in combinations(range(2, size + 1), number)]
    assert side in others
    assert crossing(side) == min(map(crossing, others))


@pytest.mark.parametrize(
    ("formation", "size"), [(ZHAO, 3), (HEXA, 5), (BARBELL, 1)], ids=["zhao7", "hexa10", "barbell"]
)
def test_the_smallest_cut_is_what_crosses_between_its_sides(formation, size):
    one, other = selectors.groups("min-cut", formation)
    assert sorted((*one, *other)) == list(range(1, formation.agents + 1))
    crossing = {(i, j) for i, j in over(formation).index if (i in one) != (j in one)}
    assert links("min-cut", formation=formation) == crossing
    assert len(crossing) == 2 * size


# ---- what the framework cannot do without


def test_zhao7_has_no_link_to_spare_and_the_critical_one_is_the_first():
    assert not any(carries(ZHAO, edges=without(ZHAO, one)) for one in ZHAO.edges)
    assert not any(stress.survives(ZHAO, edge=one) for one in ZHAO.edges)
    assert links("critical") == both_ways([(1, 2)])


def test_hexa10_can_spare_any_link():
    assert all(carries(HEXA, edges=without(HEXA, one)) for one in HEXA.edges)
    with pytest.raises(ValueError, match="the framework stays rigid whichever is lost"):
        links("critical", formation=HEXA)


def test_the_critical_link_is_the_first_that_cannot_be_spared_not_the_first():
    """All links of seven agents, and an eighth who hangs on three of them: none of those can be spared."""
    nodes = np.vstack([ZHAO.nominal * [1.0, 1.3] + 0.1 * ZHAO.nominal[::-1], [[0.3, 4.0]]])
    hung = Formation(nodes, (*edges_of(7), (1, 8), (4, 8), (5, 8)), (1, 4, 5))
    assert links("critical", formation=hung) == both_ways([(1, 8)])


@pytest.mark.parametrize("formation", PRESETS.values(), ids=PRESETS)
def test_the_critical_agent_is_the_first_without_whom_no_stress_stabilises_or_no_leaders_span(formation):
    fragile = [one for one in range(1, formation.agents + 1) if one in formation.leaders or not goes_on(formation, one)]
    assert agents("critical", formation=formation) == (fragile[0],)  # D + 1 leaders: none to spare
    assert [one for one in range(1, formation.agents + 1) if not stress.survives(formation, agent=one)] == fragile


def test_a_framework_with_everything_to_spare_has_nothing_critical():
    nodes = np.array([[0, 0], [3, 0.5], [4, 3], [1, 4], [-1.5, 2], [1.5, 1.8]], dtype=np.float64)
    complete = Formation(nodes, tuple(edges_of(6)), (1, 2, 3, 4))
    for choose in (lambda: links("critical", formation=complete), lambda: agents("critical", formation=complete)):
        with pytest.raises(ValueError, match="the framework stays rigid whichever is lost"):
            choose()


def test_leaders_left_on_a_line_are_too_few():
    nodes = np.array([[0, 0], [2, 0], [4, 0], [1, 4], [3, 4], [2, 1.8]], dtype=np.float64)
    formation = Formation(nodes, tuple(edges_of(6)), (1, 2, 3, 4))
    assert agents("critical", formation=formation) == (4,)
    assert stress.survives(formation, agent=1)


def without(formation, edge):
    return tuple(each for each in formation.edges if each != edge)


def carries(formation, **changes):
    """Whether a formation has a stabilising stress."""
    try:
        stress.solve(replace(formation, **changes))
    except NotRigid:
        return False
    return True


def goes_on(formation, lost):
    """Whether the framework has a stabilising stress without an agent, renumbered."""
    left = [agent for agent in range(1, formation.agents + 1) if agent != lost]
    edges = tuple((left.index(i) + 1, left.index(j) + 1) for i, j in formation.edges if lost not in (i, j))
    return carries(formation, nominal=formation.nominal[np.array(left) - 1], edges=edges)


# ---- groups


@pytest.mark.parametrize(
    ("split", "formation", "sides"),
    [
        ("halves", ZHAO, ((1, 2, 3), (4, 5, 6, 7))),
        ("halves", HEXA, ((1, 2, 3, 4, 5), (6, 7, 8, 9, 10))),
        ("leaders", HEXA, ((2, 6, 8), (1, 3, 4, 5, 7, 9, 10))),
    ],
)
def test_a_swarm_is_split_in_two(split, formation, sides):
    assert selectors.groups(split, formation) == sides
