"""Runs beside each other: what differs in their settings, what came of them, and where they part."""

import json
import re

import numpy as np
import pytest
from flying import plan_of
from matplotlib.image import imread

from affinet.cli.commands import main
from affinet.runtimes.run import fly
from world.books.history import ARRAYS, load

SHORT = ("time.dt=0.05", "time.duration=2", "record.enabled=false")
CUT = 'timeline=[{verb="cut",at=1.0,until=1.5,links=["6->4"]}]'


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for out, name, *overrides in (
        ("calm", "corridor"),
        ("again", "corridor"),
        ("cut", "corridor", CUT),
        ("rkf", "corridor", "agents.estimator=rkf"),
        ("longer", "corridor", "time.duration=2.5"),
        ("places", "localization"),
    ):
        fly(plan_of(name, *SHORT, *overrides), "inprocess", folder / out, lambda *_: None)
    return folder


@pytest.fixture
def compared(runs, capsys):
    def compared(*names):
        assert main(["compare", *(str(runs / name) for name in names), "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return compared


def test_equal_runs_differ_in_nothing(compared):
    said = compared("calm", "again")
    assert said["settings"] == {}
    assert said["parts"] == {"again": "the same bits as the first"}
    assert all(one == other for one, other in said["figures"].values())


def test_runs_part_in_the_tick_of_the_fault_at_the_link_that_it_cut(compared):
    said = compared("calm", "cut")
    assert list(said["settings"]) == ["timeline"]
    tick = int(said["parts"]["cut"].split()[1].rstrip(":"))
    assert 20 <= tick < 30
    assert re.search(
        r"verdicts of sense on 6->4 is (lost|delivered) in one run and cut in the other$", said["parts"]["cut"]
    )


def test_runs_part_where_their_arrays_do(compared, runs):
    tick = int(compared("calm", "cut")["parts"]["cut"].split()[1].rstrip(":"))
    one, other = (load(runs / name / ARRAYS) for name in ("calm", "cut"))
    unlike = [tick for tick in range(40) if not np.array_equal(one["verdicts"][tick], other["verdicts"][tick])]
    assert unlike[0] == tick


def test_estimators_that_speak_on_other_channels_are_compared_in_what_both_have(compared):
    said = compared("calm", "rkf")
    assert said["settings"] == {"agents.estimator": ["ga-rkf", "rkf"]}
    assert said["parts"]["rkf"].startswith("tick 0: ")
    assert "theta" not in said["parts"]["rkf"]


def test_a_longer_run_parts_at_the_end_of_the_shorter(compared):
    assert compared("calm", "longer")["parts"]["longer"] == (
        "tick 40: the run is 40 ticks long in one run and 50 ticks long in the other"
    )


def test_runs_of_other_formations_have_figures_alone(compared):
    said = compared("calm", "cut", "places")
    assert said["parts"]["places"].startswith("it is of another formation")
    assert said["figures"]["tracking error (m2), mean"][2] is None
    assert said["figures"]["localization error (m), final"][:2] == [None, None]
    assert said["runs"] == ["calm", "cut", "places"]


def test_values_are_whole_and_numbers_are_numbers(compared, runs):
    said = compared("calm", "cut")
    summaries = [json.loads((runs / name / "summary.json").read_text()) for name in ("calm", "cut")]
    for name, key in (("tracking error (m2), mean", "mean"), ("tracking error (m2), final", "final")):
        assert said["figures"][name] == [one["tracking_error"][key] for one in summaries]
    assert said["figures"]["messages delivered"] == [one["messages"]["delivered"] for one in summaries]
    assert said["figures"]["digest"] == [one["digest"] for one in summaries]
    before, after = said["settings"]["timeline"]
    assert before == []
    assert (after[0]["verb"], after[0]["links"]) == ("cut", ["6->4"])


def test_a_table_is_printed_and_a_picture_drawn(runs, tmp_path, capsys):
    out = tmp_path / "errors.png"
    assert main(["compare", str(runs / "calm"), str(runs / "rkf"), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "settings that differ" in told
    assert "agents.estimator" in told
    assert imread(out).std() > 0.05


@pytest.mark.parametrize(
    ("names", "options", "line"),
    [
        (["calm"], [], "affinet compare: give two run directories, or more"),
        (["calm", "again"], ["--out", "x.gif"], "--out x.gif: give a name that ends in .png, .pdf, .svg"),
        (["calm", "nowhere"], [], "nowhere"),
    ],
)
def test_what_cannot_be_compared_is_refused(names, options, line, runs, capsys):
    assert main(["compare", *(str(runs / name) for name in names), *options]) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert line in said
