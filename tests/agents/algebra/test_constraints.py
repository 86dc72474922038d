"""Maps that keep to a class: exact on it, never a reflection, feasible as Table III and its errata say, and honest."""

from typing import get_args

import numpy as np
import pytest
from briefs import HEXA4, OCTAHEDRON, REST, brief, hears, only, silence, swarm
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from agents.algebra import geometry
from agents.algebra.constraints import MAPS, Constraint
from agents.estimators.conral import ConsensusLocalization
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.ral import THETA, RelativeAffineLocalization
from analysis.models import small
from world.formation.nominal import PRESETS

PLACES = {2: HEXA4, 3: np.ones(3) - OCTAHEDRON}
CLASSES = get_args(Constraint)
factors = st.floats(-3, 3).filter(lambda x: abs(x) > 1e-3)


def turn(rng, dimension):
    if dimension == 3:
        return Rotation.random(rng=rng).as_matrix()
    angle = rng.uniform(-np.pi, np.pi)
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def member(constraint, dimension, rng):
    """A map of the class."""
    return {
        "affine": lambda: rng.normal(size=(dimension, dimension)),
        "scaling": lambda: np.diag(rng.uniform(-3, 3, dimension)),
        "rotation": lambda: turn(rng, dimension),
        "similarity": lambda: rng.uniform(0.1, 5) * turn(rng, dimension),
    }[constraint]()


def determined(constraint, H):
    """Whether neighbours at H (n, D) determine a map, by rank and by the errata."""
    if len(H) == 0:
        return False
    if constraint == "scaling":
        return bool((H != 0).any(axis=0).all())
    return np.linalg.matrix_rank(H) >= H.shape[1] - (constraint != "affine")


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("constraint", CLASSES)
@settings(deadline=None, derandomize=True, database=None, max_examples=150)
@given(st.integers(0, 2**32), st.lists(st.booleans(), min_size=6, max_size=6))
def test_a_fit_is_exact_on_its_own_class_wherever_it_is_feasible(constraint, dimension, seed, seen):
    relative, seen = PLACES[dimension], np.array(seen)
    theta = member(constraint, dimension, np.random.default_rng(seed))
    z = relative @ theta.T
    ral, agent = RelativeAffineLocalization(constraint), brief(relative)
    state, said = ral.sense(agent, ral.init(agent, ()), np.where(seen[:, None], z, 0.0), seen)
    _, estimate = ral.fuse(agent, state, silence(6, dimension), REST)
    assert said[THETA]["feasible"] == estimate.feasible == determined(constraint, relative[seen])
    if estimate.feasible:
        np.testing.assert_allclose(said[THETA]["local"], theta, atol=1e-9)
        np.testing.assert_allclose(estimate.relative, z, atol=1e-9)
        assert estimate.known.all()
    else:
        np.testing.assert_array_equal(said[THETA]["local"], np.zeros_like(theta))
        np.testing.assert_array_equal(estimate.known, seen)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("constraint", ["rotation", "similarity"])
@settings(deadline=None, derandomize=True, database=None, max_examples=100)
@given(st.integers(0, 2**32), st.lists(st.booleans(), min_size=6, max_size=6))
def test_a_fit_is_never_a_reflection_whatever_is_measured(constraint, dimension, seed, seen):
    rng, seen = np.random.default_rng(seed), np.array(seen)
    mirrored = PLACES[dimension] @ np.diag([-1.0, 1.0, 1.0][:dimension])
    for measured in (mirrored, rng.normal(size=(6, dimension))):
        fit = MAPS[constraint].fit(PLACES[dimension], np.where(seen[:, None], measured, 0.0), seen)
        if fit.feasible:
            scale = np.linalg.norm(fit.theta) / np.sqrt(dimension)
            assert np.linalg.det(fit.theta) == pytest.approx(scale**dimension)
            np.testing.assert_allclose(fit.theta @ fit.theta.T, scale**2 * np.eye(dimension), atol=1e-9)
            assert scale > 0
            assert constraint == "similarity" or scale == pytest.approx(1.0)


FEASIBLE = [  # nominal neighbours, and the classes of which they determine a map
    ([[1, 2]], {"scaling", "rotation", "similarity"}),
    ([[1, 0]], {"rotation", "similarity"}),
    ([[1, 0], [-2, 0]], {"rotation", "similarity"}),
    ([[1, 0], [0, 3]], set(CLASSES)),
    ([[0, 0]], set()),
    ([[1, 2, 3]], {"scaling"}),
    ([[1, 2, 3], [-2, -4, -6]], {"scaling"}),
    ([[1, 2, 0], [2, 1, 0]], {"rotation", "similarity"}),
    ([[1, 2, 0], [2, 1, 1]], {"scaling", "rotation", "similarity"}),
    ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], set(CLASSES)),
]


@pytest.mark.parametrize(("relative", "classes"), FEASIBLE)
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_feasibility_is_that_of_table_iii_and_its_errata(relative, classes, size):
    relative = size * np.array(relative, dtype=float)
    seen = (relative != 0).any(axis=-1)
    gram = geometry.gram(relative, seen)
    assert {name for name in CLASSES if MAPS[name].feasible(gram)} == classes


