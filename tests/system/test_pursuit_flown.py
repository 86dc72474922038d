"""Pursuits as they are flown: alone, side by side, with losses and deaths, over processes."""

from functools import cache
from itertools import combinations

import numpy as np
import pytest
from flying import PROCESSES, digest_of, plan_of
from pursuits import ALONE, COARSE, FEW, NAME, SINGLE, TRIPLE, bodies
from scripted import timeline
from targets import van_loan

from affinet.runtimes.inprocess import InProcessSwarm
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.runtimes.side_by_side import side_by_side
from affinet.studies.batch import fly_all
from analysis.models.information import position, unpacked
from netem.core.channels import TARGET
from netem.medium.verdict import Verdict
from world.books.history import History


def test_who_is_restarted_late_in_a_run_and_remembers_nothing_is_as_unsure_as_the_target_is_free():
    again = timeline({"verb": "kill", "at": 0.5, "agents": [5]}, {"verb": "restart", "at": 1.0, "agents": [5]})
    arrays = rehearse(
        plan_of(NAME, "time.dt=0.01", "time.duration=1.2", "target.latencies=[0.2,0.1]", again, ALONE)
    ).arrays
    A, W = van_loan(2, 1.0, 1.0)
    Q, _ = unpacked(arrays["information"][100, 4, 0], 2, 2)
    np.testing.assert_allclose(np.linalg.inv(Q), A @ A.T + W, rtol=1e-9)
    assert arrays["variance"][100, 4] > 10 * arrays["variance"][100, 3]


def test_in_a_flight_a_clock_that_is_set_right_leaves_information_that_is_sound():
    # It falls back just after the first detections, which are far surer than what was known before.
    fast = timeline({"verb": "clock", "at": 0.0, "until": 0.22, "agents": [4, 7], "rate": 5.0})
    short = ("time.dt=0.01", "time.duration=1.0", "target.latencies=[0.2,0.1]", ALONE)
    arrays, right = (rehearse(plan_of(NAME, *short, *air)).arrays for air in ((fast,), ()))
    Q, _ = unpacked(arrays["information"][:, :, 0], 2, 2)
    assert np.linalg.eigvalsh(Q).min() > 0.0
    assert (arrays["variance"] > 0.0).all()
    wrong = (arrays["information"] != right["information"]).any(axis=(0, 2, 3))
    assert np.flatnonzero(wrong).tolist() == [3, 6]


MEAN = 'agents.parameters.target={fusion="mean"}'
SEEDS = (1, 7, 2**63 + 5)
LOSSY = ("network.availability=0.7", "network.delay_ticks=2")
FOURTH = (*bodies(4, 81, 108, 54, 12), "target.order=4", MEAN, "network.availability=0.7", "time.duration=0.3")


@pytest.mark.parametrize(
    "air", [(), LOSSY, (MEAN, *LOSSY), FOURTH], ids=["clear", "lossy", "mean", "quadruple-integrators"]
)
def test_every_swarm_side_by_side_meets_the_draws_that_it_meets_alone(air):
    short = (*COARSE, "time.duration=0.6", *air)
    plan = plan_of(NAME, *short)
    batch = side_by_side(plan, SEEDS)
    together = History(batch.world, len(batch.channels), batch.reports)
    InProcessSwarm(batch).fly(together.extend, 20)
    flown = together.arrays()
    for place, seed in enumerate(SEEDS):
        alone = rehearse(plan_of(NAME, *short, f"seed={seed}")).arrays
        agents = slice(10 * place, 10 * (place + 1))
        for array in ("position", "target", "reference", "found", "variance", "information", "fused", "input"):
            np.testing.assert_array_equal(flown[array][:, agents], alone[array], array)
        assert np.isfinite(alone["reference"]).all()


KILLED = timeline({"verb": "kill", "at": 0.2, "agents": [5]}, {"verb": "kill", "at": 0.3, "agents": [1, 2]})


