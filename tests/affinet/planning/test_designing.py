"""What `affinet design` writes can fly; weights of one's own are checked before anything does."""

import numpy as np
import pytest
from extremes import BASES

from affinet.planning import designing, making
from affinet.planning.plan import PlanError
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from world.formation import layouts

# The stress of zhao7, in the order of its edges.
WEIGHTS = BASES["weights"]["formation"]["weights"]


def findings(given):
    return {finding.check: finding for finding in making.make(given).findings}


def weighed(weights, **formation):
    base = BASES["weights"]
    return Scenario.model_validate(
        {
            **base,
            "formation": {**base["formation"], **formation, "weights": weights},
            "agents": {"estimator": "none", "law": "static", "parameters": {"static": {"alpha": 1.0}}},
        }
    )


# Designs


def test_a_design_read_from_its_file_flies_as_predicted(tmp_path):
    made = designing.designed(layouts.grid(60, 2), 3.0, 12.0)
    assert made.settles <= 12.0
    file = tmp_path / "designed.toml"
    file.write_text(loading.to_toml(made.scenario))
    plan = making.make(loading.load(file))
    found = {finding.check: finding for finding in plan.findings}
    assert found["weights"].says == "of its own, alike both ways: followers balance where they stand"
    assert found["step"].level == "ok"
    settles = float(found["step"].says.rpartition("in ")[2].removesuffix(" s"))
    assert settles == pytest.approx(made.settles, abs=0.06)  # by ticks it is half a tick faster
    assert (plan.world.formation.weights == made.formation.weights).all()
    assert plan.world.formation.edges == made.formation.edges
    off_diagonal = plan.swarm.stress - np.diag(np.diag(plan.swarm.stress))
    assert (off_diagonal == off_diagonal.T).all()


def test_a_design_that_may_take_for_ever_needs_no_more_than_corners_and_flies_for_an_hour():
    made = designing.designed(layouts.grid(60, 2), 3.0, 1e9)
    assert len(made.formation.leaders) == 3
    assert made.scenario.time.duration == 3600.0


def test_a_range_too_short_is_refused_with_the_way_out():
    with pytest.raises(
        ScenarioError, match=r"--range 1: agents .* in no clique of 4 or more that spans; give a longer range"
    ):
        designing.designed(layouts.grid(60, 2), 1.0, 12.0)


def test_a_time_that_no_leaders_keep_is_refused_with_the_way_out():
    with pytest.raises(ScenarioError, match=r"--settle 0\.01: no leaders make .*; give more time"):
        designing.designed(layouts.grid(60, 2), 3.0, 0.01)


def test_too_few_nodes_for_a_stress_are_refused():
    with pytest.raises(ScenarioError, match="4 nodes: a stress in 3 dimensions needs 5 at least"):
        designing.designed(layouts.grid(4, 3), 3.0, 12.0)


@pytest.mark.parametrize(
    ("nominal", "words"),
    [
        ([[0, 0], [1, 0], [0, 1], [1, 1], [1, 0]], r"node 5 stands where another does, at \[1.0, 0.0\]; move it"),
        ([[0, 0], [1, 1], [2, 2], [3, 3]], "all nodes lie in a line"),
        ([[0, 0, 1], [1, 1, 1], [2, 0, 1], [3, 3, 1], [0, 3, 1]], "all nodes lie in a plane"),
    ],
)
def test_nodes_that_no_range_would_help_are_refused(nominal, words):
    with pytest.raises(ScenarioError, match=words):
        designing.designed(np.array(nominal, dtype=float), 3.0, 10.0)


@pytest.mark.parametrize("agents", [0, 10_001])
def test_nodes_of_a_kind_are_no_more_than_can_be_designed(agents):
    with pytest.raises(ScenarioError, match=f"--agents {agents}: from 1 to 10000"):
        designing.nodes("grid", agents, None, 1)


def test_nodes_of_a_kind_are_so_many_in_so_many_dimensions():
    assert designing.nodes("grid", 30, None, 1).shape == (30, 2)
    assert designing.nodes("random", 30, 3, 1).shape == (30, 3)
    assert (designing.nodes("random", 30, 3, 1) != designing.nodes("random", 30, 3, 2)).any()
    with pytest.raises(ScenarioError, match="--agents: how many there are in the grid"):
        designing.nodes("grid", None, None, 1)


def test_nodes_of_a_file_are_those_of_its_lines(tmp_path):
    file = tmp_path / "places.csv"
    file.write_text("# x, y\n0, 0\n1.5 -2  # a comment\n\n3;4\n")
    assert designing.nodes(str(file), None, None, 1).tolist() == [[0, 0], [1.5, -2], [3, 4]]
    with pytest.raises(ScenarioError, match=r"has nodes of its own; give them with grid or random"):
        designing.nodes(str(file), 7, None, 1)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1, 2\n3, four\n", r'places\.csv:2: "3, four" is no node; write 1\.0, 2\.0'),
        ("1, 2\n1, 2, 3\n", r"places\.csv:2: nodes need two coordinates each, or three each"),
        ("1\n", r"places\.csv:1: nodes need two coordinates each, or three each"),
        ("1, nan\n", r"places\.csv:1: coordinates are at most 1e\+09 m in size"),
        ("1, 1e12\n", r"places\.csv:1: coordinates are at most 1e\+09 m in size"),
        ("# none\n", r"places\.csv: no nodes; write one in each line"),
    ],
)
def test_what_is_no_node_is_refused_by_its_line(tmp_path, text, words):
    file = tmp_path / "places.csv"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=words):
        designing.nodes(str(file), None, None, 1)


