"""The data of a study is one file of labelled arrays, of which nothing is made up, whole or not there."""

import os
import subprocess
import sys
from types import SimpleNamespace

import h5netcdf
import netcdf
import numpy as np
import pytest
from flying import PROCESSES

from affinet.cli import commands
from affinet.scenario.wrong import ScenarioError
from affinet.studies import labelled, record, study
from affinet.studies.batch import Runs
from affinet.studies.executor import Here
from affinet.studies.quantities import NAMES, over_time
from affinet.studies.study import Axis, Result
from analysis.metrics.indicator import Bounds

pytestmark = PROCESSES

SMALL = """
title = "Small"
source = "paper 9, Fig. 9"
figure = "curves"
scenario = "corridor"
since = 0.2
set = ["time.dt=0.05", "time.duration=0.5", "agents.estimator=rkf", "seed=7"]
full = { runs = 2 }
quick = { runs = 2 }
skip = [{ law = "static", "mean burst (s)" = "2" }]
axes = [
  { name = "graph", values = { zhao7 = [] } },
  { name = "law", values = { static = ["agents.law=static", "agents.parameters={}"], varying = [] } },
  { name = "mean burst (s)", values = { "2" = [], "0.5" = ["network.availability=0.5"] } },
]
"""


def written(tmp_path, text, old="", new=""):
    assert old in text
    (tmp_path / "small.toml").write_text(text.replace(old, new) if old else text)
    return tmp_path / "small.toml"


def fly(file, out, *options):
    assert commands.main(["study", str(file), "--out", str(out), *(options or ("--jobs", "1"))]) == 0
    return out


@pytest.fixture
def small(tmp_path):
    """What it leaves."""
    return fly(written(tmp_path, SMALL), tmp_path / "out")


def made(axes, cases, quantities, seconds=(0.0, 0.5, 1.0), since=0.0, dt=0.5):
    """A study of these axes, and results for some of its labels: `quantities` of a case makes them, shape (R, T)."""
    said = study.load("bursts").model_copy(
        update={
            "axes": [Axis(name=name, values={label: [] for label in labels}) for name, labels in axes.items()],
            "since": since,
        }
    )
    results = []
    for number, labels in enumerate(cases):
        of_case = seconds if isinstance(seconds[0], float) else seconds[number]
        values = {name: np.asarray(rows, dtype=np.float64) for name, rows in quantities(number, len(of_case)).items()}
        world = SimpleNamespace(dt=dt, ticks=len(of_case))
        plan = SimpleNamespace(scenario=SimpleNamespace(seed=3), world=world)
        nothing = np.zeros((2, len(of_case), 0))
        runs = Runs(np.array(of_case), values["error"].mean(axis=1), nothing, Bounds(nothing, nothing), values, {})
        results.append(Result(dict(zip(axes, labels, strict=True)), plan, runs))
    return said, results


def numbered(number, moments):
    """Tracking errors of two runs that tell the case, the run and the moment."""
    return {"error": 100.0 * number + np.array([[0.0], [10.0]]) + np.arange(moments)}


def saved(tmp_path, said, results, about=()):
    labelled.write(tmp_path, said, results, dict(about))
    return netcdf.read(tmp_path)[0]


# ---- what is there


def test_axes_runs_and_moments_are_dimensions_with_their_values(small):
    variables, _ = netcdf.read(small)
    assert variables["law"].values.tolist() == ["static", "varying"]
    assert variables["mean burst (s)"].values.tolist() == [2.0, 0.5]
    assert variables["run"].values.tolist() == [7, 8]  # seeds
    np.testing.assert_allclose(variables["time"].values, np.arange(10) * 0.05)
    assert variables["tracking_error"].dimensions == ("graph", "law", "mean burst (s)", "run")
    for what in ("mean", "std"):
        assert variables[f"{what}_tracking_error"].dimensions == ("graph", "law", "mean burst (s)", "time")