@pytest.mark.parametrize("constraint", CLASSES)
def test_feasibility_is_of_the_nominal_neighbours_not_of_what_is_measured(constraint):
    fit = MAPS[constraint].fit(HEXA4, np.zeros((6, 2)), np.ones(6, dtype=bool))
    assert fit.feasible
    expected = np.eye(2) if constraint == "rotation" else np.zeros((2, 2))
    np.testing.assert_allclose(fit.theta, expected, atol=1e-12)


def test_the_rotation_is_the_best_one_in_space():
    rng = np.random.default_rng(1)
    for _ in range(50):
        relative, measured = rng.normal(size=(2, 5, 3))
        best, _ = Rotation.align_vectors(measured, relative)
        fit = MAPS["rotation"].fit(relative, measured, np.ones(5, dtype=bool))
        np.testing.assert_allclose(fit.theta, best.as_matrix(), atol=1e-9)


def test_the_rotation_is_the_best_one_in_the_plane():
    rng = np.random.default_rng(1)
    angle = np.linspace(0, 2 * np.pi, 3601)
    turns = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
    for _ in range(50):
        relative, measured = rng.normal(size=(2, 3, 2))
        fit = MAPS["rotation"].fit(relative, measured, np.ones(3, dtype=bool))
        miss = [
            ((relative @ np.swapaxes(theta, -1, -2) - measured) ** 2).sum(axis=(-2, -1)) for theta in (fit.theta, turns)
        ]
        assert miss[0] <= miss[1].min() + 1e-12


