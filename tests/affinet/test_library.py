"""`import affinet`: all that a user's code needs, light, typed and documented; runs flown and read again."""

import ast
import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from flying import PROCESSES, digest_of
from own_code import ESTIMATOR, broken, write

import affinet

ROOT = Path(affinet.__file__).parents[1]
SHORT = ("time.dt=0.05", "time.duration=1")
TYPES = {"Array", "Channels", "Fields", "Integers", "Mask", "Reading"}  # of annotations
NAMES = sorted(affinet.__all__)


# ---- what there is


def test_what_type_checkers_see_is_what_there_is():
    tree = ast.parse((ROOT / "affinet" / "__init__.py").read_text())
    block, _ = (node for node in tree.body if isinstance(node, ast.If))
    imported = [
        (node.module, alias.name) for node in block.body if isinstance(node, ast.ImportFrom) for alias in node.names
    ]
    tables = {f"{room}.{path}": names for (room, path), names in affinet._NAMES.items()}
    tables_of_modules = {(f"{room}.{path}".rpartition(".")[0], name) for name, (room, path) in affinet._MODULES.items()}
    assert {(module, name) for module, names in tables.items() for name in names} | tables_of_modules == set(imported)
    assert {name for _, name in imported} | {"__version__"} == set(NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_every_name_is_there_and_has_its_line_in_the_docs(name):
    held = getattr(affinet, name)
    assert f"`{name}" in (ROOT / "docs" / "library.md").read_text()
    assert name in TYPES | {"__version__"} or inspect.getdoc(held)
    assert getattr(affinet, name) is held


def test_no_name_would_be_taken_by_a_module_of_affinet_when_that_is_imported():
    within = {path.stem for path in (ROOT / "affinet").iterdir()} | {"agents", "analysis", "netem", "world"}
    assert within & set(NAMES) == {"scenario"}
    assert inspect.ismodule(affinet.scenario)


def test_the_functions_say_all_of_their_arguments():
    for function in (affinet.run, affinet.load, affinet.journal, affinet.realised):
        told = inspect.signature(function)
        assert all(one.annotation is not inspect.Parameter.empty for one in told.parameters.values())
        assert told.return_annotation is not inspect.Signature.empty


def test_what_is_not_there_is_said_as_of_any_module():
    with pytest.raises(AttributeError, match=r"^module 'affinet' has no attribute 'fly'$"):
        affinet.fly  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'fly' from 'affinet'"):
        exec("from affinet import fly")


def loaded(program):
    """The modules that a new process has after a program."""
    done = subprocess.run(
        [sys.executable, "-c", f"{program}\nimport sys; print(*sys.modules)"],
        capture_output=True,
        text=True,
        check=True,
    )
    return set(done.stdout.split())


def test_affinet_alone_loads_nothing():
    assert not loaded("import affinet") & {
        "numpy",
        "pydantic",
        "zenoh",
        "importlib.metadata",
        "affinet.rooms",
        "agents",
    }


def test_what_an_estimator_asks_for_does_not_load_the_application():
    needed = "Brief, Estimate, Estimator, Field, Heard, Law, Nothing, Own, Unsuited, algebra, elementary, no_indicator"
    modules = loaded(f"from affinet import {needed}")
    assert {"numpy", "agents.estimate"} <= modules
    assert not modules & {
        "pydantic",
        "scipy",
        "cvxpy",
        "zenoh",
        "matplotlib",
        "world",
        "affinet.scenario",
        "affinet.planning",
    }


def test_the_command_is_the_module():
    script = Path(sys.executable).with_name("affinet")
    said = [
        subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
        for command in ([script], [sys.executable, "-m", "affinet"])
    ]
    assert said == [f"affinet {affinet.__version__}\n"] * 2


# ---- the docs


def blocks():
    """Every piece of Python in the docs."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
    return [text for page in pages for text in re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)]


def test_users_are_told_to_import_from_affinet_alone():
    rooms = re.compile(r"^\s*(?:from|import) +((?:affinet\.|agents|analysis|netem|world).*)$", re.MULTILINE)
    assert len(blocks()) >= 7
    assert [found for text in [*blocks(), ESTIMATOR] for found in rooms.findall(text)] == []


def test_the_programs_of_the_docs_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    programs = [text for text in blocks() if "affinet.run(" in text and "def test_" not in text]
    assert len(programs) == 2
    for program in programs:
        exec(program, {})


# ---- runs


def test_a_run_in_process_leaves_nothing_and_has_the_bits_of_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = affinet.run("corridor", *SHORT).check(affinet.bounded(100.0))
    assert (run.outcome.verdict, run.outcome.digest) == ("pass", digest_of("corridor", *SHORT))
    assert affinet.run(affinet.scenario.load("corridor", SHORT)).outcome.digest == run.outcome.digest
    assert list(tmp_path.iterdir()) == []


WAITING = [
    {"verb": "cut", "links": ["1-2"], "at": 0.2, "until": 0.4},
    {"verb": "kill", "name": "gone", "when": {"tracking_error_below": 5.0, "lasting": 0.1}, "agents": [5]},
    {"verb": "restart", "after": "gone", "at": 0.2, "agents": [5]},
    {"verb": "cut", "links": ["6-7"], "when": {"tracking_error_below": 1e-9}},
]


@PROCESSES
@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_what_is_loaded_is_what_was_flown(runtime, out):
    given = affinet.scenario.extended(affinet.scenario.load("corridor", SHORT), WAITING)
    flown = affinet.run(given, runtime=runtime, out=out)
    again = affinet.load(out)
    assert again.bites == flown.bites
    assert flown.bites[1].at is not None
    assert flown.bites[-1].at is None
    loaded, said = json.loads(json.dumps(again.outcome.to_json())), json.loads((out / "summary.json").read_text())
    rounded = {"ticks_per_s", "real_time_factor"}  # of a time that is rounded itself
    assert {key for key in said if loaded[key] != said[key]} <= rounded
    assert all(np.array_equal(again.arrays[name], array, equal_nan=True) for name, array in flown.arrays.items())
    assert affinet.journal(out).num_rows > 0
    assert (affinet.realised(again).heard == affinet.realised(flown).heard).all()


@PROCESSES
def test_a_run_over_processes_needs_no_directory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert affinet.run("corridor", *SHORT, runtime="processes").outcome.digest == digest_of("corridor", *SHORT)
    assert list(tmp_path.iterdir()) == []


def test_overrides_of_what_is_read_already_are_refused():
    with pytest.raises(affinet.ScenarioError, match=r"^seed=3: give overrides where the scenario is read"):
        affinet.run(affinet.scenario.load("corridor"), "seed=3")


@PROCESSES
@pytest.mark.parametrize(
    "keys", [{}, {"out": "run"}, {"runtime": "processes"}], ids=["in process", "kept", "processes"]
)
def test_what_an_estimator_does_wrong_is_said_however_it_is_flown(keys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = write(tmp_path, broken(ESTIMATOR, ("return state, estimate", "return state, 1 / 0 if late else estimate")))
    with pytest.raises(affinet.Broken, match=rf"{name}:Own\.fuse in tick 7: ZeroDivisionError"):
        affinet.run("corridor", *SHORT, f"agents.estimator={name}:Own", "agents.law=rest", **keys)


DAMAGES = {
    "no run": (lambda out: [file.unlink() for file in out.iterdir() if file.is_file()], "no run that has ended"),
    "a text": (lambda out: (out / "summary.json").write_text("text"), "summary.json: not what a run wrote there"),
    "a list": (lambda out: (out / "summary.json").write_text("[]"), "summary.json: not what a run wrote there"),
    "no verdict": (lambda out: (out / "summary.json").write_text("{}"), "it has no 'verdict'"),
    "no arrays": (lambda out: (out / "arrays.npz").unlink(), "the run left no arrays.npz"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_directory_that_holds_no_whole_run_is_refused(damage, out):
    affinet.run("corridor", "time.duration=0.1", out=out)
    harm, says = DAMAGES[damage]
    harm(out)
    with pytest.raises(affinet.ScenarioError, match=says):
        affinet.load(out)