def test_values_are_those_of_the_runs_at_their_labels(tmp_path):
    said = study.load(str(written(tmp_path, SMALL)))
    results = [*study.fly(study.plans(said, quick=False), 2, Here())]
    variables = saved(tmp_path, said, results)
    for place, one in zip([(0, 0, 1), (0, 1, 0), (0, 1, 1)], results, strict=True):
        for quantity, name in (("error", "tracking_error"), *((same, same) for same in ("nees", "peak", "roughness"))):
            values = one.runs.quantities[quantity]
            np.testing.assert_array_equal(variables[name].values[place], over_time(one.runs, quantity, (0.2, None)))
            np.testing.assert_array_equal(variables[f"mean_{name}"].values[place], values.mean(axis=0))
            np.testing.assert_array_equal(variables[f"std_{name}"].values[place], values.std(axis=0))


def test_what_only_some_cases_have_is_nan_in_the_others_and_what_none_has_is_left_out(tmp_path):
    def quantities(number, moments):
        there = {"report:age": np.full((2, moments), 4.0)} if number == 1 else {}
        nis = np.full((2, moments), np.nan if number == 0 else 2.0)
        return numbered(number, moments) | {"nees": np.full((2, moments), np.nan), "nis": nis} | there

    variables = saved(tmp_path, *made({"way": ["a", "b"]}, [("a",), ("b",)], quantities))
    assert not {"nees", "mean_nees", "std_nees"} & variables.keys()
    np.testing.assert_array_equal(variables["nis"].values, [[np.nan] * 2, [2.0] * 2])
    np.testing.assert_array_equal(variables["mean_report:age"].values, [[np.nan] * 3, [4.0] * 3])


def test_a_run_that_has_left_the_numbers_is_infinite(tmp_path):
    variables = saved(tmp_path, *made({}, [()], lambda *_: {"error": [[1.0, np.inf, np.inf], [1.0, 2.0, 3.0]]}))
    np.testing.assert_array_equal(variables["tracking_error"].values, [np.inf, 2.0])
    np.testing.assert_array_equal(variables["mean_tracking_error"].values, [1.0, np.inf, np.inf])
    np.testing.assert_array_equal(variables["std_tracking_error"].values, [0.0, np.nan, np.nan])


@pytest.mark.parametrize("quantity", NAMES)
def test_a_quantity_has_its_unit_and_says_what_of_it_is_there(quantity, tmp_path):
    def quantities(number, moments):
        return numbered(number, moments) | {quantity: np.ones((2, moments))}

    variables = saved(tmp_path, *made({}, [()], quantities, since=0.5))
    says, unit = NAMES[quantity]
    name = "tracking_error" if quantity == "error" else quantity
    over = {"peak": "maximum", "place_error": "root_mean_square"}.get(quantity)
    for prefix, words, method in (
        ("", "over time from 0.5 s on", f"time: {over or ''}"),
        ("mean_", "mean over the runs", "run: mean"),
        ("std_", "standard deviation over the runs", "run: standard_deviation"),
    ):
        attributes = variables[f"{prefix}{name}"].attributes
        assert attributes["units"] == (unit or "1")
        assert attributes["long_name"].startswith(f"{says}, ")
        assert attributes["long_name"].endswith(words)
        assert attributes["cell_methods"].startswith(method)


def test_nobody_but_who_reports_it_knows_the_unit_of_a_report(tmp_path):
    variables = saved(tmp_path, *made({}, [()], lambda *given: numbered(*given) | {"report:my_age": np.ones((2, 3))}))
    assert "units" not in variables["report:my_age"].attributes
    assert variables["report:my_age"].attributes["long_name"] == "my age, mean over time"
    assert variables["time"].attributes["units"] == variables["tick_length"].attributes["units"] == "s"


def test_the_file_says_of_what_study_it_is(small):
    _, says = netcdf.read(small)
    assert (says["title"], says["source"], says["scenario"]) == ("Small", "paper 9, Fig. 9", "corridor")
    assert (says["study"], says["size"], says["since"]) == ("small", "full", 0.2)
    assert says["flown"] == record.read(small / record.FILE).flown
    assert says["numpy"] == np.__version__
    assert {"affinet", "python", "scipy"} <= says.keys()


# ---- what is not there


def test_cases_that_are_left_out_are_nan_and_no_others(small):
    variables, _ = netcdf.read(small)
    for name in ("tracking_error", "mean_tracking_error", "std_tracking_error"):
        there = np.isfinite(variables[name].values)
        assert not there[0, 0, 0].any()
        assert there[0, 0, 1].all()
        assert there[0, 1].all()


