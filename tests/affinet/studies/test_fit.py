"""`affinet fit`: from a run that was flown, the model of its inputs, as overrides that fly."""

import json
import shutil
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import pytest
from flying import plan_of
from kept_arrays import rewrite

from affinet.cli import commands
from affinet.planning import making
from affinet.runtimes.run import fly
from affinet.scenario import loading
from world.books import history

TINY = ("time.dt=0.05", "time.duration=2", "record.enabled=false")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("fit") / "run"
    fly(plan_of("corridor", *TINY), "inprocess", out, lambda *_: None)
    return out


@pytest.fixture
def changed(flown, tmp_path):
    """The run with other inputs."""

    def change(of_inputs):
        shutil.copytree(flown, tmp_path / "changed")
        arrays = history.load(flown / history.ARRAYS)
        rewrite(tmp_path / "changed" / history.ARRAYS, arrays | {"input": of_inputs(arrays["input"])})
        return tmp_path / "changed"

    return change


def told(directory, *options):
    """The model of a run."""
    with redirect_stdout(StringIO()) as printed:
        assert commands.main(["fit", str(directory), "--json", *options]) == 0
    return json.loads(printed.getvalue())


def moments(inputs, most):
    """R_u(0) to R_u(most), over all axes of all agents, each divided by all ticks."""
    flat = inputs.reshape(len(inputs), -1)
    return [sum(float(flat[t] @ flat[t - lag]) for t in range(lag, len(flat))) / flat.size for lag in range(most + 1)]


def refused(capsys, *arguments):
    """The one line in which it is said what is wrong."""
    assert commands.main(["fit", *map(str, arguments)]) == 2
    printed = capsys.readouterr()
    assert not printed.out
    (line,) = printed.err.splitlines()
    return line


def test_the_model_is_that_of_the_inputs_flown(flown):
    R0, R1 = moments(history.load(flown / history.ARRAYS)["input"], 1)
    model = told(flown)
    assert set(model) == {"coefficients", "sigma_n", "sigma_u"}
    assert model["coefficients"] == pytest.approx([R1 / R0])
    assert model["sigma_u"] == pytest.approx(np.sqrt(R0))
    assert model["sigma_n"] == pytest.approx(np.sqrt(R0 - R1**2 / R0))
    assert 0.0 < model["sigma_n"] < model["sigma_u"]


def test_a_model_of_order_two_solves_two_equations(flown):
    R0, R1, R2 = moments(history.load(flown / history.ARRAYS)["input"], 2)
    a = np.linalg.solve([[R0, R1], [R1, R0]], [R1, R2])
    model = told(flown, "--order", "2")
    np.testing.assert_allclose(model["coefficients"], a, rtol=1e-9)
    assert model["sigma_n"] == pytest.approx(np.sqrt(R0 - a @ [R1, R2]))
    assert model["sigma_u"] == pytest.approx(np.sqrt(R0))


@pytest.mark.parametrize(
    ("order", "filters"), [(1, ["edge-kf", "joint-kf", "silent-kf"]), (2, ["edge-kf", "joint-kf"])]
)
def test_it_prints_overrides_that_fly(order, filters, flown, capsys):
    model = told(flown, "--order", str(order))
    assert commands.main(["fit", str(flown), "--order", str(order)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("=")[0] for line in lines] == [f"agents.parameters.{name}" for name in filters]
    for name in filters:
        given = loading.load("corridor", [*TINY, *lines, f'agents.estimator="{name}"'])
        estimator = making.make(given).estimator.build()
        if name == "silent-kf":
            assert estimator.coefficient == pytest.approx(model["coefficients"][0], rel=1e-5)
            assert estimator.sigma_u == pytest.approx(model["sigma_u"], rel=1e-5)
        else:
            np.testing.assert_allclose(estimator.coefficients, model["coefficients"], rtol=1e-5)
            assert estimator.sigma_n == pytest.approx(model["sigma_n"], rel=1e-5)


def test_without_json_nothing_but_overrides_is_printed_and_with_it_one_object(flown, capsys):
    assert commands.main(["fit", str(flown)]) == 0
    plain = capsys.readouterr()
    assert commands.main(["fit", str(flown), "--json"]) == 0
    whole = capsys.readouterr()
    assert len(plain.out.splitlines()) == 3
    assert len(whole.out.splitlines()) == 1
    assert len(json.loads(whole.out)["coefficients"]) == 1
    assert plain.err == whole.err == ""


@pytest.mark.parametrize("size", [1e-7, 1e7])
def test_overrides_of_small_and_large_inputs_fly_too(size, changed, capsys):
    assert commands.main(["fit", str(changed(lambda inputs: size * inputs))]) == 0
    lines = capsys.readouterr().out.splitlines()
    for name in ("edge-kf", "silent-kf"):
        making.make(loading.load("corridor", [*TINY, *lines, f'agents.estimator="{name}"']))


def test_what_is_no_number_any_more_is_left_out(changed, flown):
    def diverging(inputs):
        inputs[30:, 2] = np.nan
        return inputs

    R0, R1 = moments(history.load(flown / history.ARRAYS)["input"][:30], 1)
    model = told(changed(diverging))
    assert model["coefficients"] == pytest.approx([R1 / R0])
    assert model["sigma_u"] == pytest.approx(np.sqrt(R0))


def test_a_directory_without_a_run_is_named(tmp_path, capsys):
    assert str(tmp_path / "nowhere") in refused(capsys, tmp_path / "nowhere")
    assert str(tmp_path) in refused(capsys, tmp_path)


def test_a_run_that_left_no_arrays_is_named(flown, tmp_path, capsys):
    shutil.copy(flown / loading.FILE, tmp_path)
    assert refused(capsys, tmp_path).startswith(f"{tmp_path}: ")


def test_a_run_in_which_nothing_moves_has_no_model(changed, capsys):
    directory = changed(np.zeros_like)
    assert refused(capsys, directory) == f"{directory}: the inputs are zero throughout: there is nothing to fit"


def test_a_run_too_short_for_the_order_is_refused(flown, capsys):
    line = refused(capsys, flown, "--order", "40")
    assert line == f"{flown}: a model of order 40 needs more than 40 ticks, not 40"


def test_double_integrators_are_refused(out, capsys):
    fly(plan_of("ravine", "time.duration=0.1", "record.enabled=false"), "inprocess", out, lambda *_: None)
    line = refused(capsys, out)
    assert line.startswith(f"{out}: what its double-integrators are given is not their velocity")


@pytest.mark.parametrize("order", ["0", "-1", "1.5", "two"])
def test_an_order_counts_ticks(order, flown, capsys):
    with pytest.raises(SystemExit) as ended:
        commands.main(["fit", str(flown), f"--order={order}"])
    assert ended.value.code == 2
    assert "give a whole number, at least 1" in capsys.readouterr().err
