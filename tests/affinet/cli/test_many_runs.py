"""`affinet run --seeds` and `--sweep`: every run is the one that is flown alone, and the table says what they came to."""

import json

import numpy as np
import pytest
from flying import plan_of
from own_code import LAW, broken, write
from scipy import stats

from affinet.cli.commands import main
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import loading
from affinet.scenario.wrong import ScenarioError
from affinet.studies import sweeping

SHORT = ("--duration", "0.5", "--set", "time.dt=0.05")


def told(capsys, *words):
    status = main([*words, "--json"])
    out, err = capsys.readouterr()
    return status, json.loads(out.splitlines()[-1]), err


def alone(seed, *overrides):
    return rehearse(plan_of("corridor", "time.duration=0.5", "time.dt=0.05", *overrides, f"seed={seed}"))


def test_runs_side_by_side_are_those_that_are_flown_alone(capsys):
    status, said, err = told(
        capsys, "run", "corridor", *SHORT, "--seeds", "3-6", "--sweep", "network.availability=0.3,1"
    )
    assert (status, err, said["seeds"], said["quantity"], said["unit"]) == (0, "", [3, 6], "tracking error", "m²")
    assert [setting["set"] for setting in said["settings"]] == [
        {"network.availability": "0.3"},
        {"network.availability": "1"},
    ]
    for setting in said["settings"]:
        flown = [alone(seed, f"network.availability={setting['set']['network.availability']}") for seed in range(3, 7)]
        assert setting["values"] == [run.error.mean() for run in flown]
        assert (setting["verdicts"], setting["alone"]) == ({"pass": 4}, None)


def test_the_interval_is_students(capsys):
    _, said, _ = told(capsys, "run", "corridor", *SHORT, "--seeds", "1-5")
    (setting,) = said["settings"]
    values = np.array(setting["values"])
    low, high = stats.t.interval(0.95, 4, loc=values.mean(), scale=stats.sem(values))
    assert (setting["low"], setting["mean"], setting["high"]) == pytest.approx((low, values.mean(), high), rel=1e-12)


def test_sweeps_combine_and_a_single_run_of_each_has_no_interval(capsys):
    sweeps = ("--sweep", "agents.estimator=none,rkf", "--sweep", "network.availability=0.5,1")
    _, said, _ = told(capsys, "run", "corridor", *SHORT, *sweeps, "--seed", "9")
    assert [list(setting["set"].values()) for setting in said["settings"]] == [
        *(["none", "0.5"], ["none", "1"], ["rkf", "0.5"], ["rkf", "1"])
    ]
    assert {setting["low"] for setting in said["settings"]} == {None}
    (value,) = said["settings"][2]["values"]
    assert value == alone(9, "agents.estimator=rkf", "network.availability=0.5").error.mean()
    assert main(["run", "corridor", *SHORT, *sweeps]) == 0
    assert "interval" not in capsys.readouterr().out


CUT = "timeline=[{ verb = 'cut', at = %s, links = ['2-4'] }]"


def test_faults_are_asked_of_each_run_by_itself(capsys):
    status, said, err = told(capsys, "run", "corridor", *SHORT, "--seeds", "1-2", "--set", CUT % 0.1)
    (setting,) = said["settings"]
    assert (status, setting["verdicts"]) == (0, {"pass": 2})
    assert setting["values"] == [alone(seed, CUT % 0.1).error.mean() for seed in (1, 2)]
    assert (err, setting["alone"]) == ("", None)
    status, said, _ = told(capsys, "run", "corridor", *SHORT, "--seeds", "1-2", "--set", CUT % 2.0)
    assert (status, said["settings"][0]["verdicts"]) == (1, {"vacuous": 2})


def test_an_air_that_depends_on_places_is_flown_one_by_one(capsys):
    _, said, err = told(
        capsys, "run", "corridor", *SHORT, "--seeds", "1-2", "--sweep", "network.profile=perfect,range_disk"
    )
    assert [setting["alone"] is None for setting in said["settings"]] == [True, False]
    assert (
        err
        == "note: runs fly one by one, and not side by side: an air with loss by distance is not flown side by side\n"
    )


def test_a_check_is_part_of_the_verdict(capsys):
    level = alone(1).error.max()
    words = ("run", "corridor", *SHORT, "--seeds", "1-3")
    status, said, err = told(capsys, *words, "--check", f"bounded({level * 1.0001})")
    peaks = np.array([alone(seed).error.max() for seed in (1, 2, 3)])
    passed = int((peaks < level * 1.0001).sum())
    assert said["settings"][0]["verdicts"].get("pass", 0) == passed
    assert status == (0 if passed == 3 else 1)
    assert err == ""
    status, said, _ = told(capsys, *words, "--check", "bounded(1e-6)", "--runtime", "inprocess")
    assert (status, said["settings"][0]["verdicts"]) == (1, {"fail": 3})
    first = said["settings"][0]["first"]
    assert (first["seed"], first["verdict"]) == (1, "fail")
    assert first["says"].startswith("bounded(1e-06): fail: at 0 s (tick 0) it does not hold; the error is ")
    assert main([*words, "--check", "~eventually(error < 1e9)", "--sweep", "network.availability=0.5,1"]) == 1
    *_, line, last = capsys.readouterr().out.splitlines()
    assert line.startswith("seed 1, network.availability=0.5: fail: ~eventually((error < 1e+09)): fail: ")
    assert last.startswith("seed 1, network.availability=1: fail: ")


