"""What pushes the agents about: its covariance between axes, agents and ticks, and what agents know of it."""

from dataclasses import replace

import numpy as np
import pytest
from flying import plan_of

from netem.faults.timeline import Timeline
from world.physics.disturbance import Disturbance, Kernel

Q_D = np.array([[0.04, 0.01], [0.01, 0.02]])
PLACES = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.5], [-4.0, 1.0]])
SHAPES = pytest.mark.parametrize("shape", ["exponential", "squared-exponential"])
WHERE = pytest.mark.parametrize("positions", ["nominal", "true"])
CORRELATED = 'dynamics={covariance=[[4e-4, 1e-4], [1e-4, 2e-4]], kernel={length=2.0, positions="%s"}, persistence=%s}'


def white(runs, *shape):
    return np.random.default_rng(1).normal(size=(runs, *shape))


def assert_covariance(drawn, expected):
    """The covariance of draws (runs, m) is the expected, as well as so many draws can tell."""
    variances = np.diag(expected)
    error = np.sqrt((np.outer(variances, variances) + expected**2) / len(drawn))
    assert np.abs((np.cov(drawn.T) - expected) / error).max() < 4.5


@WHERE
@SHAPES
def test_the_displacements_have_the_covariance_of_agents_by_that_of_axes(shape, positions):
    kernel, elsewhere = Kernel(shape, 2.0, positions), PLACES[::-1] * 7
    nominal, true = (PLACES, elsewhere) if positions == "nominal" else (elsewhere, PLACES)
    runs = 40_000
    pushed = Disturbance(Q_D, kernel, 0.0)
    before, true = np.zeros((runs, 4, 2)), np.broadcast_to(true, (runs, 4, 2))
    drawn = pushed.next(before, pushed.drawn(white(runs, 4, 2), pushed.root(nominal)), true)
    Q_A = kernel.correlation(PLACES)
    assert 0.1 < Q_A[0, 1] < 0.9
    assert_covariance(drawn.reshape(runs, 8), np.kron(Q_A, Q_D))


def test_without_a_kernel_agents_are_pushed_each_by_itself():
    runs = 40_000
    pushed = Disturbance(Q_D, None, 0.0)
    drawn = pushed.next(np.zeros((runs, 4, 2)), pushed.drawn(white(runs, 4, 2), np.eye(4)), white(runs, 4, 2))
    assert_covariance(drawn.reshape(runs, 8), np.kron(np.eye(4), Q_D))


def test_the_kernel_of_eq_4_14_by_hand():
    Q_A = Kernel("exponential", 2.0, "nominal").correlation(np.array([[3.0, 0.0], [0.0, 4.0], [3.0, 1.0]]))
    far, near, across = np.exp(-5 / 2), np.exp(-1 / 2), np.exp(-np.sqrt(18) / 2)
    np.testing.assert_allclose(Q_A, [[1, far, near], [far, 1, across], [near, across, 1]])


def test_the_squared_kernel_by_hand():
    Q_A = Kernel("squared-exponential", 2.0, "nominal").correlation(np.array([[3.0, 0.0], [0.0, 4.0]]))
    np.testing.assert_allclose(Q_A, [[1, np.exp(-25 / 8)], [np.exp(-25 / 8), 1]])


@pytest.mark.parametrize("persistence", [0.0, 0.3, 0.9])
def test_persistence_correlates_successive_ticks_and_leaves_the_covariance(persistence):
    runs, rng = 40_000, np.random.default_rng(1)
    pushed = Disturbance(Q_D, Kernel("exponential", 2.0, "nominal"), persistence)
    now, root = np.zeros((runs, 2, 2)), pushed.root(PLACES[:2])
    for _ in range(60):
        before, now = now, pushed.next(now, pushed.drawn(rng.normal(size=now.shape), root), now)
    both = np.concatenate([before.reshape(runs, 4), now.reshape(runs, 4)], axis=1)
    in_a_tick = np.kron(Kernel("exponential", 2.0, "nominal").correlation(PLACES[:2]), Q_D)
    assert_covariance(both, np.kron([[1, persistence], [persistence, 1]], in_a_tick))


def test_agents_at_one_place_are_pushed_alike_if_it_is_true_places_that_count():
    here = np.array([[5.0, 5.0], [5.0, 5.0], [6.0, 5.0]])[None]
    for positions, alike in (("true", True), ("nominal", False)):
        pushed = Disturbance(Q_D, Kernel("exponential", 2.0, positions), 0.0)
        (drawn,) = pushed.next(np.zeros((1, 3, 2)), pushed.drawn(white(1, 3, 2), pushed.root(PLACES[:3])), here)
        assert np.allclose(drawn[0], drawn[1], atol=1e-5) is alike
        assert not np.allclose(drawn[0], drawn[2], atol=1e-2)


def test_every_swarm_is_pushed_by_its_own_places():
    pushed = Disturbance(Q_D, Kernel("exponential", 2.0, "true"), 0.0)
    drawn, places = pushed.drawn(white(2, 4, 2), pushed.root(PLACES)), np.stack([PLACES, 3 * PLACES])
    together = pushed.next(np.zeros((2, 4, 2)), drawn, places)
    for run in range(2):
        alone = pushed.next(np.zeros((1, 4, 2)), drawn[run : run + 1], places[run : run + 1])
        assert together[run].tobytes() == alone[0].tobytes()