@pytest.mark.parametrize("air", [(), (KILLED,)], ids=["all", "some die"])
def test_the_runs_of_a_study_are_looked_at_as_each_alone(air):
    short = (*COARSE, "time.duration=0.5", *air)
    runs = fly_all(plan_of(NAME, *short), [3, 4], every=5)
    for row, seed in enumerate((3, 4)):
        run = rehearse(plan_of(NAME, *short, f"seed={seed}"))
        arrays, nominal = {name: array[:50:5] for name, array in run.arrays.items()}, run.plan.world.formation.nominal
        target = arrays["target"] - nominal
        awake = np.isfinite(arrays["found"]).all(axis=-1)
        assert awake.sum(axis=1).tolist() == ([10] * 4 + [9] * 2 + [7] * 4 if air else [10] * 10)
        Q, y = unpacked(np.nanmean(arrays["information"][:, :, 0], axis=1), 2, 2)
        ideal = np.linalg.solve(Q, y)[:, :1]
        expected = {
            "found": arrays["found"] - target,
            "agreed": arrays["reference"][:, :, 0] - target,
            "ideal": np.broadcast_to(ideal, target.shape) - target,
            "apart": arrays["reference"][:, :, 0] - ideal,
            "behind": arrays["position"] - nominal - arrays["reference"][:, :, 0],
            "effort": arrays["input"],
        }
        for name, off in expected.items():
            rms = np.sqrt(np.nanmean(np.where(awake, (off**2).sum(axis=-1), np.nan), axis=-1))
            np.testing.assert_allclose(runs.quantities[name][row], rms, rtol=1e-9, atol=1e-12, err_msg=name)
        if row == 0:
            reports = {"sighting", "reference", "found", "variance", "information", "fused"}
            assert runs.first.keys() == reports | {"position", "input", "target"}
            for name in runs.first.keys() - {"target"}:
                np.testing.assert_array_equal(runs.first[name], arrays[name], name)
            np.testing.assert_allclose(runs.first["target"], target[:, 0], atol=1e-12)
    assert np.isnan(runs.quantities["localization"]).all()


LONG = (
    "time.dt=0.02",
    "time.duration=6",
    "target.latencies=[0.2,0.1]",
    "target.intensity=1e-6",
    "formation.spread=0.5",
)


CERTAIN = 'agents.parameters.target={fusion="none",prior_derivatives=0.02}'


def test_in_flight_agents_surround_the_target():
    run = rehearse(plan_of(NAME, *LONG, CERTAIN))
    # The error is that of places about the target, and falls to that of its detection.
    assert run.error[0] > 0.2
    assert run.error[-1] < 0.05
    off = run.position - run.arrays["target"]
    np.testing.assert_allclose((off**2).sum(axis=-1).mean(axis=-1), run.error, rtol=1e-9)


def test_what_detectors_saw_is_in_the_arrays():
    run = rehearse(plan_of(NAME, *LONG, CERTAIN))
    dt, latencies, variances = run.plan.world.dt, np.array([0.2, 0.1]), run.plan.world.pursuit.target.variances
    seen = np.isfinite(run.arrays["sighting"]).all(axis=-1)
    assert (np.isfinite(run.arrays["sighting"]).any(axis=-1) == seen).all()
    # Detections follow each other without a pause, and each is where the target was when it began.
    target = (run.arrays["target"] - run.plan.world.formation.nominal)[:, 0]
    squares = []
    for agent in range(seen.shape[1]):
        done = np.flatnonzero(seen[:, agent])
        took = np.diff(np.concatenate([[0], done]))
        assert set(took.tolist()) == set(np.rint(latencies / dt).astype(int).tolist())
        off = run.arrays["sighting"][done, agent] - target[done - took]
        squares.append((off**2).mean(axis=1) / variances[np.argmin(np.abs(took[:, None] * dt - latencies), axis=1)])
    assert 0.85 < np.concatenate(squares).mean() < 1.15


def test_a_first_order_target_is_followed_by_single_integrators():
    run = rehearse(plan_of(NAME, *LONG, *SINGLE, ALONE, "target.order=1"))
    assert run.arrays["reference"].shape[2:] == (2, 2)
    assert run.error[-1] < 0.02 < run.error[0]


def test_in_three_dimensions_a_target_is_followed_too():
    solid = "formation={nodes=[[1,0,0],[-1,0,0.5],[0,1,2]],edges=['1-2','2-3'],leaders=[],spread=0.5}"
    run = rehearse(plan_of(NAME, *LONG[:-1], solid, CERTAIN))
    assert run.arrays["reference"].shape[1:] == (3, 3, 3)
    assert run.arrays["information"].shape[1:] == (3, 3, 9)
    assert run.error[-1] < 0.05 < 0.2 < run.error[0]


CALM = (
    *TRIPLE,
    FEW,
    "time.dt=0.01",
    "time.duration=3",
    "target={order=3,intensity=0,position=[0.1,-0.2],velocity=[0.02,-0.01],latencies=[0.5,0.4],variances=[1e-4,1e-4]}",
    'agents.parameters.target={fusion="none",prior_position=0.2,prior_derivatives=0.02,k=[24.0,50.0,35.0,10.0],'
    "gamma=[1.0,1.0,1.0,1.0]}",
)


