"""The preset formations: those of papers 000 and 004, and one in space."""

from itertools import combinations, product

import numpy as np
import pytest

from world.formation.nominal import PRESETS, Formation


def test_zhao7_is_graph_1_of_paper_000():
    zhao7 = PRESETS["zhao7"]
    assert (zhao7.agents, zhao7.dimension, zhao7.leaders) == (7, 2, (1, 2, 3))
    assert zhao7.nominal.tolist() == [[2, 0], [1, 1], [1, -1], [0, 1], [0, -1], [-1, 1], [-1, -1]]
    edges = {(1, 2), (1, 3), (1, 4), (1, 5), (2, 4), (2, 7), (3, 5), (3, 6), (4, 5), (4, 6), (5, 7), (6, 7)}
    assert set(zhao7.edges) == edges
    assert len(zhao7.edges) == 12


def test_hexa10_is_graph_2_of_paper_000():
    hexa10 = PRESETS["hexa10"]
    assert (hexa10.agents, hexa10.dimension, hexa10.leaders) == (10, 2, (2, 6, 8))
    nominal = [[3, 0], [2, 2], [2, -2], [1, 0], [0, 2], [0, -2], [-1, 0], [-2, 2], [-2, -2], [-3, 0]]
    assert hexa10.nominal.tolist() == nominal
    text = "12 13 14 15 16 23 24 25 27 34 36 37 45 46 47 48 49 56 57 58 67 69 78 79 89"
    edges = {(int(i), int(j)) for i, j in text.split()} | {(5, 10), (6, 10), (7, 10), (8, 10), (9, 10)}
    assert set(hexa10.edges) == edges
    assert len(hexa10.edges) == 30


def test_octa10_is_an_octahedron_with_its_diagonals_about_a_tetrahedron_with_its_edges():
    octa10 = PRESETS["octa10"]
    assert (octa10.agents, octa10.dimension, octa10.leaders) == (10, 3, (1, 3, 6, 10))
    tips, core = octa10.nominal[:6], octa10.nominal[6:]
    assert sorted(tips.tolist()) == sorted([*(2 * np.eye(3)).tolist(), *(-2 * np.eye(3)).tolist()])
    assert {tuple(corner) for corner in core.tolist()} == {
        (x / 2, y / 2, x * y / 2) for x, y in product((1, -1), repeat=2)
    }
    edges = {frozenset(edge) for edge in octa10.edges}
    assert {frozenset(pair) for pair in [*combinations(range(1, 7), 2), *combinations(range(7, 11), 2)]} <= edges
    # The rest ties each corner of the tetrahedron to the three tips about it.
    tied = {
        frozenset((tip, 7 + row))
        for row, corner in enumerate(core)
        for tip in range(1, 7)
        if tips[tip - 1] @ corner > 0
    }
    assert len(tied) == 12
    assert len(edges) == len(octa10.edges) == 15 + 6 + 12
    assert tied <= edges


@pytest.mark.parametrize("preset", PRESETS)
def test_every_undirected_edge_is_named_once(preset):
    edges = [tuple(sorted(edge)) for edge in PRESETS[preset].edges]
    assert len(set(edges)) == len(edges)
    assert all(i != j for i, j in edges)


def test_leaders_are_marked_in_the_order_of_the_agents():
    square = Formation(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float), ((1, 2),), leaders=(4, 1, 2))
    assert square.is_leader.tolist() == [True, True, False, True]


def test_dimension_is_the_number_of_coordinates():
    assert Formation(np.zeros((5, 3)), (), ()).dimension == 3
