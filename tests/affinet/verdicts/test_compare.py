"""Two runs are compared bit by bit, and the first difference is named."""

import json

import numpy as np
import pytest
from flying import PROCESSES, plan_of

from affinet.cli import commands
from affinet.runtimes.rehearsing import rehearse
from affinet.runtimes.run import fly
from affinet.verdicts.compare import first_difference
from netem.medium.verdict import Verdict
from world.books import history

pytestmark = PROCESSES

PLAN = plan_of("corridor", "time.duration=0.5")


@pytest.fixture(scope="module")
def arrays():
    return rehearse(PLAN).arrays


def compared(arrays, **changes):
    other = {name: array.copy() for name, array in arrays.items()}
    for name, (index, value) in changes.items():
        other[name][index] = value
    return first_difference(arrays, other, PLAN.world.links, PLAN.channels)


def test_a_run_is_like_itself(arrays):
    assert compared(arrays) is None
    assert np.isnan(arrays["psi"]).any()


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"input": ((7, 3, 1), 0.25)}, "tick 7: input of agent 4 is "),
        ({"psi": ((0, 6), np.nan), "position": ((9, 0, 0), 0.0)}, "tick 0: psi of agent 7 is "),
        ({"newest": ((5, 2, 1), 77), "estimate": ((5, 0, 0, 0), 9.0)}, "tick 5: newest of measurement on 3->1 is "),
        (
            {"verdicts": ((3, 0, 0), Verdict.DEAD), "newest": ((3, 0, 0), 9)},
            "tick 3: verdicts of sense on 2->1 is delivered ",
        ),
        ({"error": (12, 8.0)}, "tick 12: error is "),
        ({"measured": ((4, 1, 1), 9.5)}, "tick 4: measured of 3->1 is "),
        ({"measured": ((4, 6, 0), 9.5), "verdicts": ((4, 0, 0), Verdict.DEAD)}, "tick 4: measured of "),
        ({"measured": ((4, 6, 0), 9.5), "position": ((4, 6, 0), 9.5)}, "tick 4: position of agent 7 is "),
    ],
)
def test_the_first_difference_is_named(changes, named, arrays):
    assert str(compared(arrays, **changes)).startswith(named)


def test_what_estimators_report_is_compared_too(arrays):
    reporting = arrays | {"reference": np.zeros((50, 7, 2))}
    difference = compared(reporting, reference=((8, 2, 1), 1.0), input=((8, 0, 0), 1.0))
    assert str(difference) == "tick 8: reference of agent 3 is 0.0 in one run and 1.0 in the other"


def test_one_nan_is_like_another(arrays):
    one, other = ({**arrays, "psi": np.where(np.isnan(arrays["psi"]), nan, arrays["psi"])} for nan in (np.nan, -np.nan))
    assert one["psi"].tobytes() != other["psi"].tobytes()
    assert first_difference(one, other, PLAN.world.links, PLAN.channels) is None
    assert history.digest(one) == history.digest(other) == history.digest(arrays)


def test_links_that_measured_otherwise_are_named_by_their_ends(arrays):
    for link, (src, dst) in enumerate(zip(PLAN.world.links.src, PLAN.world.links.dst, strict=True)):
        here = arrays["measured"][9, link, 1].item()
        difference = compared(arrays, measured=((9, link, 1), 77.0))
        assert str(difference) == f"tick 9: measured of {src}->{dst} is {here!r} in one run and 77.0 in the other"


def test_zero_is_not_negative_zero(arrays):
    zero = {name: array.copy() for name, array in arrays.items()} | {"error": np.zeros(50)}
    assert compared(zero, error=(20, -0.0)).tick == 20


def test_a_shorter_run_differs_where_it_ends(arrays):
    shorter = {name: array[:30] for name, array in arrays.items()}
    difference = first_difference(arrays, shorter, PLAN.world.links, PLAN.channels)
    assert (difference.tick, difference.quantity) == (30, "the run")


def test_a_replay_is_compared_with_what_was_flown(out, tmp_path, capsys):
    fly(PLAN, "inprocess", out, lambda *_: None)
    again = ["replay", str(out), "--runtime", "inprocess", "--json", "--out"]
    assert commands.main([*again, str(tmp_path / "same")]) == 0
    assert "the same bits as" in capsys.readouterr().err
    told = json.loads((out / "scenario.json").read_text())
    (out / "scenario.json").write_text(json.dumps(told | {"seed": 5}))
    assert commands.main([*again, str(tmp_path / "other")]) == 1
    assert "tick 0: position of agent 4 is" in capsys.readouterr().err
    assert history.load(tmp_path / "other" / history.ARRAYS)["error"].shape == (50,)


def test_determinism_is_checked_in_both_runtimes(capsys):
    assert commands.main(["check-determinism", "corridor", "--duration", "0.5"]) == 0
    assert "50 ticks, the same bits" in capsys.readouterr().out
