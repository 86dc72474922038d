"""The stress of a large formation is the sum of those of its cliques: balanced, semidefinite, zero for affine maps alone."""

from hashlib import sha256
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

from world.formation import composed, layouts, spectrum, stress, swarms
from world.formation.cliques import affine_basis, cliques, within
from world.formation.composed import compose
from world.formation.design import design
from world.formation.leading import corners, led
from world.formation.nominal import Formation, NotRigid


def framework(nominal, reach):
    nominal = np.asarray(nominal, dtype=np.float64)
    return Formation(nominal, within(nominal, reach), ())


def nullity(L):
    values = np.linalg.eigvalsh(L)
    assert values[0] > -1e-12 * values[-1]
    return int((values < 1e-10 * values[-1]).sum())


# Nodes


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_grid_has_the_nodes_of_the_lattice_that_are_closest_to_its_origin(dimension):
    nodes = layouts.grid(60, dimension)
    assert len({tuple(node) for node in nodes.tolist()}) == 60
    assert (nodes == np.rint(nodes)).all()
    far = (nodes**2).sum(axis=1)
    assert (np.diff(far) >= 0).all()
    closer = sum(
        sum(x * x for x in node) < far[-1] for node in np.ndindex(*[21] * dimension) for node in [np.array(node) - 10]
    )
    assert closer == (far < far[-1]).sum()


@pytest.mark.parametrize("dimension", [2, 3])
def test_nodes_strewn_at_random_keep_their_distance_and_are_a_function_of_the_seed(dimension):
    nodes = layouts.strewn(80, dimension, 1)
    apart = np.linalg.norm(nodes[:, None] - nodes, axis=-1)
    assert apart[~np.eye(80, dtype=bool)].min() >= 0.7 - 1e-12
    assert np.abs(nodes).max() <= 80 ** (1 / dimension) / 2 + 1e-3
    assert (nodes == layouts.strewn(80, dimension, 1)).all()
    assert (nodes != layouts.strewn(80, dimension, 2)).any()


def test_who_is_within_reach_has_an_edge_and_who_is_not_has_none():
    nodes = layouts.strewn(50, 3, 3)
    expected = {(i, j) for i, j in combinations(range(1, 51), 2) if np.linalg.norm(nodes[i - 1] - nodes[j - 1]) <= 2.0}
    assert set(within(nodes, 2.0)) == expected


def test_who_is_just_within_reach_is_so_whatever_was_rounded():
    assert within(np.array([[0.1, 0.0], [0.4, 0.0]]), 0.3) == ((1, 2),)


# Cliques


@pytest.mark.parametrize(("dimension", "reach"), [(2, 2.5), (3, 2.0)])
def test_every_edge_is_in_a_clique_and_no_clique_in_a_larger_one(dimension, reach):
    formation = framework(layouts.strewn(70, dimension, 5), reach)
    edges, found = (
        {frozenset(edge) for edge in formation.edges},
        [set((rows + 1).tolist()) for rows in cliques(formation)],
    )
    assert {frozenset(pair) for clique in found for pair in combinations(clique, 2)} == edges
    for clique in found:
        others = set(range(1, 71)) - clique
        assert not [one for one in others if all(frozenset((one, member)) in edges for member in clique)]
    assert len({tuple(sorted(clique)) for clique in found}) == len(found)


def test_the_affine_functions_of_a_piece_are_told_by_an_orthonormal_basis():
    pieces = np.random.default_rng(1).normal(size=(4, 9, 3)) + 1e3
    basis, spans = affine_basis(pieces)
    assert spans.all()
    np.testing.assert_allclose(basis @ np.swapaxes(basis, -1, -2), np.broadcast_to(np.eye(4), (4, 4, 4)), atol=1e-13)
    affine = np.swapaxes(np.concatenate([pieces, np.ones((4, 9, 1))], axis=-1), -1, -2)
    np.testing.assert_allclose(affine @ np.swapaxes(basis, -1, -2) @ basis, affine, rtol=1e-12)


def test_pieces_that_are_flat_do_not_span():
    flat = np.array([[[0.0, 0], [1, 1], [2, 2], [3, 3]], [[1, 1]] * 4, [[0, 0], [0, 1], [1, 0], [1, 1]]])
    assert affine_basis(flat)[1].tolist() == [False, False, True]


# The sum


