"""The preset formations are those of papers 000 and 004."""

import numpy as np
import pytest

from world.formation import PRESETS, Formation


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
