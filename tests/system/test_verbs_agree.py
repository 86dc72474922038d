"""Every verb of the timeline gives the same bits over processes as in one process; and again from its journal."""

import numpy as np
import pytest
from flying import PROCESSES, plan_of
from scripted import timeline

from affinet.planning import making as planning
from affinet.runtimes.run import fly
from affinet.scenario import verbs
from agents.estimators.edge_kf import EdgeKalmanFilter
from agents.estimators.rkf import RelativeKalmanFilter
from netem.medium import journal
from netem.medium.medium import JOURNAL
from world.books import history

pytestmark = PROCESSES

COARSE = ("time.dt=0.05", "record.enabled=false", "network.availability=0.9", "formation.spread=0.5")
MIRROR = [[-1.0, 0.0], [0.0, 1.0]]
BELOW = {"tracking_error_below": 1e3, "lasting": 0.3}
# Under every kind of air, a script; together they hold every verb.
SCRIPTS = {
    "as it is": (
        (),
        [
            {"verb": "pause", "at": 0.0, "lasts": 0.2, "agents": [6, 1]},
            {"verb": "kill", "at": 0.3, "agents": [5]},
            {"verb": "restart", "at": 0.6, "agents": [5], "state": "warm"},
            {"verb": "lie", "at": 0.4, "lasts": 1.0, "agents": [4, 5], "matrix": MIRROR},
            {"verb": "gust", "at": 0.5, "every": 0.6, "lasts": 0.2, "agents": ["followers"], "velocity": [0.5, -1.0]},
            {"verb": "pause", "at": 0.8, "agents": [7]},
            {"verb": "kill", "at": 1.0, "agents": [7]},  # while it sleeps
            {"verb": "restart", "at": 1.3, "agents": [7]},  # into its sleep
            {"verb": "resume", "at": 1.6, "agents": [7]},
            {"verb": "clock", "at": 0.7, "lasts": 1.2, "agents": ["leaders"], "rate": 0.3},
            {"verb": "bias", "at": 0.9, "lasts": 0.5, "links": ["2->4"], "by": [0.3, 0.0]},
            {"verb": "outlier", "at": 1.0, "lasts": 0.8, "links": ["all"], "p": 0.1, "sigma": 3.0},
            {"verb": "freeze", "at": 1.2, "lasts": 0.5, "links": ["5-7"]},
            {"verb": "pause", "at": 1.7, "agents": [3]},  # to the end
        ],
    ),
    "late, apart, on a condition": (
        ("network.delay_ticks=2", "network.coupled=false"),
        [
            {"verb": "pause", "at": 0.1, "lasts": 1.4, "agents": [6]},
            {"verb": "partition", "name": "split", "when": BELOW, "at": 0.1, "lasts": 0.4, "groups": "leaders"},
            {"verb": "kill", "after": "split", "at": 0.2, "agents": [3]},
            {"verb": "restart", "after": "split", "at": 0.6, "agents": [3], "state": "warm"},
            {"verb": "pause", "after": "split.end", "lasts": 0.3, "agents": [2], "in_flight": "drop"},
            {"verb": "delay", "at": 0.2, "lasts": 1.0, "links": ["random 6"], "delay": 0.12},
            {"verb": "degrade", "at": 0.5, "lasts": 0.8, "links": ["leaders->followers"], "profile": "wifi_busy"},
            {"verb": "cut", "name": "cut", "at": 0.3, "links": ["4-6"], "in_flight": "hold"},
            {"verb": "lose", "at": 0.3, "links": ["1->all"], "loss": 0.5},
            {"verb": "heal", "at": 0.9, "names": ["cut"]},
            {"verb": "heal", "at": 1.8},
            {"verb": "dropout", "at": 0.6, "lasts": 0.8, "links": ["4"], "p": 0.5},
        ],
    ),
    "a tick late": (
        ('time.exchange="next-tick"', "agents.parameters.varying-velocity.relaxation=0.3"),
        [
            {"verb": "depart", "at": 0.2, "agents": [5], "body": "drift"},
            {"verb": "depart", "at": 0.3, "lasts": 0.5, "agents": [7], "body": "vanish"},
            {"verb": "rejoin", "at": 0.9, "agents": [5]},
            {"verb": "pause", "at": 0.4, "every": 0.5, "lasts": 0.2, "times": 2, "agents": [4]},
            {"verb": "pause", "at": 0.4, "lasts": 0.2, "agents": [1], "in_flight": "drop"},
            {"verb": "depart", "at": 0.6, "agents": [3]},
            {"verb": "replace", "at": 1.1, "agents": [3]},
            {"verb": "lie", "at": 0.2, "agents": [6], "matrix": MIRROR},
            {"verb": "kill", "at": 0.5, "agents": [2]},
            {"verb": "restart", "at": 0.7, "agents": [2], "state": "warm"},
            {"verb": "kill", "at": 1.2, "agents": [2]},
            {"verb": "restart", "at": 1.5, "agents": [2]},
        ],
    ),
}


def test_together_the_scripts_hold_every_verb():
    assert {entry["verb"] for _, script in SCRIPTS.values() for entry in script} == set(verbs.VERBS)