@settings(max_examples=8, deadline=None)
@given(
    st.sampled_from([(2, 2.6), (2, 3.0), (3, 2.0), (3, 2.4)]),
    st.integers(41, 60),
    st.integers(1, 10_000),
    st.floats(0.1, 50),
)
def test_the_sum_balances_is_semidefinite_and_has_the_nullity_of_affine_maps(kind, agents, seed, scale):
    dimension, reach = kind
    formation = framework(scale * layouts.strewn(agents, dimension, seed), scale * reach)
    try:
        L = stress.laplacian(formation, compose(formation))
    except NotRigid:
        assert not hangs_together(formation)
        return
    np.testing.assert_allclose(L @ formation.nominal, 0.0, atol=1e-12 * scale)
    assert nullity(L) == dimension + 1
    assert 0.989 < np.linalg.eigvalsh(L)[-1] <= 1.0 + 1e-12


def hangs_together(formation):
    """Whether pieces that span and share D + 1 nodes that span join to a whole: then the nullity cannot be more."""
    least = formation.dimension + 1

    def spans(rows):
        return len(rows) >= least and affine_basis(formation.nominal[None, sorted(rows)])[1][0]

    pieces = [set(rows.tolist()) for rows in cliques(formation) if len(rows) > least and spans(rows)]
    while True:
        pair = next(((one, other) for one, other in combinations(pieces, 2) if spans(one & other)), None)
        if pair is None:
            return len(pieces) == 1 and len(pieces[0]) == formation.agents
        pieces = [piece for piece in pieces if piece not in pair] + [pair[0] | pair[1]]


def two_squares(shared):
    """Two blocks of 3 x 3 nodes, of which the last and the first have so many nodes in common."""
    block = np.array(list(np.ndindex(3, 3)), dtype=np.float64)
    other = np.array([[2.0, y] for y in range(3)] + [[x, y] for x in (3.0, 4.0) for y in range(3)])
    nodes = {tuple(node): None for node in block} | {tuple(node): None for node in other[3 - shared :]}
    places = [*nodes]
    number = {place: row + 1 for row, place in enumerate(places)}
    edges = {
        tuple(sorted((number[one], number[two])))
        for part in (block, other[3 - shared :])
        for one, two in combinations(map(tuple, part), 2)
    }
    return Formation(np.array(places), tuple(sorted(edges)), ())


def test_pieces_with_three_nodes_in_common_that_span_hold_together():
    formation = two_squares(3)
    bent = formation.nominal.copy()
    bent[(bent == [2.0, 1.0]).all(axis=1), 0] = 2.5
    formation = Formation(bent, formation.edges, ())
    assert nullity(stress.laplacian(formation, compose(formation))) == 3


@pytest.mark.parametrize("shared", [3, 2, 1])
def test_pieces_that_may_fold_about_what_they_share_are_refused(shared):
    formation = two_squares(shared)  # three nodes in a line are a hinge as well
    with pytest.raises(NotRigid, match="do not hold together: the sum of their stresses has a nullity above 3"):
        compose(formation)
    assert nullity(composed.summed(formation).toarray()) > 3


def test_agents_in_no_clique_are_named():
    nodes = np.concatenate([layouts.grid(50, 2), [[30.0, 0.0], [31.0, 0.0]]])
    with pytest.raises(NotRigid, match=r"agents 51, 52 are in no clique of 4 or more that spans"):
        compose(framework(nodes, 2.5))


def test_nodes_on_a_line_are_refused():
    line = np.column_stack([np.arange(60.0), np.zeros(60)])
    with pytest.raises(NotRigid, match=r"agents 1, 2, 3, 4, 5, 6 and 54 more are in no clique"):
        compose(framework(line, 4.0))


def test_the_last_bits_of_an_eigenvalue_are_not_in_the_weights(monkeypatch):
    formation = framework(layouts.grid(250, 2), 2.25)
    weights, largest = compose(formation), spectrum.largest
    monkeypatch.setattr(spectrum, "largest", lambda matrix: largest(matrix) * (1.0 + 1e-13))
    assert (compose(formation) == weights).all()


# Leaders


def test_corners_span():
    for dimension in (2, 3):
        nodes = layouts.grid(40, dimension)
        found = nodes[corners(nodes)]
        assert np.linalg.matrix_rank(found - found[0]) == dimension


def slowest_of(formation):
    L = stress.own(formation, formation.weights)
    followers = ~formation.is_leader
    return np.linalg.eigvalsh(L[np.ix_(followers, followers)])[0]


@pytest.mark.parametrize(("dimension", "reach", "agents"), [(2, 3.0, 90), (3, 2.25, 90), (2, 2.5, 260)])
def test_a_design_is_as_fast_as_is_asked_with_as_few_leaders_as_that_takes(dimension, reach, agents):
    nodes = layouts.grid(agents, dimension)
    formation, smallest = design(nodes, reach, 0.01)
    assert slowest_of(formation) >= 0.01
    assert smallest == pytest.approx(slowest_of(formation), rel=1e-6)
    L = sparse.csr_array(stress.own(formation, formation.weights))
    just_less = led(nodes, L, 0.99999 * slowest_of(formation)).leaders
    assert just_less == formation.leaders
    slower = led(nodes, L, 0.004).leaders
    assert set(slower) < set(formation.leaders)


