"""What cannot fly is found by the plan, in plain words, before any process starts."""

import pickle
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from affinet.planning import making
from affinet.planning.plan import PlanError
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from agents.algebra import stability
from agents.brief import Own
from agents.estimate import Estimate
from agents.exchange import Heard
from agents.laws import heard_late
from agents.laws.double import DoubleConstantVelocity, DoubleVaryingVelocity
from agents.laws.single import ConstantVelocity, Static, VaryingVelocity
from analysis.models.finding import Finding
from world.formation.nominal import PRESETS
from world.formation.stress import laplacian, solve
from world.physics import bodies


@pytest.fixture(autouse=True)
def no_process(monkeypatch):
    def started(*args, **kwargs):
        raise AssertionError(f"started a process: {args} {kwargs}")

    monkeypatch.setattr(subprocess, "Popen", started)


def make(name, *overrides):
    return making.make(loading.load(name, overrides))


def findings(made):
    return {finding.check: finding for finding in made.findings}


def written(folder, nodes, edges, leaders):
    file = folder / "scenario.toml"
    file.write_text(f"""
        formation = {{ nodes = {nodes}, edges = {edges.split()}, leaders = {leaders} }}
        manoeuvre = {{ preset = "hover" }}
        time = {{ dt = 0.01, duration = 1.0 }}
        sensing = {{ sigma = 0.1 }}
        agents = {{ estimator = "none", law = "static" }}
    """)
    return str(file)


@pytest.fixture(scope="module")
def shipped():
    return {name: make(name) for name in loading.shipped()}


# What flies


def test_every_shipped_scenario_can_fly(shipped):
    assert {"corridor", "hexa", "partition", "ravine", "switching"} <= set(shipped)
    noted = {(name, found.check) for name, made in shipped.items() for found in made.findings if found.level != "ok"}
    phases = {
        ("switching", "phase 28 s"),
        ("switching", "phase 44 s"),
        ("partition", "phase 8 s"),
        ("partition", "phase 18 s"),
    }
    assert noted == {("target", "REDCHO")} | phases


def test_the_plan_of_the_corridor_says_what_was_checked(shipped):
    found = findings(shipped["corridor"])
    assert found["graph"].says == "7 agents, 12 undirected edges, algebraic connectivity 2.325"
    assert found["leaders"].says == "leaders [1, 2, 3] span the plane"
    assert found["rigidity"].says == "universally rigid: stress eigenvalues 0.3383 to 1.4432"
    assert found["followers"].says == "follower block eigenvalues 0.0235 to 0.9593"
    assert found["one-tick radius"].says.startswith("0.932 < 1")
    assert found["step"].says.startswith("radius 0.990048 < 1 at dt 0.01 s, gain 1: settles to 1/e in 1.00 s")


def test_the_brief_of_the_corridor_flies_twice_zhao7(shipped):
    brief = shipped["corridor"].brief
    np.testing.assert_array_equal(brief.nominal, 2 * PRESETS["zhao7"].nominal)
    assert brief.relative.shape == (7, 4, 2)
    np.testing.assert_array_equal(brief.relative[1, :3], 2 * np.array([[-1, 1], [1, 0], [2, 2]]))  # 2 of 1, 4, 7
    np.testing.assert_array_equal(brief.relative[~brief.present], 0.0)


def test_the_brief_holds_the_stress_of_every_edge(shipped):
    brief = shipped["corridor"].brief
    expected = np.array([4, 4, -2, -2]) / np.sqrt(213)  # 12, 13, 14, 15
    np.testing.assert_allclose(brief.stress[0], expected, atol=1e-6)
    np.testing.assert_array_equal(brief.stress[~brief.present], 0.0)
    np.testing.assert_allclose((brief.stress[..., None] * brief.relative).sum(axis=1), 0.0, atol=1e-12)


# What does not


def test_a_disconnected_graph_cannot_fly(tmp_path):
    nodes = [[0, 0], [1, 0], [1, 1], [0, 1], [5, 0], [6, 0], [6, 1], [5, 1]]
    edges = "1-2 1-3 1-4 2-3 2-4 3-4 5-6 5-7 5-8 6-7 6-8 7-8"
    with pytest.raises(PlanError, match=re.escape("disconnected: agents [5, 6, 7, 8] cannot be reached from agent 1")):
        make(written(tmp_path, nodes, edges, [1, 2, 3]))


