"""A stress balances its framework, and stabilises it when the framework is universally rigid."""

import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import combinations

import cvxpy
import numpy as np
import pytest
from scipy.linalg import null_space

from world.formation.nominal import PRESETS, Formation, NotRigid
from world.formation.stress import equilibrium, incidence, laplacian, solve

ZHAO7, HEXA10, OCTA10 = PRESETS["zhao7"], PRESETS["hexa10"], PRESETS["octa10"]
# 12:4 13:4 14:-2 15:-2 24:8 27:-2 35:8 36:-2 45:1 46:4 57:4 67:2
KNOWN = np.array([4, 4, -2, -2, 8, -2, 8, -2, 1, 4, 4, 2]) / np.sqrt(213)


@pytest.fixture(scope="module")
def zhao7():
    return solve(ZHAO7)


@pytest.fixture(scope="module")
def hexa10():
    return solve(HEXA10)


@pytest.fixture(scope="module")
def octa10():
    return solve(OCTA10)


def follower_targets(weights, p):
    L = laplacian(ZHAO7, weights)
    return np.linalg.solve(L[3:, 3:], -L[3:, :3] @ p[:3])


def test_incidence_has_a_column_per_edge_that_leaves_and_enters():
    assert incidence(3, ((1, 2), (3, 2))).tolist() == [[1, 0], [-1, -1], [0, 1]]


def test_off_the_diagonal_the_stress_matrix_is_minus_the_weight():
    L = laplacian(ZHAO7, KNOWN)
    assert L[1, 3] == L[3, 1] == -KNOWN[4]
    assert L[0, 6] == 0.0
    np.testing.assert_allclose(L.sum(axis=1), 0.0, atol=1e-15)


def test_the_known_stress_balances_zhao7():
    np.testing.assert_allclose(laplacian(ZHAO7, KNOWN) @ ZHAO7.nominal, 0.0, atol=1e-15)


def test_the_stress_of_zhao7_is_unique():
    assert equilibrium(ZHAO7).shape == (12, 1)


def test_the_stresses_of_hexa10_are_a_space_of_13_dimensions():
    assert equilibrium(HEXA10).shape == (30, 13)


def test_zhao7_solves_to_the_known_stress(zhao7):
    np.testing.assert_allclose(zhao7, KNOWN, atol=1e-6)


def test_eigenvalues_of_zhao7(zhao7):
    L = laplacian(ZHAO7, zhao7)
    np.testing.assert_allclose(np.linalg.eigvalsh(L), [0, 0, 0, 0.3383, 0.5967, 1.3218, 1.4432], atol=5e-5)
    np.testing.assert_allclose(np.linalg.eigvalsh(L[3:, 3:]), [0.0235, 0.2741, 0.7987, 0.9593], atol=5e-5)


@pytest.mark.parametrize("weights", ["known", "solved"])
def test_followers_of_zhao7_stand_where_the_leaders_put_them(weights, zhao7):
    p = np.random.default_rng(1).normal(size=(7, 2))
    targets = follower_targets(KNOWN if weights == "known" else zhao7, p)
    p1, p2, p3 = p[:3]
    expected = [-p1 + 1.5 * p2 + 0.5 * p3, -p1 + 0.5 * p2 + 1.5 * p3, -2 * p1 + 2 * p2 + p3, -2 * p1 + p2 + 2 * p3]
    np.testing.assert_allclose(targets, expected, atol=1e-9)


def test_followers_of_zhao7_are_at_home_in_the_nominal_formation(zhao7):
    np.testing.assert_allclose(follower_targets(zhao7, ZHAO7.nominal), ZHAO7.nominal[3:], atol=1e-9)


@pytest.mark.parametrize("name", ["hexa10", "octa10"])
def test_the_solved_stress_balances(name, request):
    formation = PRESETS[name]
    L = laplacian(formation, request.getfixturevalue(name))
    np.testing.assert_allclose(L @ formation.nominal, 0.0, atol=1e-10)
    np.testing.assert_allclose(L.sum(axis=1), 0.0, atol=1e-10)


def test_the_stress_matrix_of_hexa10_is_semidefinite_of_rank_7(hexa10):
    spectrum = np.linalg.eigvalsh(laplacian(HEXA10, hexa10))
    np.testing.assert_allclose(spectrum[:3], 0.0, atol=1e-10)
    assert spectrum[3] > 0.1


def test_the_stress_matrix_of_octa10_is_semidefinite_of_rank_6_and_well_conditioned(octa10):
    spectrum = np.linalg.eigvalsh(laplacian(OCTA10, octa10))
    np.testing.assert_allclose(spectrum[:4], 0.0, atol=1e-10)
    np.testing.assert_allclose(spectrum[[4, -1]], [0.960, 1.067], atol=5e-4)


def test_followers_of_octa10_stand_where_the_leaders_put_them(octa10):
    L, leader = laplacian(OCTA10, octa10), OCTA10.is_leader
    theta, offset = np.random.default_rng(1).normal(size=(3, 3)), np.array([5.0, -1.0, 2.0])
    mapped = OCTA10.nominal @ theta.T + offset
    targets = np.linalg.solve(L[np.ix_(~leader, ~leader)], -L[np.ix_(~leader, leader)] @ mapped[leader])
    np.testing.assert_allclose(targets, mapped[~leader], atol=1e-9)


