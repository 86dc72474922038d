"""The property of the house: a batch of agents, or of runs, gives bit for bit what each gives alone."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from affinet.planning import making
from affinet.scenario import loading
from agents.agent import Agent
from agents.algebra import missed_ticks
from agents.estimators.conral import ConsensusLocalization
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.ga_rkf import GeometryAwareFilter
from agents.estimators.imm import InteractingMultipleModel
from agents.estimators.joint_kf import JointEdgeFilter
from agents.estimators.jor import JacobiOverRelaxation
from agents.estimators.mmse import MinimumMeanSquareError
from agents.estimators.none import NoEstimator
from agents.estimators.ral import RelativeAffineLocalization
from agents.estimators.rkf import RelativeKalmanFilter
from agents.estimators.silent import SilentEdgeFilter
from agents.exchange import Heard
from agents.laws.double import DoubleConstantVelocity, DoubleVaryingVelocity
from agents.laws.single import ConstantVelocity, Rest, Static, VaryingVelocity
from analysis.models.arrays import chosen
from netem.core.channels import INPUT

TICKS, RUNS, LATE = 10, 3, 3

ESTIMATORS = {
    "none": NoEstimator(),
    "rkf": RelativeKalmanFilter(),
    "ral": RelativeAffineLocalization(),
    "conral": ConsensusLocalization(),
    "ga-rkf-ral": GeometryAwareFilter(geometry="ral"),
    "ga-rkf-conral": GeometryAwareFilter(geometry="conral"),
    "ral-scaling": RelativeAffineLocalization("scaling"),
    "ral-rotation": RelativeAffineLocalization("rotation"),
    "ral-similarity": RelativeAffineLocalization("similarity"),
    "conral-scaling": ConsensusLocalization(constraint="scaling"),
    "conral-rotation": ConsensusLocalization(constraint="rotation"),
    "conral-similarity": ConsensusLocalization(constraint="similarity"),
    "ga-rkf-ral-rotation": GeometryAwareFilter(geometry="ral", constraint="rotation", penalty=False),
    "ga-rkf-conral-similarity": GeometryAwareFilter(constraint="similarity"),
    "rkf-constant-velocity": RelativeKalmanFilter(model="constant-velocity"),
    "ga-rkf-conral-random-walk": GeometryAwareFilter(model="random-walk"),
    "imm": InteractingMultipleModel(),
    "mmse": MinimumMeanSquareError(),
    "edge-kf": EdgeKalmanFilter(coefficients=(0.8, -0.1), sigma_n=0.1),
    "joint-kf": JointEdgeFilter(coefficients=(0.8, -0.1), sigma_n=0.1),
    "silent-kf": SilentEdgeFilter(window=3),
    "jor": JacobiOverRelaxation(),
}
LAWS = {
    "rest": Rest(),
    "static": Static(),
    "constant-velocity": ConstantVelocity(),
    "communicated": VaryingVelocity(relaxation=0.7),
    "estimated": VaryingVelocity(source="estimated"),
    "feed-forward": VaryingVelocity(source="feed-forward"),
    "double-constant-velocity": DoubleConstantVelocity(),
    "double-communicated": DoubleVaryingVelocity(relaxation=0.7),
    "double-estimated": DoubleVaryingVelocity(source="estimated"),
}
LIMIT = 4.0  # m/s2; it bites in some of the ticks
PLAIN = ("none", "rkf", "ral", "conral", "ga-rkf-ral", "ga-rkf-conral")  # with every law; their variants with one
PAIRS = [
    (estimator, law)
    for estimator in ESTIMATORS
    for law in LAWS
    if ("estimated" not in law or "rkf" in estimator) and (estimator in PLAIN or law == "constant-velocity")
]

# An octahedron with its diagonals, and a seventh agent tied to four of them.
SPACE = f"""
[formation]
nodes = [[2, 0, 0], [0, 2, 0], [0, 0, 2], [-2, 0, 0], [0, -2, 0], [0, 0, -2], [1.5, 2.5, 3.5]]
edges = {[f"{i}-{j}" for i, j in combinations(range(1, 7), 2)] + ["1-7", "2-7", "3-7", "4-7"]}
leaders = [1, 2, 3, 4]
[manoeuvre]
keyframes = [
    {{ time = 0.0, theta = [[1, 0, 0], [0, 1, 0], [0, 0, 1]], offset = [0, 0, 0] }},
    {{ time = 1.0, theta = [[0, 1, 0], [-1, 0, 0.5], [0, 0.2, 1]], offset = [3, 1, -2] }},
]
[time]
dt = 0.01
duration = 1.0
[dynamics]
disturbance = 0.01
kernel = {{ length = 2.0 }}
[sensing]
covariance = [[0.01, 0.003, 0.0], [0.003, 0.01, -0.001], [0.0, -0.001, 0.02]]
[agents]
estimator = "none"
law = "static"
"""


@pytest.fixture(scope="module")
def plans(tmp_path_factory):
    """A formation in the plane, and one in space; their agents differ in degree, at most 8, so there is padding."""
    file = tmp_path_factory.mktemp("scenarios") / "space.toml"
    file.write_text(SPACE)
    return {
        2: making.make(
            loading.load(
                "hexa",
                [
                    "sensing={covariance=[[0.01, 0.003], [0.003, 0.02]]}",
                    "dynamics={disturbance=0.01, kernel={length=2.0}}",
                ],
            )
        ),
        3: making.make(loading.load(str(file))),
    }


def agent_of(plan, estimator, law):
    limit = LIMIT if LAWS[law].order == 2 else None
    brief = replace(plan.brief, lateness=LATE, persistence=0.6)
    return Agent(brief, ESTIMATORS[estimator], LAWS[law], leaders="pilot", leader_gain=1.0, limit=limit)


def draw(agent, links, seed, lead):
    """What reaches the agents in every tick: measured, seen, heard from whom, own position and velocity."""
    rng, dimension = np.random.default_rng(seed), agent.brief.dimension
    slots = (TICKS, *lead, *links.present.shape)
    seen, fresh = rng.random((2, *slots)) < 0.7
    seen, fresh = seen & links.present, fresh & links.present
    measured = agent.brief.relative + 0.1 * rng.normal(size=(*slots, dimension))
    position, velocity = rng.normal(size=(2, TICKS, *lead, links.agents, dimension))
    return np.where(seen[..., None], measured, 0.0), seen, fresh, position, velocity


def odometry(agent, velocity):
    return velocity[..., None, :] if agent.law.order == 2 else None


def leaves(value):
    """Every array in a state, an action or a broadcast, in order."""
    if isinstance(value, Mapping):
        return [leaf for name in sorted(value) for leaf in leaves(value[name])]
    if isinstance(value, tuple | list):
        return [leaf for entry in value for leaf in leaves(entry)]
    return [] if value is None else [np.asarray(value)]


def gather(said, neighbours, fresh):
    """What everybody hears of what everybody said, (..., agents, n, *field)."""
    agents = fresh.ndim - 2
    heard = {}
    for channel, fields in said.items():
        spread = {name: np.take(field, neighbours, axis=agents) for name, field in fields.items()}
        heard[channel] = Heard(spread, fresh, np.where(fresh, np.indices(fresh.shape)[-2:].sum(axis=0) % LATE, 0))
    return heard


def row_of(heard, index):
    return {
        c: Heard({n: f[index] for n, f in h.fields.items()}, h.fresh[index], h.age[index]) for c, h in heard.items()
    }


def fly_together(agent, links, measured, seen, fresh, position, velocity):
    """A batch, and what each of its agents heard in every tick."""
    state, ticks = agent.init(fresh.shape[1:-1]), []
    for tick in range(TICKS):
        told = odometry(agent, velocity[tick])
        state, said = agent.sense(state, tick, measured[tick], seen[tick], told)
        heard = gather(said, links.neighbours, fresh[tick])
        state, action = agent.act(state, tick, heard, position[tick], told, None)
        ticks.append((said, heard, action, state))
    return ticks


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("estimator", "law"), PAIRS)
def test_a_batch_of_agents_gives_the_bits_of_each_agent_alone(estimator, law, dimension, plans):
    everybody, links = agent_of(plans[dimension], estimator, law), plans[dimension].world.links
    measured, seen, fresh, position, velocity = draw(everybody, links, 1, ())
    together = fly_together(everybody, links, measured, seen, fresh, position, velocity)
    for row in range(links.agents):
        alone = replace(everybody, brief=everybody.brief.of(row))
        state = alone.init(())
        for tick, (all_said, all_heard, all_action, all_state) in enumerate(together):
            told = odometry(alone, velocity[tick, row])
            state, said = alone.sense(state, tick, measured[tick, row], seen[tick, row], told)
            state, action = alone.act(state, tick, row_of(all_heard, row), position[tick, row], told, None)
            for one, many in zip(leaves((said, action, state)), leaves((all_said, all_action, all_state)), strict=True):
                assert one.shape == many[row].shape
                assert one.tobytes() == many[row].tobytes()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize(("estimator", "law"), PAIRS)
def test_a_batch_of_runs_gives_the_bits_of_each_run_alone(estimator, law, dimension, plans):
    agent, links = agent_of(plans[dimension], estimator, law), plans[dimension].world.links
    drawn = draw(agent, links, 2, (RUNS,))
    together = fly_together(agent, links, *drawn)
    for run in range(RUNS):
        alone = fly_together(agent, links, *(array[:, run] for array in drawn))
        for one, many in zip(leaves(alone), leaves(together), strict=True):
            assert one.shape == many[run].shape
            assert one.tobytes() == many[run].tobytes()


def test_what_is_compared_is_no_constant(plans):
    agent, links = agent_of(plans[2], "ga-rkf-conral", "communicated"), plans[2].world.links
    (_, _, _, first), *_, (_, heard, action, last) = fly_together(agent, links, *draw(agent, links, 1, ()))
    nis = last.estimator.tracks.nis  # NaN where nothing was measured
    assert np.isfinite(nis).any()
    assert all(np.isfinite(leaf).all() for leaf in leaves(last) if leaf is not nis)
    assert not np.isclose(first.estimator.tracks.mean, last.estimator.tracks.mean)[links.present].all(axis=-1).any()
    assert np.isfinite(action.estimate.psi).any()
    assert len(np.unique(action.input)) == action.input.size
    assert not heard["theta"].fresh[links.present].all()
    assert not links.present.all()


def test_the_limit_bites_in_some_ticks_and_in_others_not(plans):
    agent, links = agent_of(plans[2], "rkf", "double-communicated"), plans[2].world.links
    flown = [action.input for _, _, action, _ in fly_together(agent, links, *draw(agent, links, 1, ()))]
    shortened = np.isclose(np.linalg.norm(flown, axis=-1), LIMIT, rtol=1e-12)
    assert 0.2 < shortened[:, agent.brief.leader].mean() < 0.8
    assert 0.2 < shortened[:, ~agent.brief.leader].mean() < 0.8


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_restarted_agent_is_a_fresh_one_and_the_others_go_on(estimator, plans):
    agent, links = agent_of(plans[2], estimator, "constant-velocity"), plans[2].world.links
    *_, (_, _, _, flown) = fly_together(agent, links, *draw(agent, links, 1, ()))
    restarted, new = np.arange(10) == 4, agent.init((10,))
    for now, fresh, before in zip(leaves(chosen(restarted, new, flown)), leaves(new), leaves(flown), strict=True):
        assert now[restarted].tobytes() == fresh[restarted].tobytes()
        assert now[~restarted].tobytes() == before[~restarted].tobytes()


@pytest.mark.parametrize("sigma_n", [0.0, 0.1])
@pytest.mark.parametrize("kind", [EdgeKalmanFilter, JointEdgeFilter])
def test_a_batch_in_which_some_began_anew_gives_the_bits_of_each_agent_alone(kind, sigma_n, plans, monkeypatch):
    """What is heard late takes those back who were there, and nobody beyond his own beginning."""
    monkeypatch.setitem(ESTIMATORS, "anew", kind(coefficients=(0.8,), sigma_n=sigma_n))
    everybody, links = agent_of(plans[2], "anew", "constant-velocity"), plans[2].world.links
    measured, seen, fresh, position, _ = draw(everybody, links, 1, ())
    begins = np.arange(links.agents) % 4 * 2  # in which tick each of them does, for the first or the second time
    late = (np.arange(links.agents) % 3 == 0)[:, None]  # who hears anything late

    def flown(agent, rows, of_all):
        state, ticks = agent.init(begins[rows].shape), []
        for tick in range(TICKS):
            state = chosen(begins[rows] == tick, agent.init(begins[rows].shape), state)
            state, said = agent.sense(state, tick, measured[tick][rows], seen[tick][rows], None)
            if of_all is None:
                heard = gather(said, links.neighbours, fresh[tick])
                heard = {name: each._replace(age=np.where(late, each.age, 0)) for name, each in heard.items()}
            else:
                heard = row_of(of_all[tick][0], rows)
            state, action = agent.act(state, tick, heard, position[tick][rows], None, None)
            ticks.append((heard, action, state))
        return ticks

    together = flown(everybody, np.arange(links.agents), None)
    assert max(heard[INPUT].age.max() for heard, _, _ in together) >= 2
    for row in range(links.agents):
        alone = flown(replace(everybody, brief=everybody.brief.of(row)), row, together)
        for (_, action, state), (_, all_action, all_state) in zip(alone, together, strict=True):
            for one, many in zip(leaves((action, state)), leaves((all_action, all_state)), strict=True):
                assert one.tobytes() == many[row].tobytes()


MISSING = ("rkf", "ga-rkf-conral", "imm", "edge-kf", "joint-kf", "silent-kf", "conral")


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("estimator", MISSING)
def test_a_batch_in_which_some_missed_ticks_gives_the_bits_of_each_agent_alone(
    estimator, dimension, plans, monkeypatch
):
    monkeypatch.setattr(missed_ticks, "LONGEST", 3)
    everybody, links = agent_of(plans[dimension], estimator, "constant-velocity"), plans[dimension].world.links
    measured, seen, fresh, position, velocity = draw(everybody, links, 1, ())
    *_, (_, _, _, last) = fly_together(everybody, links, measured, seen, fresh, position, velocity)
    rows = np.arange(links.agents)
    gaps, held = rows % 5, rows % 3 == 0

    def goes_on(agent, state, row):
        return agent.sense(state, TICKS, measured[-1][row], seen[-1][row], None)

    state = last._replace(sensed=last.sensed - gaps, held=held)
    together, said = goes_on(everybody, state, slice(None))
    at_once, _ = goes_on(everybody, last._replace(held=held), slice(None))
    for row in range(links.agents):
        single, told = goes_on(replace(everybody, brief=everybody.brief.of(row)), _row(state, row), row)
        for one, many in zip(leaves((told, single)), leaves((said, together)), strict=True):
            assert one.tobytes() == many[row].tobytes()
        pairs = zip(leaves(together.estimator), leaves(at_once.estimator), strict=True)
        assert all(now[row].tobytes() == then[row].tobytes() for now, then in pairs) == (gaps[row] == 0)


def _row(part, row):
    return type(part)(*(_row(each, row) for each in part)) if isinstance(part, tuple) else part[row]