@pytest.mark.parametrize("leaders", ["[1, 2]", "[4, 6]", "[]", "[2, 4, 6]", "[1, 2, 2]"])
def test_leaders_that_do_not_span_cannot_lead(leaders):
    with pytest.raises(PlanError, match="do not span: an affine map of 2 dimensions needs 3 leaders"):
        make("corridor", f"formation.leaders={leaders}")


def test_leaders_in_a_plane_of_space_cannot_lead(tmp_path):
    nodes = [[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]
    edges = " ".join(f"{i}-{j}" for i in range(1, 7) for j in range(i + 1, 7))
    assert findings(make(written(tmp_path, nodes, edges, [1, 2, 3, 4])))["leaders"].level == "ok"
    with pytest.raises(PlanError, match="needs 4 leaders that lie on no common plane"):
        make(written(tmp_path, nodes, edges, [1, 2, 4, 5]))


def test_somebody_must_follow():
    with pytest.raises(PlanError, match="nobody is left to follow"):
        make("corridor", "formation.leaders=[1, 2, 3, 4, 5, 6, 7]")


def test_a_framework_with_too_few_edges_cannot_fly(tmp_path):
    nodes = PRESETS["zhao7"].nominal.tolist()
    with pytest.raises(PlanError, match=r"rigidity: .*add edges"):
        make(written(tmp_path, nodes, "1-2 1-3 1-4 1-5 2-4 2-7 3-5 3-6 4-5 4-6 5-7", [1, 2, 3]))


def test_a_framework_that_folds_cannot_fly(tmp_path):
    nodes = [[-2, 0], [-1, 2], [0, 0], [0, 3], [1, 2.5], [2, -0.5]]
    with pytest.raises(PlanError, match="rigidity: the framework is not universally rigid"):
        make(written(tmp_path, nodes, "1-2 1-3 1-4 2-3 2-4 3-4 3-5 3-6 4-5 4-6 5-6", [1, 2, 3]))


@pytest.mark.parametrize("edges", ["1-2 1-3 1-4 2-3 2-4 3-4 2-1", "1-2 1-3 1-4 2-3 2-4 3-4 3-3"])
def test_an_edge_named_twice_or_from_an_agent_to_itself_is_refused(tmp_path, edges):
    with pytest.raises(PlanError, match=r"every edge joins two agents, once; look at (1-2|3-3)"):
        make(written(tmp_path, [[0, 0], [1, 0], [1, 1], [0, 1]], edges, [1, 2, 3]))


@pytest.mark.parametrize("key", ["leaders=[1, 2, 9]", "leaders=[0, 1, 2]"])
def test_agents_that_do_not_exist_cannot_lead(key):
    with pytest.raises(ScenarioError, match=re.escape("formation.leaders: no agents")):
        make("corridor", f"formation.{key}")


@pytest.mark.parametrize(
    ("law", "gains", "dt"),
    [
        # The largest follower eigenvalue is 0.9593: the step holds for gains below 2 / (0.01 * 0.9593) = 208.5.
        ("static", {"alpha": 209.0}, 0.01),
        ("static", {"alpha": 20.9}, 0.1),
        ("constant-velocity", {"alpha": 209.0}, 0.01),
        ("constant-velocity", {"alpha": 10.0, "eta": 400.0}, 0.01),
        ("varying-velocity", {"alpha": 10.0}, 1.0),
        ("double-constant-velocity", {"velocity_gain": 209.0}, 0.01),
        # Damping must exceed half a tick of the pull, 15.
        ("double-constant-velocity", {"position_gain": 3000.0, "velocity_gain": 14.0}, 0.01),
        ("double-varying-velocity", {"position_gain": 25.0, "velocity_gain": 20.0}, 0.01),
    ],
)
def test_a_step_too_long_for_the_gains_cannot_fly(law, gains, dt):
    overrides = [f"agents.parameters.{law}.{name}={value}" for name, value in gains.items()]
    if law.startswith("double"):
        overrides.append("dynamics.model=double-integrator")
    with pytest.raises(PlanError, match=r"step: radius \d+\.\d+ >= 1 .* the step is too long for the gains"):
        make("switching", f"agents.law={law}", f"time.dt={dt}", *overrides)


@pytest.mark.parametrize(("alpha", "dt"), [(208.0, 0.01), (20.8, 0.1)])
def test_a_step_just_short_enough_can_fly(alpha, dt):
    made = make("switching", "agents.law=static", f"time.dt={dt}", f"agents.parameters.static.alpha={alpha}")
    assert findings(made)["step"].level == "ok"


@pytest.mark.parametrize(("pull", "damping"), [(10.0, 208.0), (3000.0, 16.0)])
def test_a_step_just_short_enough_for_double_integrators_can_fly(pull, damping):
    gains = f"{{position_gain={pull}, velocity_gain={damping}}}"
    law = ("agents.law=double-constant-velocity", f"agents.parameters.double-constant-velocity={gains}")
    made = make("switching", "dynamics.model=double-integrator", *law)
    assert findings(made)["step"].level == "ok"


# Velocities heard one tick late


def test_velocities_heard_one_tick_late_settle_on_zhao7(shipped):
    assert findings(shipped["corridor"])["one-tick radius"].says.startswith("0.932 < 1")


def test_velocities_heard_one_tick_late_settle_on_hexa10_behind_its_own_leaders(shipped):
    assert findings(shipped["hexa"])["one-tick radius"].says.startswith("0.873 < 1")


def test_velocities_heard_one_tick_late_diverge_on_hexa10_behind_leaders_4_5_7():
    with pytest.raises(PlanError, match=re.escape("1.327 >= 1") + r".*relaxation = 0\.85 settles"):
        make("hexa", "formation.leaders=[4, 5, 7]")


def test_relaxation_below_the_suggested_bound_mends_it_and_above_does_not():
    relaxation = "agents.parameters.varying-velocity.relaxation"
    made = make("hexa", "formation.leaders=[4, 5, 7]", f"{relaxation}=0.84")
    assert findings(made)["one-tick radius"].says.startswith("0.95")
    with pytest.raises(PlanError, match=r"one-tick radius: 1\.00\d >= 1"):
        make("hexa", "formation.leaders=[4, 5, 7]", f"{relaxation}=0.861")


def test_feeding_velocities_forward_mends_it():
    made = make("hexa", "formation.leaders=[4, 5, 7]", "agents.parameters.varying-velocity.source=feed-forward")
    assert "no loop through the network" in findings(made)["one-tick radius"].says


def test_other_laws_have_no_loop_through_the_network():
    assert "one-tick radius" not in findings(make("hexa", "formation.leaders=[4, 5, 7]", "agents.law=static"))


# Consensus


@pytest.mark.parametrize("estimator", ["conral", "ga-rkf"])
@pytest.mark.parametrize("preset", ["zhao7", "hexa10"])
def test_epsilon_must_be_below_the_bound_of_the_consensus(estimator, preset):
    formation = PRESETS[preset]
    degree = np.bincount(np.ravel(formation.edges))[1:]
    adjacency = np.zeros((formation.agents, formation.agents))
    for i, j in formation.edges:
        adjacency[i - 1, j - 1] = adjacency[j - 1, i - 1] = 1
    bound = 2 / (np.linalg.eigvalsh(np.diag(degree) - adjacency)[-1] + degree.max() + 1)
    given = [f"formation={{preset={preset!r}}}", f"agents.estimator={estimator}", "agents.law=static"]
    epsilon = f"agents.parameters.{estimator}.epsilon"
    assert (
        f"below the bound {bound:.4f}" in findings(make("hexa", *given, f"{epsilon}={0.99 * bound}"))["consensus"].says
    )
    with pytest.raises(PlanError, match=f"not below the bound {bound:.4f}: the consensus .14. diverges"):
        make("hexa", *given, f"{epsilon}={1.01 * bound}")


def test_epsilon_02_diverges_on_zhao7():
    with pytest.raises(PlanError, match=re.escape("epsilon 0.2 is not below the bound 0.1783")):
        make("corridor", "agents.parameters.ga-rkf.epsilon=0.2")


def test_epsilon_of_a_geometry_that_does_not_use_it_is_not_checked():
    given = ("agents.parameters.ga-rkf.geometry=ral", "agents.parameters.ga-rkf.epsilon=0.2")
    assert findings(make("corridor", *given)).get("consensus") is None


# Timeline


def test_a_fault_after_the_end_of_the_run_is_noted():
    late = [found for found in make("switching", "time.duration=30.0").findings if found.check == "timeline"]
    assert {note.level for note in late} == {"note"}
    says = "'depart 7' starts at 44 s, and the run ends at 30 s: it will touch nothing, and the run will be vacuous"
    assert says in {note.says for note in late}


# Everything that is wrong at once


def test_all_that_is_fatal_is_said_at_once_and_nothing_else():
    with pytest.raises(PlanError) as caught:
        make("hexa", "formation.leaders=[4, 5, 7]", "agents.parameters.ga-rkf.epsilon=0.5")
    assert {finding.check for finding in caught.value.findings if finding.fatal} >= {"one-tick radius", "consensus"}
    assert "connected" not in str(caught.value)


# The radii against what the laws do


def tick_of(made, law, state, position, own):
    """One tick of the followers under the law itself, leaders at rest and estimates perfect."""
    brief, links = made.brief, made.world.links
    apart, closing = (rows[:, None] - rows[links.neighbours] for rows in (position, own.velocity))
    estimate = Estimate(apart, brief.present, np.zeros((*apart.shape, 2)), np.zeros(links.agents), closing)
    said = {"velocity": own.velocity[links.neighbours], "acceleration": own.input[links.neighbours]}
    state, flown = law.command(brief, state, 0, own, estimate, Heard(said, brief.present))
    flown = np.where(brief.leader[:, None], 0.0, flown)
    if law.order == 1:
        return state, bodies.carried([position, flown], brief.dt), Own(flown, flown)
    position = bodies.carried([position, own.velocity, flown], brief.dt)
    return state, position, Own(own.velocity + brief.dt * flown, flown)


def at_rest(made):
    return Own(*np.zeros((2, *made.brief.nominal.shape)))


def follower_block(made):
    formation, followers = made.world.formation, ~made.brief.leader
    L = laplacian(formation, solve(formation))
    return L[np.ix_(followers, followers)], np.diag(L)[followers]


LAWS = [
    (Static(alpha=150.0), True),
    (Static(alpha=215.0), False),
    (ConstantVelocity(alpha=100.0, eta=5.0), True),
    (ConstantVelocity(alpha=205.0, eta=10.0), False),
    (VaryingVelocity(alpha=3.0), True),
    (VaryingVelocity(alpha=20.0), False),
    (VaryingVelocity(alpha=5.0, relaxation=0.5), True),
    (VaryingVelocity(alpha=5.0, source="estimated"), True),
    (VaryingVelocity(alpha=100.0, source="feed-forward"), True),
    (VaryingVelocity(alpha=110.0, source="feed-forward"), False),
    (DoubleConstantVelocity(position_gain=300.0, velocity_gain=150.0), True),
    (DoubleConstantVelocity(position_gain=300.0, velocity_gain=215.0), False),
    # Damped, but less than the step needs.
    (DoubleConstantVelocity(position_gain=3000.0, velocity_gain=10.0, source="estimated"), False),
    (DoubleVaryingVelocity(position_gain=4.0, velocity_gain=4.0), True),
    (DoubleVaryingVelocity(position_gain=25.0, velocity_gain=20.0), False),
    (DoubleVaryingVelocity(position_gain=25.0, velocity_gain=20.0, relaxation=0.5), True),
    (DoubleVaryingVelocity(position_gain=3000.0, velocity_gain=10.0, source="estimated"), False),
]


def carried(law, offset, own, state):
    """What a tick hands to the next."""
    match law:
        case ConstantVelocity():
            return offset, state.force
        case VaryingVelocity():
            return offset, own.input
        case DoubleConstantVelocity():
            return offset, own.velocity
        case DoubleVaryingVelocity():
            return offset, own.velocity, own.input
    return (offset,)


@pytest.fixture(scope="module")
def hovering():
    return make("switching", "manoeuvre={preset='hover'}")


@pytest.mark.parametrize("law", [law for law, _ in LAWS], ids=str)
def test_the_step_matrix_is_one_tick_of_the_law(law, hovering):
    rng, nominal = np.random.default_rng(1), hovering.brief.nominal
    offset, velocity, force = np.where(hovering.brief.leader[:, None], 0.0, rng.normal(size=(3, 7, 2)))
    state = law.init(hovering.brief, (7,))
    if isinstance(law, ConstantVelocity):
        state = state._replace(force=force)
    own = Own(velocity, velocity if law.order == 1 else force)
    before = carried(law, offset, own, state)
    state, position, own = tick_of(hovering, law, state, nominal + offset, own)
    after = carried(law, position - nominal, own, state)
    step = law.step_matrix(*follower_block(hovering), 0.01)
    np.testing.assert_allclose(step @ np.concatenate([x[3:] for x in before]), np.concatenate([x[3:] for x in after]))


@pytest.mark.parametrize(("law", "settles"), LAWS, ids=str)
def test_a_formation_settles_when_the_radius_of_its_step_is_below_one(law, settles, hovering):
    position = np.where(hovering.brief.leader[:, None], 0.0, np.random.default_rng(1).normal(size=(7, 2)))
    position, own = position + hovering.brief.nominal, at_rest(hovering)
    state = law.init(hovering.brief, (7,))
    for _ in range(600):
        state, position, own = tick_of(hovering, law, state, position, own)
    off = np.abs(position - hovering.brief.nominal).max()
    assert off < 0.05 if settles else off > 1e3
    assert (stability.radius(law.step_matrix(*follower_block(hovering), 0.01)) < 1) == settles


@pytest.mark.parametrize(
    ("leaders", "relaxation", "settles"),
    [("[2, 6, 8]", 1.0, True), ("[4, 5, 7]", 1.0, False), ("[4, 5, 7]", 0.8, True)],
)
def test_leaders_and_relaxation_decide_whether_velocities_heard_late_settle(leaders, relaxation, settles):
    made = make("hexa", "manoeuvre={preset='hover'}", f"formation.leaders={leaders}", "agents.law=static")
    law = VaryingVelocity(alpha=1.0, relaxation=relaxation)
    position = np.where(made.brief.leader[:, None], 0.0, np.random.default_rng(1).normal(size=(10, 2)))
    position, own, state = position + made.brief.nominal, at_rest(made), law.init(made.brief, (10,))
    for _ in range(600):
        state, position, own = tick_of(made, law, state, position, own)
    off = np.abs(position - made.brief.nominal).max()
    assert off < 0.05 if settles else off > 1e3
    assert (heard_late.one_tick_radius(*follower_block(made), relaxation) < 1) == settles


@pytest.mark.parametrize("relaxation", [1.0, 0.9, 0.5])
@pytest.mark.parametrize(
    # Without a pull, the law only repeats what it hears.
    "idle",
    [VaryingVelocity(alpha=0.0), DoubleVaryingVelocity(position_gain=0.0, velocity_gain=0.0)],
    ids=["velocity", "acceleration"],
)
def test_the_one_tick_radius_is_the_rate_of_the_iteration_of_inputs(idle, relaxation, shipped):
    law, made = replace(idle, relaxation=relaxation), shipped["hexa"]
    flown = np.where(made.brief.leader[:, None], 0.0, np.random.default_rng(1).normal(size=(10, 2)))
    state, own, size = law.init(made.brief, (10,)), Own(flown, flown), []
    for _ in range(400):
        state, _, own = tick_of(made, law, state, made.brief.nominal, own)
        size.append(np.linalg.norm(own.input))
    rate = (size[399] / size[299]) ** (1 / 100)
    assert rate == pytest.approx(heard_late.one_tick_radius(*follower_block(made), relaxation), abs=1e-4)


def test_what_a_finding_says_stays_on_one_line_of_plain_text_wherever_it_goes():
    said = PlanError([Finding("mine", "error", "a line\nand \x1b[31mred\udc80"), Finding("mine", "note", "not this")])
    assert str(said) == r"mine: a line\nand \x1b[31mred\udc80"
    again = pickle.loads(pickle.dumps(said))
    assert (str(again), again.findings) == (str(said), said.findings)


REAL = 'time.mode="real"'


@pytest.mark.parametrize(
    ("overrides", "ticks"),
    [
        (("time.dt=0.05",), 20),
        (("time.dt=0.01",), 50),
        (("time.dt=0.05", REAL), 5),
        (("time.dt=0.05", REAL, "time.real.factor=0.5"), 2),
        (("time.dt=0.05", REAL, "time.real.factor=0.1"), 1),
    ],
)
def test_at_most_a_second_is_written_at_once_and_less_where_it_takes_longer_to_arrive(overrides, ticks):
    assert make("corridor", *overrides).books(None).batch == ticks