def test_leaders_by_the_slowest_mode_beat_as_many_by_chance():
    formation = design(layouts.grid(150, 2), 3.0, 0.01).formation
    rng = np.random.default_rng(1)
    for _ in range(20):
        chance = Formation(
            formation.nominal,
            formation.edges,
            tuple(1 + rng.permutation(150)[: len(formation.leaders)]),
            formation.weights,
        )
        assert slowest_of(chance) < 0.6 * slowest_of(formation)


def test_what_no_leaders_reach_is_refused():
    with pytest.raises(ValueError, match="no leaders make the smallest eigenvalue 2, where the largest is"):
        design(layouts.grid(45, 2), 3.0, 2.0)


# Ends of the spectrum


@pytest.mark.parametrize("agents", [150, 300])
def test_few_eigenvalues_are_those_of_all(agents):
    # A lattice is as symmetric as can be: from a start that is, Lanczos would miss the modes across.
    formation = framework(layouts.grid(agents, 2), 2.25)
    L = stress.laplacian(formation, compose(formation))
    held = L[6:, 6:]
    values = np.linalg.eigvalsh(held)
    found, mode = spectrum.slowest(sparse.csr_array(held), 1.0)
    assert found == pytest.approx(values[0], rel=1e-7)
    np.testing.assert_allclose(held @ mode, found * mode, atol=1e-9)
    assert spectrum.largest(sparse.csr_array(L)) == pytest.approx(np.linalg.eigvalsh(L)[-1], rel=1e-9)


def test_a_singular_block_is_found_to_be_singular():
    formation = framework(layouts.grid(300, 2), 2.25)
    L = sparse.csr_array(stress.laplacian(formation, compose(formation)))
    assert abs(spectrum.slowest(L, 1.0)[0]) < 1e-12


# By `solve`, and by name


@pytest.fixture
def no_program(monkeypatch):
    def refuse(*_):
        raise AssertionError("the program was asked")

    monkeypatch.setattr(stress, "_programmed", refuse)


@pytest.mark.parametrize("name", swarms.SWARMS)
@pytest.mark.usefixtures("no_program")
def test_swarms_settle_within_10_seconds_at_a_gain_of_10(name):
    formation = swarms.preset(name)
    agents, dimension = int(name.removeprefix("swarm").removesuffix("-3d")), 3 if name.endswith("3d") else 2
    assert formation.nominal.shape == (agents, dimension)
    weights = stress.solve(formation)
    L = stress.laplacian(formation, weights)
    np.testing.assert_allclose(L @ formation.nominal, 0.0, atol=1e-12)
    assert nullity(L) == dimension + 1
    followers = ~formation.is_leader
    slow, fast = np.linalg.eigvalsh(L[np.ix_(followers, followers)])[[0, -1]]
    assert 1.0 / (10.0 * slow) < 10.0
    assert fast <= 1.0


@pytest.mark.parametrize(("name", "bits"), [("swarm50", "9d30dd0fb63dd49a"), ("swarm500-3d", "b063831fc11da81c")])
def test_the_weights_of_swarms_have_the_same_bits_on_any_machine(name, bits):
    assert sha256(stress.solve(swarms.preset(name)).tobytes()).hexdigest()[:16] == bits


@pytest.mark.parametrize("agents", [60, 101])
def test_where_cliques_do_not_hold_together_only_few_agents_are_given_to_the_program(agents, monkeypatch):
    asked = []

    def program(formation):
        asked.append(formation.agents)
        return np.ones(len(formation.edges)), ""

    monkeypatch.setattr(stress, "_programmed", program)
    path = framework(np.column_stack([np.arange(agents), np.arange(agents) % 2]), 1.5)
    if agents > 100:
        with pytest.raises(NotRigid, match="are in no clique of 4 or more that spans"):
            stress.solve(path)
    else:
        stress.solve(path)
    assert asked == [agents] * (agents <= 100)


def test_weights_of_ones_own_stand_in_the_rows_of_who_gives_them():
    formation = Formation(np.zeros((3, 2)), ((1, 2), (3, 2)), ())
    L = stress.own(formation, np.array([[1.0, 2.0], [3.0, 4.0]]))
    assert L.tolist() == [[1, -1, 0], [-2, 6, -4], [0, -3, 3]]
