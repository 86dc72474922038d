"""One implementation, two runtimes, the same bits."""

import json
import subprocess
import sys
from importlib.metadata import entry_points

import numpy as np
import pytest
from flying import PROCESSES, digest_of, plan_of

from affinet.planning.registry import ESTIMATORS
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.scenario import loading
from world.books import history

pytestmark = PROCESSES

# A coarse tick flies each scenario to its end, through every fault, in seconds.
COARSE = ("time.dt=0.05", "agents.parameters.constant-velocity.eta=0.5")
# There is no fault in these, and they are flown below, or are the same all along; the last two need other ticks, or gains.
SHORTENED = {
    **dict.fromkeys(("ravine", "corridor", "bursts", "hexa", "rigid"), ("time.duration=6",)),
    "switching": ("time.dt=0.1", "agents.parameters.constant-velocity.alpha=10"),
    "target": (
        "time.dt=0.01",
        "time.duration=1.7",
        "agents.parameters.target.theta=2",
    ),  # detections take 0.5 s, or 1 s
}


def processes(out, name, *overrides):
    return fly(plan_of(name, *overrides), "processes", out, lambda *_: None)


@pytest.mark.parametrize("name", loading.shipped())
def test_processes_give_the_bits_of_one_process(name, out):
    coarse = (*COARSE, *SHORTENED.get(name, ()))
    outcome = processes(out, name, *coarse)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(name, *coarse)


@pytest.mark.slow
def test_two_runs_over_processes_agree_and_two_seeds_do_not(tmp_path):
    short = ("time.duration=3", "time.dt=0.05")
    first, second = (processes(tmp_path / run, "partition", *short).digest for run in "ab")
    other = processes(tmp_path / "c", "partition", *short, "seed=2").digest
    assert first == second != other


def test_agents_that_begin_apart_and_miss_their_target_agree(out):
    three = "formation={nodes=[[5,0],[-3,4],[-3,-4]],edges=['1-2','2-3'],leaders=[],spread=3.0}"
    begun = '{fusion="mean",gate=3.0,first=[[1.0,0.0],[0.0,2.0],[-1.0,1.0]]}'
    detectors = ("target.misses=0.3", "target.false_positives=0.3", "target.schedule=[2,1]", "target.true_intensity=2")
    overrides = ("time.dt=0.05", "time.duration=4", three, *detectors, f"agents.parameters.target={begun}")
    outcome = processes(out, "target", *overrides)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("target", *overrides)


AIRS = (
    ("network.delay_ticks=2",),
    ('time.exchange="next-tick"', "agents.parameters.varying-velocity.relaxation=0.3"),
    (
        "network.coupled=false",
        "network.delay_ticks=1",
        'network.links=[{links="2->4",availability=0.1,delay_ticks=5}]',
    ),
    ('agents.estimator="none"', 'agents.law="static"'),
    ('agents.parameters.varying-velocity.source="feed-forward"', "dynamics.disturbance=0.001"),
    ('agents.parameters.varying-velocity.source="estimated"', 'agents.parameters.ga-rkf.geometry="ral"'),
    ('timeline=[{verb="kill",at=0.2,agents=[4,6]},{verb="restart",at=0.4,agents=[4]}]', "network.delay_ticks=3"),
)
AIR_NAMES = ("delay", "next-tick", "uncoupled", "bare", "feed-forward", "estimated", "kill-under-delay")


@pytest.mark.parametrize("air", AIRS, ids=AIR_NAMES)
def test_every_kind_of_air_and_agent_agrees(air, out):
    overrides = ("time.duration=0.8", *air)
    outcome = processes(out, "corridor", *overrides)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("corridor", *overrides)


BRIEFLY = "time.duration=0.4"
KINDS = {
    "imm": ('agents.estimator="imm"',),
    "ral": ('agents.estimator="ral"',),
    "conral-similarity": ('agents.estimator="conral"', 'agents.parameters.conral.constraint="similarity"'),
    "ga-rkf-rotation": (
        'agents.parameters.ga-rkf.constraint="rotation"',
        'agents.parameters.ga-rkf.geometry="ral"',
    ),
    "rkf-constant-velocity": ('agents.estimator="rkf"', 'agents.parameters.rkf.model="constant-velocity"'),
}


@pytest.mark.parametrize("agents", KINDS.values(), ids=KINDS)
def test_every_kind_of_estimator_agrees(agents, out):
    outcome = processes(out, "corridor", BRIEFLY, *agents)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("corridor", BRIEFLY, *agents)
    # A setting that does nothing agrees as well.
    assert outcome.digest not in {digest_of("corridor", BRIEFLY, *agents[:-1]), digest_of("corridor", BRIEFLY)}