def test_a_study_that_has_not_come_far_has_all_its_labels(tmp_path):
    said, results = made({"x": ["1", "2"], "way": ["a", "b"]}, [("1", "a"), ("1", "b")], numbered)
    variables = saved(tmp_path, said, results[1:])
    assert variables["x"].values.tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(
        variables["tracking_error"].values, [[[np.nan] * 2, [101.0, 111.0]], [[np.nan] * 2, [np.nan] * 2]]
    )


def test_cases_with_other_moments_have_times_of_their_own(tmp_path):
    moments = [(0.0, 1.0), (0.0, 0.5, 1.0)]
    variables = saved(tmp_path, *made({"way": ["a", "b", "c"]}, [("a",), ("c",)], numbered, moments))
    assert variables["time"].dimensions == ("way", "moment")
    np.testing.assert_array_equal(variables["time"].values, [[0.0, 1.0, np.nan], [np.nan] * 3, [0.0, 0.5, 1.0]])
    means = [[5.0, 6.0, np.nan], [np.nan] * 3, [105.0, 106.0, 107.0]]
    np.testing.assert_array_equal(variables["mean_tracking_error"].values, means)
    np.testing.assert_array_equal(variables["tick_count"].values, [2.0, np.nan, 3.0])
    assert variables["tick_length"].values == 0.5  # of all
    assert variables["mean_tracking_error"].attributes["coordinates"].split() == ["time", "tick_length", "tick_count"]
    assert variables["tracking_error"].attributes["coordinates"].split() == ["tick_length", "tick_count"]


# ---- labels and names


@pytest.mark.parametrize(
    ("labels", "values"),
    [
        (["0.5", "1", "1e1"], [0.5, 1.0, 10.0]),
        (["-1", "0"], [-1.0, 0.0]),
        (["1", "none"], ["1", "none"]),
        (["1", "1.0"], ["1", "1.0"]),  # which are two
        (["nan", "1"], ["nan", "1"]),
        (["inf", "1"], ["inf", "1"]),
        (["true", "false"], ["true", "false"]),
        (["[1, 2]", "{ a = 1 }"], ["[1, 2]", "{ a = 1 }"]),
        (["", "a/b", "α, 10 %"], ["", "a/b", "α, 10 %"]),
    ],
)
def test_labels_are_numbers_if_all_are_and_words_otherwise(labels, values, tmp_path):
    said, results = made({"x": labels}, [(label,) for label in labels], numbered)
    variables = saved(tmp_path, said, results)
    assert variables["x"].values.tolist() == values
    assert variables["tracking_error"].values[:, 0].tolist() == [100.0 * number + 1.0 for number in range(len(labels))]


@pytest.mark.parametrize("name", ["a/b", "", " a", "a ", "(s)", ".", "a\\tb", "a\\u0000"])
def test_an_axis_whose_name_netcdf_has_not_is_refused_before_anything_flies(name, tmp_path):
    file = written(tmp_path, SMALL, 'name = "graph"', f'name = "{name}"')
    with pytest.raises(
        ScenarioError, match=r"axes\.1\.name: netCDF has no name .*: a letter, a digit or _ first, no /"
    ):
        study.load(str(file))


@pytest.mark.parametrize("name", ["T", "mean burst (s)", "σ_prior", "Größe", "2", "a.b", "_x"])
def test_names_that_netcdf_has_are_read_as_they_were_given(name, tmp_path):
    assert labelled.is_name(name)
    variables = saved(tmp_path, *made({name: ["a"]}, [("a",)], numbered))
    assert variables["tracking_error"].dimensions == (name, "run")
    assert variables[name].values.tolist() == ["a"]


@pytest.mark.parametrize(
    "name", ["run", "time", "moment", "tick_length", "tick_count", "tracking_error", "std_nees", "report:age"]
)
def test_an_axis_is_called_like_nothing_else_in_the_file(name, tmp_path):
    with pytest.raises(
        ScenarioError, match=r"axes\.1\.name: '.*' is a name in the data already: give the axis another"
    ):
        study.load(str(written(tmp_path, SMALL, 'name = "graph"', f'name = "{name}"')))