def test_a_file_that_is_not_there_is_said():
    with pytest.raises(
        ScenarioError, match=r"nowhere\.csv: no such file; give one with a node in each line, or grid or random"
    ):
        designing.nodes("nowhere.csv", None, None, 1)


# Weights of one's own


def test_the_stress_of_zhao7_given_as_weights_holds_it():
    found = findings(weighed(WEIGHTS))
    assert found["weights"].says == "of its own, alike both ways: followers balance where they stand"
    assert found["followers"].says == "follower block eigenvalues 0.3431 to 14.0000"  # sqrt(213) times .0235 to .9593
    assert "rigidity" not in found


def directed(factors):
    """The weights of zhao7, each agent's own times its factor: who gives less is slower, and stands where it stood."""
    edges = BASES["weights"]["formation"]["edges"]
    ends = [tuple(int(end) for end in edge.split("-")) for edge in edges]
    return [[w * factors.get(i, 1.0), w * factors.get(j, 1.0)] for w, (i, j) in zip(WEIGHTS, ends, strict=True)]


def test_weights_that_are_not_alike_both_ways_hold_it_too():
    given = weighed(directed({4: 0.5, 6: 3.0, 1: 0.0, 2: 0.0, 3: 0.0}))
    found = findings(given)
    assert found["weights"].says == "of its own, not alike both ways: followers balance where they stand"
    plan = making.make(given)
    L = plan.swarm.stress
    assert L[3, 1] == -4.0  # half the 8 of 2-4
    assert (L[:3] == 0.0).all()
    np.testing.assert_allclose(L @ plan.world.formation.nominal, 0.0, atol=1e-12)
    assert plan.brief.stress[3].sum() == pytest.approx(L[3, 3])


@pytest.mark.parametrize("law", ["static", "varying-velocity", "double-varying-velocity"])
def test_leaders_that_weigh_nobody_fly_their_manoeuvre(law):
    body = "double-integrator" if law.startswith("double") else "single-integrator"
    given = weighed(directed({1: 0.0, 2: 0.0, 3: 0.0})).model_dump(exclude_none=True)
    agents = {"estimator": "none", "law": law, "parameters": given["agents"]["parameters"]}
    given |= {"agents": agents, "dynamics": {"model": body}, "manoeuvre": {"preset": "hover"}}
    given |= {"time": {"dt": 0.01, "duration": 0.1}}
    flown = rehearse(making.make(Scenario.model_validate(given)))
    assert np.isfinite(flown.arrays["position"]).all()


def test_rows_that_do_not_balance_are_refused_by_agent():
    weights = list(WEIGHTS)
    weights[-1] += 0.01  # 6-7, two metres apart each way
    with pytest.raises(PlanError, match=r"weights: the weights of agent 6 and 1 more do not balance: .* 0\.04 m off"):
        making.make(weighed(weights))


def test_what_a_leader_weighs_need_not_balance():
    edges = BASES["weights"]["formation"]["edges"]
    weights = [[w, w] for w in WEIGHTS]
    weights[edges.index("1-4")][0] = 77.0
    assert findings(weighed(weights))["weights"].level == "ok"


def test_weights_that_sum_to_nothing_above_0_are_refused_by_agent():
    with pytest.raises(
        PlanError, match="weights: the weights of agent 5 do not sum to more than 0, and laws divide by"
    ):
        making.make(weighed(directed({5: -1.0})))


def test_a_follower_block_that_does_not_settle_is_refused():
    # Each of two followers weighs the other by 3, sums to 1, and lets three leaders make up for it: L_ff = [[1, -3], [-3, 1]].
    leaders, followers = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]]), np.array([[1.0, 1.0], [2.0, 1.0]])
    edges, weights = ["4-5"], [[3.0, 3.0]]
    for number, (own, other) in enumerate(zip(followers, followers[::-1], strict=True), start=4):
        balance = np.vstack([(leaders - own).T, np.ones(3)])
        theirs = np.linalg.solve(balance, np.append(-3.0 * (other - own), 1.0 - 3.0))
        edges += [f"{number}-{leader}" for leader in (1, 2, 3)]
        weights += [[float(weight), 0.0] for weight in theirs]
    nodes = [*leaders.tolist(), *followers.tolist()]
    with pytest.raises(
        PlanError, match=r"weights: follower block has an eigenvalue with a real part of -2, not above 0"
    ):
        making.make(weighed(weights, nodes=nodes, edges=edges, leaders=[1, 2, 3], scale=1.0))


@pytest.mark.parametrize("weights", [WEIGHTS[:-1], [*WEIGHTS, 1.0], [[1.0, 2.0]] * 11, [[1.0, 2.0, 3.0]] * 12])
def test_as_many_weights_as_edges_are_asked_for(weights):
    with pytest.raises(ScenarioError, match=r"formation\.weights: must be 12( x 2)? numbers"):
        making.make(weighed(weights))


def test_a_preset_may_have_other_weights_and_nobody_solves_for_any(monkeypatch):
    from world.formation import stress

    monkeypatch.setattr(stress, "solve", None)
    overrides = [
        "formation.weights=[4, 4, -2, -2, 8, -2, 8, -2, 1, 4, 4, 2]",
        "agents.law=static",
        "agents.estimator=none",
    ]
    plan = making.make(loading.load("corridor", [*overrides, "agents.parameters={static={alpha=1.0}}"]))
    assert {finding.check: finding.level for finding in plan.findings}["weights"] == "ok"