# In the world


def drift(world, ticks):
    """Where agents that command nothing are after so many ticks."""
    quiet = Timeline(world.links, ()).at(0)
    here, measured = world.begin(), []
    for tick in range(ticks):
        measured.append(world.measure(tick, here, quiet))
        here = world.step(tick, here, measured[-1], np.zeros_like(here.position), quiet)
    return here.position, measured


def test_displacements_add_up_to_where_the_agents_are():
    world = plan_of("rigid", CORRELATED % ("nominal", 0.5)).world
    quiet, here = Timeline(world.links, ()).at(0), world.begin()
    after = world.step(0, here, here.measured, np.zeros((10, 2)), quiet)
    later = world.step(1, after, here.measured, np.zeros((10, 2)), quiet)
    np.testing.assert_array_equal(here.disturbance, np.zeros((10, 2)))
    np.testing.assert_allclose(later.position - after.position, later.disturbance, atol=1e-15)
    # The fresh part of a displacement is what it is without persistence, and the rest is what is left of the last.
    fresh = world.step(1, after._replace(disturbance=np.zeros((10, 2))), here.measured, np.zeros((10, 2)), quiet)
    np.testing.assert_allclose(later.disturbance - fresh.disturbance, 0.5 * after.disturbance, atol=1e-15)
    assert (after.disturbance != 0).all()


def test_displacements_of_many_ticks_have_the_covariance_asked_for():
    world = plan_of("rigid", CORRELATED % ("nominal", 0.0)).world
    quiet, here, drawn = Timeline(world.links, ()).at(0), world.begin(), []
    for tick in range(6000):
        here = world.step(tick, here, here.measured, np.zeros((10, 2)), quiet)
        drawn.append(here.disturbance.ravel())
    Q_A = np.exp(-0.5 * np.linalg.norm(world.formation.nominal[:, None] - world.formation.nominal, axis=-1))
    assert_covariance(np.array(drawn), np.kron(Q_A, [[4e-4, 1e-4], [1e-4, 2e-4]]))


@pytest.mark.parametrize("kernel", [{}, {"positions": "nominal"}, {"positions": "true"}], ids=str)
def test_a_disturbance_of_zero_moves_nobody(kernel):
    world = plan_of("rigid", "dynamics={}").world
    assert not world.disturbance.covariance.any()
    if kernel:
        world = replace(world, disturbance=Disturbance(np.zeros((2, 2)), Kernel("exponential", 2.0, **kernel), 0.9))
    begun, (after, _) = world.begin().position, drift(world, 5)
    np.testing.assert_array_equal(after, begun)


def test_a_kernel_and_persistence_move_no_other_draw():
    plain = plan_of("rigid", "dynamics={disturbance=0.02}").world
    for positions in ("nominal", "true"):
        world = plan_of("rigid", CORRELATED % (positions, 0.5)).world
        begun = world.begin()
        np.testing.assert_array_equal(begun.position, plain.begin().position)
        quiet = Timeline(world.links, ()).at(0)
        noise = [[one.measure(tick, begun, quiet) for tick in range(5)] for one in (plain, world)]
        np.testing.assert_array_equal(*noise)
        assert (drift(world, 5)[0] != drift(plain, 5)[0]).all()


# What agents know


def spread(plan):
    """B_i^T Q B_i of every agent, edge by edge from the incidence matrix, in its slots."""
    world, dimension = plan.world, plan.world.formation.dimension
    links, agents = world.links, world.formation.agents
    distance = np.linalg.norm(world.formation.nominal[:, None] - world.formation.nominal, axis=-1)
    Q_A = np.eye(agents) if world.disturbance.kernel is None else np.exp(-distance / world.disturbance.kernel.length)
    Q = np.kron(Q_A, world.disturbance.covariance)
    for agent in range(agents):
        B = np.zeros((agents, links.present.shape[1]))
        for slot in np.flatnonzero(links.present[agent]):
            B[agent, slot], B[links.neighbours[agent, slot], slot] = 1.0, -1.0
        B = np.kron(B, np.eye(dimension))
        yield B.T @ Q @ B


@pytest.mark.parametrize(
    ("name", "dynamics"),
    [
        ("rigid", CORRELATED % ("nominal", 0.0)),
        ("rigid", CORRELATED % ("true", 0.5)),
        ("corridor", "dynamics={disturbance=0.02}"),
        ("ravine", "dynamics={model='double-integrator', disturbance=0.02, kernel={length=3.0}}"),
    ],
    ids=["nominal", "true", "independent", "space"],
)
def test_agents_know_how_the_disturbances_spread_their_edges(name, dynamics):
    plan = plan_of(name, dynamics)
    for row, expected in enumerate(spread(plan)):
        assert expected.any()
        np.testing.assert_allclose(plan.brief.process[row], expected, atol=1e-15)
        np.testing.assert_array_equal(plan.brief.of(row).process, plan.brief.process[row])


def test_agents_know_which_neighbours_lead():
    plan = plan_of("rigid")
    links = plan.world.links
    for row in range(10):
        leading = {int(number) for number in links.neighbours[row, plan.brief.leads[row]] + 1}
        neighbours = {int(number) for number in links.neighbours[row, links.present[row]] + 1}
        assert leading == neighbours & {4, 5, 7}
        assert not plan.brief.leads[row, ~links.present[row]].any()