def flown(plan, runtime, out):
    outcome = fly(plan, runtime, out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.messages["uninstructed"] == 0
    return outcome


# Seven agents, each in a process of its own; and in two hosts of three, with one that is left over.
APART, HOSTED = 1, 3


@pytest.fixture(scope="module", params=[(name, size) for name in SCRIPTS for size in (APART, HOSTED)], ids=str)
def twice(request, tmp_path_factory):
    """A script flown in this process and over processes: which, how, the outcomes, and the run directories."""
    overrides, script = SCRIPTS[request.param[0]]
    hosts = f"agents.per_process={request.param[1]}"
    plan = plan_of("corridor", "time.duration=2", *COARSE, *overrides, hosts, timeline(*script))
    outs = [tmp_path_factory.mktemp("verbs") / runtime for runtime in ("inprocess", "processes")]
    return request.param, [flown(plan, out.name, out) for out in outs], outs


def test_both_runtimes_give_the_same_bits_and_count_the_same_bites(twice):
    _, (one, many), outs = twice
    assert one.digest == many.digest
    assert [bite.to_json() for bite in one.faults] == [bite.to_json() for bite in many.faults]
    assert one.messages == many.messages | {"uninstructed": 0}
    books = [journal.read(out / JOURNAL) for out in outs]
    assert books[0].equals(books[1])


def test_every_process_ends_as_it_was_told(twice):
    (name, size), (_, many), _ = twice
    told = [entry["agents"] for entry in SCRIPTS[name][1] if entry["verb"] in ("kill", "replace")]
    killed = [agent for agents in told for agent in agents if size == APART or agent == 7]
    ends = [process["exit"] for process in many.processes]
    assert ends.count(-9) == len(killed)
    assert set(ends) == {0, *([-9] if killed else [])}


def test_a_run_over_processes_is_flown_again_in_one_process(twice, tmp_path):
    _, (_, many), (_, out) = twice
    assert flown(planning.again(out, (), verdicts=False), "inprocess", tmp_path / "again").digest == many.digest


def test_a_run_over_processes_is_flown_again_under_its_verdicts(twice, tmp_path):
    _, (_, many), (_, out) = twice
    assert flown(planning.again(out, (), verdicts=True), "inprocess", tmp_path / "again").digest == many.digest


def test_under_its_verdicts_another_seed_meets_the_same_air_in_both_runtimes(tmp_path):
    """No trigger waits for an error, which depends on the noise, and nobody is drawn by lot."""
    overrides, script = SCRIPTS["a tick late"]
    plan = plan_of("corridor", "time.duration=2", *COARSE, *overrides, timeline(*script))
    first = flown(plan, "inprocess", tmp_path / "first")
    again = planning.again(tmp_path / "first", ("seed=99",), verdicts=True)
    one, many = (flown(again, runtime, tmp_path / runtime) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest != first.digest
    arrays, repeated = (history.load(tmp_path / run / history.ARRAYS) for run in ("first", "processes"))
    for name in ("verdicts", "newest", "copies", "late", "dropped"):
        assert np.array_equal(arrays[name], repeated[name]), name
    assert [bite.touched for bite in first.faults] == [bite.touched for bite in many.faults]


NOTHING_TO_REMEMBER = {
    "killed before it did anything": [
        {"verb": "kill", "at": 0.0, "agents": [5]},
        {"verb": "restart", "at": 0.5, "agents": [5], "state": "warm"},
    ],
    "killed again before it did anything": [
        {"verb": "kill", "at": 0.2, "agents": [5]},
        {"verb": "restart", "at": 0.4, "agents": [5]},
        {"verb": "pause", "at": 0.4, "agents": [5]},
        {"verb": "kill", "at": 0.6, "agents": [5]},
        {"verb": "resume", "at": 0.7, "agents": [5]},
        {"verb": "restart", "at": 0.8, "agents": [5], "state": "warm"},
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NOTHING_TO_REMEMBER)
def test_who_did_nothing_yet_comes_back_warm_with_nothing_in_both_runtimes(name, tmp_path):
    plan = plan_of("corridor", "time.duration=1", *COARSE, timeline(*NOTHING_TO_REMEMBER[name]))
    one, many = (flown(plan, runtime, tmp_path / runtime) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest


GAPS = [
    {"verb": "pause", "at": 0.2, "lasts": 0.3, "agents": [6], "in_flight": "hold"},
    {"verb": "pause", "at": 0.3, "lasts": 0.2, "agents": [1]},
    {"verb": "kill", "at": 0.3, "agents": [5]},
    {"verb": "restart", "at": 0.6, "agents": [5], "state": "warm"},
    {"verb": "pause", "at": 0.1, "agents": [7]},
    {"verb": "kill", "at": 0.2, "agents": [7]},  # while it sleeps
    {"verb": "restart", "at": 0.4, "agents": [7], "state": "warm"},  # into its sleep
    {"verb": "resume", "at": 0.6, "agents": [7]},
]


@pytest.mark.parametrize(
    ("kind", "named"),
    [
        (EdgeKalmanFilter, ("agents.estimator=edge-kf", "agents.parameters.edge-kf.sigma_n=0.1")),
        (RelativeKalmanFilter, ("agents.estimator=rkf",)),
    ],
)
def test_who_missed_ticks_makes_the_same_of_them_in_both_runtimes(kind, named, tmp_path, monkeypatch):
    plan = plan_of("corridor", "time.duration=0.8", *COARSE, "network.delay_ticks=1", *named, timeline(*GAPS))
    one, many = (flown(plan, runtime, tmp_path / runtime) for runtime in ("inprocess", "processes"))
    assert one.digest == many.digest
    monkeypatch.setattr(kind, "missed", lambda _self, _brief, state, _gap: state)
    assert flown(plan, "inprocess", tmp_path / "as before").digest != one.digest