def test_integrators_of_the_third_order_come_to_their_places_about_an_undisturbed_target():
    run = rehearse(plan_of(NAME, *CALM))
    assert run.arrays["reference"].shape[1:] == (3, 4, 2)
    assert run.error[0] > 5.0
    assert run.error[-1] < 0.005
    # Off the reference, they move as three poles at -3/s say.
    seconds, nominal = np.arange(300) * 0.01, run.plan.world.formation.nominal
    behind = run.position[:300] - nominal - run.arrays["reference"][:300, :, 0]
    left = (1 + 3 * seconds + 4.5 * seconds**2) * np.exp(-3 * seconds)
    np.testing.assert_allclose(behind, left[:, None, None] * behind[0], atol=0.1)


WHOLE = f"formation.edges={[f'{i}-{j}' for i, j in combinations(range(1, 11), 2)]}"
GRAPHS = {"ring": (), "whole": (WHOLE,)}


@cache
def fused_in_flight(graph, *air):
    """A flight, and the shares that each agent gives to what each has to say in every tick, shape (T, N, N)."""
    run = rehearse(plan_of(NAME, *COARSE, *GRAPHS[graph], MEAN, "time.duration=0.5", *air))
    links, told = run.plan.world.links, run.plan.channels.index(TARGET)
    heard = np.broadcast_to(np.eye(10), (50, 10, 10)).copy()
    heard[:, links.dst - 1, links.src - 1] = run.arrays["verdicts"][:, told] == Verdict.DELIVERED
    return run.arrays, heard / heard.sum(axis=-1, keepdims=True)


@pytest.mark.parametrize("air", [(), ("network.availability=0.7",)], ids=["clear", "lossy"])
@pytest.mark.parametrize("graph", GRAPHS)
def test_the_mean_is_that_of_an_agents_own_information_and_of_what_it_hears_in_the_tick(graph, air):
    arrays, shares = fused_in_flight(graph, *air)
    degrees = np.unique((shares > 0).sum(axis=-1))
    if air:
        assert set(degrees) >= {1, 2, 3} if graph == "ring" else len(degrees) > 4
    else:
        assert degrees.tolist() == ([3] if graph == "ring" else [10])
    information, fused = arrays["information"], arrays["fused"]
    assert information.shape == (50, 10, 3, 7)
    size = np.abs(information).max(axis=(0, 1))
    np.testing.assert_allclose(fused / size, np.einsum("tij,tjmc->timc", shares, information / size), atol=1e-12)
    np.testing.assert_allclose(arrays["reference"][:, :, 0], position(fused[:, :, 0], 2, 2), rtol=1e-9, atol=1e-12)
    assert np.abs(information - fused).max() > 0.1 * size.max()


def test_who_hears_everybody_finds_all_that_is_known_and_others_do_not():
    apart = {}
    for graph in GRAPHS:
        arrays, _ = fused_in_flight(graph)
        ideal = position(arrays["information"][:, :, 0].mean(axis=1, keepdims=True), 2, 2)
        apart[graph] = np.abs(arrays["reference"][:, :, 0] - ideal).max()
    assert apart["whole"] < 1e-12
    assert apart["ring"] > 0.1
    runs = fly_all(plan_of(NAME, *COARSE, WHOLE, MEAN, "time.duration=0.3"), [3, 4], every=5)
    assert runs.quantities["apart"].max() < 1e-12 < runs.quantities["ideal"].max()


def test_with_the_mean_derivatives_are_the_agents_own_where_wanted():
    short = (*COARSE, "time.duration=0.3")
    agreed, own, alone = (
        rehearse(plan_of(NAME, *short, f"agents.parameters.target={{{how}}}")).arrays["reference"]
        for how in ('fusion="mean"', 'fusion="mean",derivatives="own"', 'fusion="none"')
    )
    np.testing.assert_array_equal(own[:, :, 0], agreed[:, :, 0])
    np.testing.assert_array_equal(own[:, :, 1:], alone[:, :, 1:])
    assert np.abs(agreed - own)[:, :, 1:].max() > 0.1
    assert np.abs(own - alone)[:, :, 0].max() > 0.1


@PROCESSES
@pytest.mark.parametrize(
    ("name", "overrides"),
    [
        (NAME, (*COARSE, "time.duration=0.5", "network.availability=0.9")),
        (NAME, (*COARSE, MEAN, FEW, "time.duration=0.3", "network.availability=0.7")),
        (NAME, (*CALM, "time.duration=0.3", "network.availability=0.7")),
        ("localization", ("time.duration=0.5", "network.availability=0.5")),
    ],
    ids=["target", "mean", "triple-integrators", "localization"],
)
def test_processes_give_the_bits_of_one_process(name, overrides, out):
    outcome = fly(plan_of(name, *overrides), "processes", out, lambda *_: None)
    assert outcome.verdict == "pass", outcome.reasons
    assert outcome.digest == digest_of(name, *overrides)
    # Losses that do nothing agree as well.
    assert outcome.digest != digest_of(name, *overrides[:-1])