BY_INPUTS = ("joint-kf", "edge-kf")


LATE = (
    'network.profiles.late={delay={model="uniform",mean=0.04,jitter=0.04},duplicate=0.2,corrupt=[{kind="stale",p=0.1}]}',
    'network.profile="late"',
)


@pytest.mark.parametrize("air", [(), LATE], ids=["lost", "late"])
@pytest.mark.parametrize("estimator", BY_INPUTS)
def test_filters_that_predict_by_lost_or_late_inputs_agree_too(estimator, air, out):
    overrides = (
        *("time.duration=0.4", "time.dt=0.02", f"agents.estimator={estimator}", "agents.parameters.static.alpha=2"),
        *("network.coupled=false", "network.availability=0.7", "dynamics.persistence=0.5", *air),
    )
    model = f"agents.parameters.{estimator}={{coefficients=[0.81],sigma_n=0.1,memory=3}}"
    outcome = processes(out, "rigid", *overrides, model)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("rigid", *overrides, model)
    # A setting that does nothing agrees as well.
    assert outcome.digest not in {digest_of("rigid", *overrides), digest_of("rigid", *overrides[:-1], model)}


def flown_above():
    """The estimators, by their classes, that fly over processes above: as a scenario has it, or as said there."""
    by_name = {entry.name: entry.value for entry in entry_points(group=ESTIMATORS)}
    shipped = {loading.load(name).agents.estimator for name in loading.shipped()}
    said = {name for name in by_name if any(f'agents.estimator="{name}"' in kind for kind in (*AIRS, *KINDS.values()))}
    return {by_name[name] for name in {*shipped, *said, *BY_INPUTS}}


OTHERS = {entry.value: entry.name for entry in entry_points(group=ESTIMATORS) if entry.value not in flown_above()}


@pytest.mark.parametrize("estimator", OTHERS.values())
def test_every_other_estimator_agrees(estimator, out):
    overrides = ("time.duration=0.2", "time.dt=0.02", "agents.parameters.static.alpha=2", "network.availability=0.7")
    other = f'agents.estimator="{estimator}"'
    outcome = processes(out, "rigid", *overrides, other)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("rigid", *overrides, other)
    assert outcome.digest != digest_of("rigid", *overrides)


@pytest.mark.parametrize(
    "agents",
    [
        (
            'timeline=[{verb="pause",at=0.1,until=0.3,agents=[4]},{verb="kill",at=0.2,agents=[2,5]},'
            '{verb="restart",at=0.4,agents=[5]},{verb="gust",at=0.3,agents=[7],velocity=[1,0,2]}]',
        ),
        (
            'agents.law="double-constant-velocity"',
            'agents.parameters.double-constant-velocity.source="estimated"',
            "agents.limit=0.5",
        ),
    ],
    ids=["faults", "estimated"],
)
def test_double_integrators_agree_too(agents, out):
    overrides = ("time.duration=0.6", "time.dt=0.02")
    outcome = processes(out, "ravine", *overrides, *agents)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of("ravine", *overrides, *agents)
    assert outcome.digest not in {digest_of("ravine", *overrides, *agents[:-1]), digest_of("ravine", *overrides)}


OCTAHEDRON = """
[formation]
nodes = [[1,0,0], [-1,0,0], [0,1,0], [0,-1,0], [0,0,1], [0,0,-1], [0.3,0.2,0.1]]
edges = ["1-2","1-3","1-4","1-5","1-6","1-7","2-3","2-4","2-5","2-6","2-7","3-4","3-5","3-6","3-7","4-5","4-6","4-7","5-6","5-7","6-7"]
leaders = [1, 3, 5, 7]
[manoeuvre]
keyframes = [
  { time = 0.0, theta = [[1,0,0],[0,1,0],[0,0,1]], offset = [0,0,0] },
  { time = 2.0, theta = [[1,0,0],[0,0.8,0.2],[0,0,1.2]], offset = [1,0,2] },
]
[time]
dt = 0.02
duration = 2.0
[sensing]
sigma = 0.05
[agents]
estimator = "ga-rkf"
law = "constant-velocity"
[network]
availability = 0.8
"""  # noqa: E501


def test_three_dimensions_agree_too(tmp_path, out):
    (tmp_path / "octahedron.toml").write_text(OCTAHEDRON)
    name = str(tmp_path / "octahedron.toml")
    outcome = processes(out, name)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(name)