def test_the_scale_of_a_similarity_is_the_mean_over_the_singular_values_that_are_not_zero():
    # Along the only line seen, lengths are three times the nominal ones; the other singular value is zero and does not count.
    fit = MAPS["similarity"].fit(np.array([[1.0, 0], [2, 0]]), np.array([[0.0, 3], [0, 6]]), np.ones(2, dtype=bool))
    np.testing.assert_allclose(fit.theta, [[0, -3], [3, 0]], atol=1e-12)
    # H = diag(1, 2) and Y = diag(3, 4): singular values in order, so 4/2 and 3/1.
    fit = MAPS["similarity"].fit(np.diag([1.0, 2.0]), np.diag([3.0, 4.0]), np.ones(2, dtype=bool))
    np.testing.assert_allclose(fit.theta, 2.5 * np.eye(2), atol=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("constraint", CLASSES)
@pytest.mark.parametrize("rows", [(0, 1, 4), (1, 2, 3, 5), (4, 5)])
def test_covariance_is_that_of_the_scatter_to_first_order(constraint, dimension, rows):
    rng, relative, seen = np.random.default_rng(1), PLACES[dimension], only(6, *rows)
    root = 0.01 * rng.normal(size=(dimension, dimension))
    noise = root @ root.T + 1e-5 * np.eye(dimension)
    theta, maps = member(constraint, dimension, rng), MAPS[constraint]
    exact = maps.fit(relative, np.where(seen[:, None], relative @ theta.T, 0.0), seen)
    if not exact.feasible:
        assert (constraint, dimension, rows) == ("affine", 3, (4, 5))
        return
    errors = rng.multivariate_normal(np.zeros(dimension), noise, size=(100_000, 6))
    measured = np.where(seen[:, None], relative @ theta.T + errors, 0.0)
    fits = maps.fit(relative, measured, np.broadcast_to(seen, (100_000, 6)))
    scatter = relative @ np.swapaxes(fits.theta, -1, -2)
    said = maps.covariance(exact, relative, noise)
    for edge in range(6):
        assert np.linalg.norm(np.cov(scatter[:, edge].T) - said[edge]) < 0.03 * np.linalg.norm(said[edge])


def test_covariance_of_a_rotation_by_hand():
    # One edge (2, 0) fixes the angle through its second coordinate; the edge (0, 3) then swings along its first.
    fit = MAPS["rotation"].fit(np.array([[2.0, 0]]), np.array([[2.0, 0]]), np.array([True]))
    R = np.array([[0.01, 0.003], [0.003, 0.02]])
    (said,) = MAPS["rotation"].covariance(fit, np.array([[0.0, 3]]), R)
    np.testing.assert_allclose(said, [[0.02 * 9 / 4, 0], [0, 0]], atol=1e-15)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("constraint", CLASSES)
def test_the_nearest_map_of_a_class_is_nearer_than_others_of_it(constraint, dimension):
    rng, maps = np.random.default_rng(1), MAPS[constraint]
    for theta in rng.normal(size=(20, dimension, dimension)):
        nearest = maps.nearest(theta)
        np.testing.assert_allclose(maps.nearest(nearest), nearest, atol=1e-12)
        others = [member(constraint, dimension, rng) for _ in range(100)]
        assert np.linalg.norm(nearest - theta) <= min(np.linalg.norm(other - theta) for other in others)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_rotation_is_u_v_transposed_without_reflection(dimension):
    matrices = np.random.default_rng(1).normal(size=(200, dimension, dimension))
    U, _, Vt = np.linalg.svd(matrices)
    proper = np.linalg.det(U @ Vt) > 0
    found = small.rotation(matrices)
    np.testing.assert_allclose(found[proper], (U @ Vt)[proper], atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
    assert 50 < proper.sum() < 150


@pytest.mark.parametrize("constraint", CLASSES)
def test_a_swarm_that_has_overflown_does_not_end_the_flight(constraint):
    relative = PLACES[3]
    with np.errstate(all="ignore"):
        fit = MAPS[constraint].fit(relative, np.full((6, 3), np.inf), np.ones(6, dtype=bool))
        MAPS[constraint].covariance(fit, relative, np.eye(3))


# In the estimators


@pytest.mark.parametrize("constraint", CLASSES)
@pytest.mark.parametrize("dimension", [2, 3])
def test_conral_agrees_on_the_common_map_of_the_class_and_uses_one_of_it(constraint, dimension):
    rng = np.random.default_rng(1)
    agents, links = swarm(PRESETS["zhao7"]) if dimension == 2 else (brief(np.stack([PLACES[3]] * 4)), None)
    theta = member(constraint, dimension, rng)
    everybody = agents.relative.shape[:1]
    conral = ConsensusLocalization(0.05, constraint)
    state = conral.init(agents, everybody)
    slots = np.argsort(rng.random((4, 6)), axis=-1) % 4 if links is None else links.neighbours
    for tick in range(300):
        noise = 0.3 * rng.normal(size=agents.relative.shape) if tick < 3 else 0.0
        seen = agents.present & (rng.random(agents.present.shape) < 0.9)
        measured = np.where(seen[..., None], agents.relative @ theta.T + noise, 0.0)
        state, said = conral.sense(agents, state, measured, seen)
        heard = hears(agents.present, **{name: field[slots] for name, field in said[THETA].items()})
        state, estimate = conral.fuse(agents, state, heard, REST)
        if tick < 3:
            used = conral._in_use(state.consensus).theta
            np.testing.assert_allclose(MAPS[constraint].nearest(used), used, atol=1e-12)
    np.testing.assert_allclose(
        estimate.relative[agents.present], (agents.relative @ theta.T)[agents.present], atol=1e-5
    )
    np.testing.assert_allclose(estimate.psi, 0.0, atol=1e-9)


def test_what_an_infeasible_conral_does_not_know_is_zero():
    conral, agent = ConsensusLocalization(constraint="rotation"), brief(HEXA4)
    _, estimate = conral.fuse(agent, conral.init(agent, ()), silence(6), REST)
    assert not estimate.known.any()
    np.testing.assert_array_equal(estimate.relative, np.zeros((6, 2)))


def corrected(constraint, penalty=True):
    """An edge never seen, corrected by a shape that was fitted to one neighbour, 0.25 from what a neighbour says."""
    agent, seen = brief([[1, 0], [0, 1], [2, 1]]), only(3, 0)
    ga_rkf = GeometryAwareFilter(geometry="ral", constraint=constraint, penalty=penalty, prior_position=1e4)
    y = np.where(seen[:, None], [[0.0, 1.0], [0, 0], [0, 0]], 0.0)
    fusion, said = ga_rkf.sense(agent, ga_rkf.init(agent, ()), y, seen)
    theirs = np.array([said[THETA]["local"] + [[0.3, 0], [0, 0.4]]] * 3)
    return ga_rkf.fuse(agent, fusion, hears(only(3, 1), local=theirs, feasible=only(3, 0, 1, 2)), REST)[1]


def test_ga_rkf_completes_from_one_neighbour_what_no_affine_map_could():
    assert corrected("affine").known.tolist() == [True, False, False]
    assert not corrected("affine").feasible
    rotated = corrected("rotation")
    assert rotated.known.all()
    assert rotated.feasible
    np.testing.assert_allclose(rotated.relative, [[0, 1], [-1, 0], [-1, 2]], atol=1e-5)


def test_the_penalty_of_ga_rkf_widens_the_geometric_estimate_by_psi_and_only_that():
    on, off = corrected("similarity"), corrected("similarity", penalty=False)
    assert on.psi == off.psi == pytest.approx(0.25)
    np.testing.assert_allclose(on.covariance[0], off.covariance[0])
    np.testing.assert_allclose(on.covariance[1:] - off.covariance[1:], [0.25 * np.eye(2)] * 2, atol=1e-6)


def test_without_the_penalty_an_edge_still_waits_until_psi_is_defined():
    agent, seen = brief(HEXA4), only(6, 0, 1, 2)
    ga_rkf = GeometryAwareFilter(geometry="ral", penalty=False)
    fusion, _ = ga_rkf.sense(agent, ga_rkf.init(agent, ()), np.where(seen[:, None], HEXA4, 0.0), seen)
    np.testing.assert_array_equal(ga_rkf.fuse(agent, fusion, silence(6), REST)[1].known, seen)