@pytest.mark.parametrize("preset", ["zhao7", "hexa10", "octa10"])
def test_the_stress_has_unit_norm(preset, request):
    assert np.linalg.norm(request.getfixturevalue(preset)) == pytest.approx(1.0, abs=1e-6)


def test_no_other_stress_of_unit_norm_is_better_conditioned(hexa10):
    rng, basis = np.random.default_rng(1), equilibrium(HEXA10)
    affine = null_space(np.column_stack([HEXA10.nominal, np.ones(10)]).T)

    def least(weights):
        return np.linalg.eigvalsh(affine.T @ laplacian(HEXA10, weights) @ affine)[0]

    for size in (0.3, 0.03, 0.003):
        for _ in range(50):
            other = hexa10 + size * basis @ rng.normal(size=13)
            assert least(other / np.linalg.norm(other)) < least(hexa10) + 1e-7


def test_the_stress_does_not_depend_on_where_the_formation_lies_and_how_large_it_is(zhao7):
    moved = Formation(3.0 * ZHAO7.nominal + [10.0, -20.0], ZHAO7.edges, ZHAO7.leaders)
    np.testing.assert_allclose(solve(moved), zhao7, atol=1e-6)


def test_an_octahedron_with_its_diagonals_has_a_stress_of_rank_2():
    octahedron = np.concatenate([np.eye(3), -np.eye(3)])
    complete = Formation(octahedron, tuple(combinations(range(1, 7), 2)), (1, 2, 3, 4))
    L = laplacian(complete, solve(complete))
    np.testing.assert_allclose(L @ octahedron, 0.0, atol=1e-10)
    np.testing.assert_allclose(np.linalg.eigvalsh(L)[:4], 0.0, atol=1e-10)
    assert np.linalg.eigvalsh(L)[4] > 0.1


def test_an_octahedron_without_diagonals_carries_no_stress():
    edges = tuple((i, j) for i, j in combinations(range(1, 7), 2) if j - i != 3)
    with pytest.raises(NotRigid, match="no stress but zero balances the framework"):
        solve(Formation(np.concatenate([np.eye(3), -np.eye(3)]), edges, (1, 2, 3, 4)))


def test_too_few_edges_carry_no_stress():
    without_67 = Formation(ZHAO7.nominal, ZHAO7.edges[:-1], ZHAO7.leaders)
    says = (
        "no stress but zero balances the framework; 7 nodes in general position need 12 edges at least, and it has 11"
    )
    with pytest.raises(NotRigid, match=f"^{says}$"):
        solve(without_67)


def test_a_triangle_carries_no_stress():
    with pytest.raises(NotRigid, match="no stress but zero balances the framework"):
        solve(Formation(np.array([[0.0, 0], [1, 0], [0, 1]]), ((1, 2), (1, 3), (2, 3)), (1, 2, 3)))


def test_a_framework_that_folds_about_a_hinge_is_not_universally_rigid():
    # Two complete graphs of four that share the edge 3-4: rigid, but one half may be reflected.
    nodes = np.array([[-2.0, 0], [-1, 2], [0, 0], [0, 3], [1, 2.5], [2, -0.5]])
    edges = tuple(sorted({*combinations((1, 2, 3, 4), 2), *combinations((3, 4, 5, 6), 2)}))
    with pytest.raises(NotRigid, match=r"not universally rigid: .* rank N - D - 1 = 3"):
        solve(Formation(nodes, edges, (1, 2, 3)))


def test_a_formation_on_a_line_of_the_plane_has_no_stress_of_rank_n_minus_3():
    nodes = np.array([[0.0, 0], [1, 0], [2, 0], [4, 0]])
    with pytest.raises(NotRigid, match=r"line|span|rigid"):
        solve(Formation(nodes, tuple(combinations((1, 2, 3, 4), 2)), (1, 2, 3)))


def complaining(monkeypatch, solves):
    """The modeller warns as it does of a problem that is hard, in words that may change."""
    real = cvxpy.Problem.solve

    def solve(problem, *arguments, **options):
        warnings.warn("Solution may be inaccurate. Try another solver.", UserWarning, stacklevel=2)
        solves.append(problem)
        return real(problem, *arguments, **options)

    monkeypatch.setattr(cvxpy.Problem, "solve", solve)


def test_what_the_modeller_warns_of_reaches_nobody_in_any_thread(monkeypatch):
    # A UserWarning with a line of a library's source, or a traceback under -W error.
    complaining(monkeypatch, solves := [])
    before = list(warnings.filters)
    sizes = [replace(ZHAO7, nominal=ZHAO7.nominal * scale) for scale in (1.25, 1.5, 1.75, 2.25)]
    with ThreadPoolExecutor(len(sizes)) as pool:
        found = list(pool.map(solve, sizes))
    assert len(solves) == len(sizes)
    assert warnings.filters == before
    for formation, weights in zip(sizes, found, strict=True):
        balance = laplacian(formation, weights) @ formation.nominal
        np.testing.assert_allclose(balance, 0.0, atol=1e-9)


def test_a_solver_that_gives_up_is_said_in_one_line(monkeypatch):
    def give_up(*_, **__):
        raise cvxpy.SolverError("Solver 'CLARABEL' failed.")

    monkeypatch.setattr(cvxpy.Problem, "solve", give_up)
    with pytest.raises(NotRigid, match=r"^the solver found no stress .*: Solver 'CLARABEL' failed\.$"):
        solve(replace(ZHAO7, nominal=ZHAO7.nominal * 1.125))