def test_a_swarm_that_leaves_the_numbers_fails(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    law = write(tmp_path, broken(LAW, (", -force", ", 1e200 * force")))
    status, said, err = told(capsys, "run", "corridor", *SHORT, "--set", f"agents.law={law}:Own", "--seeds", "1-2")
    assert (status, err, said["settings"][0]["verdicts"]) == (1, "", {"fail": 2})
    assert (said["settings"][0]["values"], said["settings"][0]["mean"]) == ([None, None], None)


@pytest.mark.parametrize(
    ("scenario", "quantity"),
    [("localization", "distance from the optimal places"), ("target", "error of the target steered for")],
)
def test_what_matters_of_others_is_in_place_of_the_tracking_error(scenario, quantity, capsys):
    short = ("--set", "time.dt=0.01", "--duration", "0.2") if scenario == "target" else ("--duration", "1")
    _, said, _ = told(capsys, "run", scenario, *short, "--seeds", "1-2")
    assert said["quantity"] == quantity
    first = rehearse(
        plan_of(scenario, *(("time.dt=0.01", "time.duration=0.2") if scenario == "target" else ("time.duration=1",)))
    )
    (figures,) = [of for name, of in first.outcome.errors.items() if name in ("localization_error", "target_error")]
    assert said["settings"][0]["values"][0] == pytest.approx(figures["mean"], rel=1e-9)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--sweep", "network.availability"), "--sweep network.availability: write it as key=value,value, like "),
        (("--sweep", "network.availability=0.5,"), "--sweep network.availability=0.5,: write it as key=value,value"),
        (("--sweep", "network.availability=0.1,0.1"), "--sweep network.availability=0.1,0.1: 0.1 stands there twice"),
        (
            ("--sweep", "network.availability=0.1,0.10"),
            "--sweep network.availability=0.1,0.10: 0.10 stands there twice",
        ),
        (("--sweep", "agents.law='static',static"), "--sweep agents.law='static',static: static stands there twice"),
        (("--sweep", "seed=1,2"), "--sweep seed: the seeds of runs are given by --seeds, like --seeds 1-50"),
        (("--sweep", "seed =1,2", "--seeds", "1-2"), "--sweep seed: the seeds of runs are given by --seeds"),
        (("--sweep", '"seed"=1,2', "--seeds", "1-2"), "--sweep seed: the seeds of runs are given by --seeds"),
        (("--sweep", "time.dt=0.1,0.2", "--sweep", "time.dt=0.05"), "--sweep time.dt: it is swept twice; give all its"),
        (("--sweep", "time.dt=0.1,0.2", "--sweep", "time . dt=0.05"), "--sweep time.dt: it is swept twice"),
        (("--sweep", "time.dt=0.1,0.2", "--set", "time.dt=0.05"), "--sweep time.dt: time.dt=0.05 is given as well;"),
        (("--sweep", "time.dt=0.1,0.2", "--dt", "0.05"), "--sweep time.dt: time.dt=0.05 is given as well; leave one"),
        (("--seeds", "1-2", "--set", "seed=3"), "--seeds and a seed: give the one or the other"),
        (
            ("--sweep", "network.availabilty=0.5,1"),
            "override: network.availabilty: unknown key; did you mean 'availability'?",
        ),
        (("--seeds", "1-2", "--seed", "3"), "--seeds and a seed: give the one or the other"),
        (("--seeds", "1-2", "--out", "x"), "--out is of one run, and --seeds, --sweep and --check fly many"),
        (("--seeds", "1-2", "--runtime", "processes"), "--runtime processes is of one run"),
        (("--seeds", "1-2", "--serve"), "--serve is of one run"),
        (("--check", "bounded"), "invariant 'bounded': bounded is written with what it wants"),
    ],
)
def test_what_cannot_be_flown_is_one_line(words, says, capsys):
    assert main(["run", "corridor", *SHORT, *words]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(says)


@pytest.mark.parametrize("seeds", ["5-1", "a-b", "-3", "1-", f"1-{2**64}"])
def test_seeds_that_are_none_are_refused(seeds, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["run", "corridor", f"--seeds={seeds}"])
    assert ended.value.code == 2
    assert repr(seeds) in capsys.readouterr().err


def test_commas_in_brackets_and_quotes_part_no_values():
    assert sweeping.values_of("a.b=1,2") == ("a.b", ["1", "2"])
    assert sweeping.values_of("""x=[1, 2],{ y = "a,b" },'c,d'""") == ("x", ["[1, 2]", '{ y = "a,b" }', "'c,d'"])
    with pytest.raises(ScenarioError, match="write it as key=value"):
        sweeping.values_of("=1")


def test_plans_are_made_before_anything_flies():
    def load(overrides):
        return loading.load("corridor", ["time.duration=0.5", *overrides])

    plans = sweeping.planned(load, [("network.availability", ["0.5", "1"])], 7)
    assert [(labels, plan.scenario.seed) for labels, plan in plans] == [
        ({"network.availability": "0.5"}, 7),
        ({"network.availability": "1"}, 7),
    ]
    with pytest.raises(ScenarioError):
        sweeping.planned(load, [("network.availability", ["0.5", "2"])], None)
