"""REDCHO where neighbours fall silent, what is said of it before a flight, and the bench that looks for its limits."""

import runpy
import sys

import numpy as np
import pytest
from briefs import of_all
from flying import plan_of
from paths import BENCH
from scripted import timeline

from affinet.runtimes.rehearsing import rehearse
from affinet.scenario.wrong import ScenarioError
from agents.estimators.target import TargetEstimator
from analysis.models.information import position
from world.formation.nominal import PRESETS

NAME = "target"

# Those left


SIX = (
    "formation={nodes=[[1,0],[2,2],[0,3],[-2,2],[-3,0],[0,-2]],"
    "edges=['1-2','2-3','1-3','3-4','4-5','5-6','4-6','1-6'],leaders=[],spread=1.0}",
    "target.latencies=[0.2,0.1]",
)
FORGETFUL = "agents.parameters.target={theta=14.0,gamma=[10.0,10.0,10.0],derivatives='own'}"


def test_those_left_agree_on_what_they_know_when_one_dies_and_the_others_are_parted():
    silent = timeline(
        {"verb": "kill", "at": 0.5, "agents": [3]},
        {"verb": "partition", "at": 0.5, "groups": [[1, 2, 3], [4, 5, 6]]},
    )
    arrays = rehearse(plan_of(NAME, *SIX, FORGETFUL, silent, "time.duration=1.8")).arrays
    for part in ([0, 1], [3, 4, 5]):
        known = arrays["information"][500:, part, 0]  # since half a second after that
        ideal = position(known.mean(axis=1, keepdims=True), 2, 2)
        apart = np.abs(arrays["reference"][500:, part, 0] - ideal).max(axis=(1, 2))
        # Held for ever, what was said last has them off by one metre and more, and ever more.
        assert apart.max() < 0.15
        assert np.abs(arrays["found"][500:, part] - ideal).max() > 0.25
    # What the two parts know is not the same.
    both = [arrays["information"][500:, part, 0].mean(axis=1) for part in ([0, 1], [3, 4, 5])]
    assert np.abs(np.subtract(*(position(each, 2, 2) for each in both))).max() > 0.2


# Before a flight


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("theta=0.0", "REDCHO's gains must be above 0: theta 0.0"),
        ("k=[6.0,-11.0,6.0]", "REDCHO's gains must be above 0"),
        ("gamma=[1.0,1.0,0.0]", "REDCHO's gains must be above 0"),
        ("hold=-1", "hold is a number of ticks, not -1"),
    ],
)
def test_gains_and_holds_that_are_none_are_refused_in_one_line(given, says):
    with pytest.raises(ScenarioError) as told:
        plan_of(NAME, f"agents.parameters.target={{{given}}}")
    assert f"agents.parameters.target: {says}" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_hold_is_read_from_the_scenario():
    assert TargetEstimator().hold == 10
    assert plan_of(NAME, "agents.parameters.target.hold=0").estimator.build().hold == 0


def noted(check, *overrides):
    return [(found.level, found.says) for found in plan_of(NAME, *overrides).findings if found.check == check]


@pytest.mark.parametrize(
    ("given", "switched", "advised"),
    [
        # 6 * 14^3 * 0.002, and 6 * 8^3 * 0.002
        ("theta=14.0,derivatives='own'", "32.9", False),
        ("theta=14.0", "32.9", True),
        ("theta=8.0", "6.14", True),
        ("theta=4.0,k=[6.0,11.0,1.0]", "0.128", False),
        ("theta=2.0,k=[6.0,11.0,62.6]", "1", True),
        ("theta=2.0,k=[6.0,11.0,62.4]", "0.998", False),
    ],
)
def test_how_hard_redcho_switches_in_a_tick_is_told(given, switched, advised):
    ((level, says),) = noted("REDCHO", f"agents.parameters.target={{{given}}}")
    assert level == "note"
    assert says.startswith(
        f"REDCHO switches its highest derivative by {switched} a tick (k_m theta^3 dt; 0.4 in paper 002)"
    )
    assert says.endswith("; take the agents' own derivatives") == advised


def test_what_redcho_switches_is_of_the_order_of_the_target_and_of_no_other_fusion():
    third = TargetEstimator(theta=10.0, k=(24.0, 50.0, 35.0, 10.0), gamma=(1.0,) * 4)
    (found,) = third.checks(of_all(PRESETS["hexa10"], dt=1e-6))
    assert found.says == "REDCHO switches its highest derivative by 0.1 a tick (k_m theta^4 dt; 0.4 in paper 002)"
    for fusion in ("mean", "none"):
        assert noted("REDCHO", f'agents.parameters.target={{fusion="{fusion}"}}') == []


@pytest.mark.parametrize(
    ("late", "where"),
    [
        ("network.delay_ticks=1", "network.delay_ticks: up to 1 ticks"),
        ('time.exchange="next-tick"', "time.exchange: up to 1 ticks"),
        ('network.profile="acoustic"', "profile 'acoustic' (delay): without a bound"),
    ],
)
@pytest.mark.parametrize("fusion", ["redcho", "mean", "none"])
def test_information_that_is_heard_late_is_told_of(fusion, late, where):
    chosen = f'agents.parameters.target={{fusion="{fusion}"}}'
    says = f"information is heard late ({where}), and taken for that of this tick: the target is put where it was"
    assert noted("information", chosen, late) == ([] if fusion == "none" else [("note", says)])
    assert noted("information", chosen) == []


# The bench


LIMITS = BENCH / "redcho.py"


def bench(monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", [str(LIMITS), *arguments])
    runpy.run_path(str(LIMITS), run_name="__main__")


def test_the_bench_prints_a_row_for_each_step_and_gain(monkeypatch, capsys):
    bench(monkeypatch, "--steps", "1e-3,5e-4", "--thetas", "8", "--seconds", "1.01")
    head, rule, *rows = capsys.readouterr().out.splitlines()
    assert head.split(" | ")[0] == "| step (s)"
    assert set(rule) == {"|", "-"}
    numbers = np.array([[float(cell) for cell in row.strip("| ").split(" | ")] for row in rows])
    np.testing.assert_array_equal(numbers[:, :2], [[1e-3, 8.0], [5e-4, 8.0]])
    assert np.isfinite(numbers).all()
    # Positions are agreed on to millimetres, the closer the shorter the step.
    assert (numbers[1, 2:] > 0.0).all()
    assert (numbers[1, 2:] < numbers[0, 2:]).all()
    assert numbers[0, 2] < 5e-3


def test_the_bench_refuses_steps_that_are_longer_than_the_tick(monkeypatch, capsys):
    with pytest.raises(SystemExit) as ended:
        bench(monkeypatch, "--steps", "1e-4,2e-3")
    assert ended.value.code == 2
    assert "steps are at most 0.001 s, the tick of the flight" in capsys.readouterr().err