def test_a_run_leaves_its_scenario_arrays_recording_and_summary(out):
    outcome = processes(out, "corridor", "time.duration=1")
    names = {"scenario.json", "arrays", "journal.arrows", "graph.arrows", "run.rrd", "summary.json", "logs"}
    assert {path.name for path in out.iterdir()} == names
    summary = json.loads((out / "summary.json").read_text())
    assert summary["digest"] == outcome.digest == history.digest(history.load(out / history.ARRAYS))
    roles = [(process["role"], process["id"]) for process in summary["processes"]]
    agents = [("agent", number) for number in range(1, 8)]
    assert roles == [("world", None), ("netem", None), *agents, ("nursery", None)]
    assert all(process["exit"] == 0 for process in summary["processes"])


def test_an_agent_stays_below_20_mb(out):
    """Before: 28 MB, of processes that share no more than their libraries."""
    outcome = processes(out, "hexa", "time.duration=2")
    assert max(p["pss_mb"] for p in outcome.processes if p["role"] == "agent") < 20


FIRST_EVER = """
import sys
from pathlib import Path
from affinet.planning.making import make
from affinet.runtimes import launcher
from affinet.runtimes.run import fly
from affinet.scenario import loading
from analysis.kernels.kept import folder

prepare, planned = launcher._prepare_kernels, set()

def noted(world):
    prepare(world)
    planned.update(folder().iterdir())

launcher._prepare_kernels = noted
plan = make(loading.load("hexa", ("time.duration=0.1", "record.enabled=false")))
outcome = fly(plan, "processes", Path(sys.argv[1]), lambda *_: None)
print(outcome.verdict, *sorted(file.name for file in set(folder().iterdir()) - planned))
"""


def test_where_nothing_is_compiled_yet_only_the_medium_compiles_what_it_alone_needs(out, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "empty"))
    told = subprocess.run([sys.executable, "-c", FIRST_EVER, str(out)], capture_output=True, text=True, check=True)
    verdict, *compiled = told.stdout.split()
    assert verdict == "pass"
    assert [name for name in compiled if not name.startswith("netem.")] == [], "ten would compile the same at once"


def test_every_message_is_accounted_for(out):
    outcome = processes(out, "corridor", "time.duration=2", "network.delay_ticks=3", "network.availability=0.6")
    messages = outcome.messages
    assert messages["uninstructed"] == 0
    assert messages["in_flight"] > 0
    assert messages["offered"] == 200 * 24 * 4
    assert messages["offered"] == messages["delivered"] + sum(messages["dropped"].values()) + messages["in_flight"]


def test_a_fault_that_never_bit_makes_the_run_vacuous(out):
    kill_then_cut = (
        'timeline=[{verb="kill",at=0.2,agents=[4]},{verb="cut",at=0.5,until=0.8,links=["4-6"]}]',
        "time.duration=1",
    )
    outcome = fly(plan_of("corridor", *kill_then_cut), "inprocess", out, lambda *_: None)
    assert outcome.verdict == "vacuous"
    assert "cut" in outcome.reasons[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", loading.shipped())
def test_shipped_scenarios_agree_in_full(name, seed, out):
    overrides = (f"seed={seed}",)
    outcome = processes(out, name, *overrides)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(name, *overrides)


def mean_error(estimator, seed):
    plan = plan_of("corridor", f'agents.estimator="{estimator}"', "network.availability=0.5", f"seed={seed}")
    return rehearse(plan).error.mean()


@pytest.mark.parametrize("seeds", [(1,), pytest.param(range(1, 6), marks=pytest.mark.slow)], ids=["one", "five"])
def test_estimation_pays_off_when_half_of_the_messages_are_lost(seeds):
    bare, aware = (np.mean([mean_error(name, seed) for seed in seeds]) for name in ("none", "ga-rkf"))
    assert bare > 5 * aware


@pytest.mark.slow
def test_a_million_messages_through_the_real_medium_are_accounted_for(out):
    wild = (
        "network.availability=0.95",
        'network.profile="wild"',
        'network.profiles.wild={like="wifi_busy",duplicate=0.02,corrupt=[{kind="stale",p=0.01}],rate={rate=3e5,queue=4000}}',
        'timeline=[{verb="partition",at=20,until=23,groups=[[1,2,3],[4,5,6]],in_flight="hold"}]',
    )
    outcome = processes(out, "hexa", *wild)
    messages = outcome.messages
    assert outcome.verdict == "pass", outcome.reasons
    assert messages["offered"] >= 1_000_000
    assert messages["uninstructed"] == 0
    assert messages["copies"] > 0
    booked = messages["delivered"] + sum(messages["dropped"].values()) + messages["in_flight"]
    assert messages["offered"] + messages["copies"] == booked
    assert outcome.digest == digest_of("hexa", *wild)