def test_every_name_in_the_file_is_taken(small):
    variables, _ = netcdf.read(small)
    others = {"graph", "law", "mean burst (s)"}
    assert {name for name in variables.keys() - others if "report:" not in name} <= labelled.taken()


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("zhao7 = []", '"zhao\\u0000" = []', r"axes\.1\.values"),
        ('"Small"', '"Small\\u0000"', "title"),
        ('"paper 9, Fig. 9"', '"\\u0000"', "source"),
    ],
)
def test_text_that_netcdf_cannot_keep_is_refused(old, new, key, tmp_path):
    with pytest.raises(
        ScenarioError, match=rf"{key}: '.*' has the character 0, which netCDF cannot keep: leave it out"
    ):
        study.load(str(written(tmp_path, SMALL, old, new)))


def test_cases_that_would_fly_with_other_seeds_are_refused(tmp_path):
    loaded = study.load(str(written(tmp_path, SMALL, "varying = []", 'varying = ["seed=9"]')))
    with pytest.raises(
        ScenarioError, match=r"axes: all cases fly with the same seeds.* has the seed 7, .* 9: leave it"
    ):
        study.plans(loaded, quick=True)


# ---- whole, and the same wherever it flew


def test_it_is_whole_or_not_there(tmp_path, monkeypatch):
    said, results = made({"x": ["1"]}, [("1",)], numbered)
    labelled.write(tmp_path, said, results, {})
    before = (tmp_path / labelled.FILE).read_bytes()

    def no_room(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(h5netcdf.File, "create_variable", no_room)
    with pytest.raises(OSError, match="No space"):
        labelled.write(tmp_path, said, results, {"more": "words"})
    assert (tmp_path / labelled.FILE).read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == [labelled.FILE]


def test_two_processes_and_another_interpreter_leave_the_same_bytes(small, tmp_path):
    file = tmp_path / "small.toml"
    two = fly(file, tmp_path / "two", "--jobs", "2")
    command = [sys.executable, "-m", "affinet", "study", str(file), "--out", str(tmp_path / "other"), "--jobs", "1"]
    environment = os.environ | {"PYTHONHASHSEED": "5", "TZ": "Asia/Tokyo"}
    subprocess.run(command, env=environment, capture_output=True, check=True, timeout=300)
    one = (small / labelled.FILE).read_bytes()
    assert (two / labelled.FILE).read_bytes() == (tmp_path / "other" / labelled.FILE).read_bytes() == one


def test_who_flies_imports_nothing_of_it():
    code = "import sys, affinet, affinet.cli.studying; print({'h5py', 'h5netcdf', 'xarray', 'pandas'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.strip() == "set()"


# ---- xarray


def test_xarray_opens_it_by_its_labels(small):
    import xarray

    with xarray.open_dataset(small / labelled.FILE) as results:
        variables, _ = netcdf.read(small)
        chosen = results.tracking_error.sel({"graph": "zhao7", "law": "static", "mean burst (s)": 0.5})
        np.testing.assert_array_equal(chosen.values, variables["tracking_error"].values[0, 0, 1])
        assert chosen.sel(run=8).item() == chosen.values[1]
        curve = results.mean_tracking_error.sel(law="varying").sel(time=0.31, method="nearest")
        np.testing.assert_array_equal(curve.values, variables["mean_tracking_error"].values[:, 1, :, 6])
        assert results.mean_tracking_error.attrs["units"] == "m²"
        assert set(results.coords) == {"graph", "law", "mean burst (s)", "run", "time", "tick_length", "tick_count"}
        assert results.tick_length.item() == 0.05
        assert results.time.dtype == np.float64


def test_xarray_finds_the_times_of_each_case(tmp_path):
    import xarray

    (tmp_path / "out").mkdir()
    file = written(tmp_path, SMALL, "varying = []", 'varying = ["time.dt=0.025"]')
    out = fly(file, tmp_path / "out")
    with xarray.open_dataset(out / labelled.FILE) as results:
        labels = {"graph": "zhao7", "mean burst (s)": 0.5}
        static, varying = (results.mean_tracking_error.sel(law=law, **labels) for law in ("static", "varying"))
        assert "time" in results.coords
        np.testing.assert_allclose(static.time.dropna("moment"), np.arange(10) * 0.05)
        np.testing.assert_allclose(varying.time, np.arange(20) * 0.025)
        assert static.notnull().sum() == 10
        assert (static.tick_length.item(), varying.tick_length.item(), varying.tick_count.item()) == (0.05, 0.025, 20)
