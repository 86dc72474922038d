"""`affinet new`: what it writes works at once, in a folder of its own, and nothing is overwritten."""

import subprocess
import sys
import tomllib
from pathlib import Path

import jsonschema
import pytest
from flying import PROCESSES
from paths import ROOT

from affinet.cli.commands import main
from affinet.cli.options.beginning import BEGUN
from affinet.reference import schema
from affinet.scaffold import making

pytestmark = PROCESSES


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def affinet(*words, cwd):
    done = subprocess.run(
        [sys.executable, "-m", "affinet", *words], cwd=cwd, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def by_pytest(cwd, *words):
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(cwd), *words]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_kinds_are_those_of_the_command():
    assert tuple(making.KINDS) == BEGUN


def test_a_scenario_can_fly_and_does(folder, capsys):
    assert main(["new", "scenario", "maze"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        *("maze.toml", "affinet.schema.json", "", "then:"),
        *("  affinet check maze.toml", "  affinet run maze.toml --runtime inprocess"),
    ]
    assert main(["check", "maze.toml"]) == 0
    assert main(["run", "maze.toml", "--runtime", "inprocess", "--out", "run"]) == 0
    assert Path(folder, "run", "summary.json").exists()


def test_an_estimator_a_law_and_a_test_pass_beside_each_other(folder):
    for kind, name in (("estimator", "my-filter"), ("law", "my-law"), ("test", "losses")):
        making.make(kind, name, folder)
    assert "8 passed" in by_pytest(folder)
    for kind, name in (("estimator", "my_filter:MyFilter"), ("law", "my_law:MyLaw")):
        module = name.partition(":")[0]
        assert tomllib.loads((folder / f"{module}.toml").read_text())["agents"][kind] == name


@pytest.mark.slow
def test_tests_of_a_scaffold_fail_where_its_code_is_wrong(folder):
    making.make("estimator", "my-own", folder)
    code = (folder / "my_own.py").read_text()
    assert "state.relative + self.gain" in code
    (folder / "my_own.py").write_text(code.replace("state.relative + self.gain", "state.relative - self.gain"))
    with pytest.raises(AssertionError, match="2 failed"):
        by_pytest(folder)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["estimator", "law"])
def test_an_algorithm_flies_over_processes(kind, folder):
    making.make(kind, "my-own", folder)
    assert "pass" in affinet("run", "my_own.toml", "--duration", "0.5", "--set", "timeline=[]", cwd=folder)


def test_a_study_flies(folder):
    affinet("new", "study", "losses", cwd=folder)
    said = affinet("study", "losses.toml", "--quick", "--jobs", "1", cwd=folder)
    assert "holds" in said
    assert (folder / "studies" / "losses-quick" / "figure.png").exists()


def test_a_project_passes_its_tests_and_offers_what_it_flies(folder):
    making.make("project", "my-swarm", folder)
    home = folder / "my-swarm"
    assert "6 passed" in by_pytest(home)
    points = tomllib.loads((home / "pyproject.toml").read_text())["project"]["entry-points"]
    assert points == {
        "affinet.estimators": {"my-swarm-filter": "my_swarm.estimator:MySwarmFilter"},
        "affinet.controllers": {"my-swarm-law": "my_swarm.law:MySwarmLaw"},
    }


@pytest.mark.slow
def test_a_project_passes_over_processes(folder):
    making.make("project", "my-swarm", folder)
    assert "6 passed" in by_pytest(folder / "my-swarm", "--affinet-runtime=processes")


@pytest.mark.parametrize("kind", making.KINDS)
def test_all_of_it_is_in_order(kind, folder):
    files, then = making.make(kind, "my-own", folder)
    assert {file for file in folder.rglob("*") if file.is_file()} == set(files)
    assert not [file for file in files if "$" in file.read_text() and file.suffix != ".json"]
    assert then
    python = [str(file) for file in files if file.suffix == ".py"]
    rules = ("--isolated", "--line-length", "120")
    ruff = Path(sys.executable).with_name("ruff")
    if python:
        subprocess.run(
            [ruff, "check", *rules, "--select", "E,F,W,I,B,UP,D1", "--ignore", "D107,D103,D105", *python], check=True
        )
        subprocess.run([ruff, "format", *rules, "--check", *python], check=True)


@pytest.mark.parametrize("kind", ["scenario", "estimator", "law", "study", "project"])
def test_a_toml_file_names_its_schema_and_fits_it(kind, folder):
    files, _ = making.make(kind, "my-own", folder)
    named = [file for file in files if file.suffix == ".toml" and file.name != "pyproject.toml"]
    assert named
    for file in named:
        first = file.read_text().splitlines()[0]
        assert first.startswith("#:schema ./")
        beside = file.parent / first.removeprefix("#:schema ./")
        jsonschema.validate(
            tomllib.loads(file.read_text()),
            {schema.SCENARIO_FILE: schema.scenario, schema.STUDY_FILE: schema.study}[beside.name](),
        )
        assert beside in files


def test_nothing_is_overwritten_nor_half_written(folder, capsys):
    (folder / "test_my_own.py").write_text("mine\n")
    assert main(["new", "estimator", "my-own"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("test_my_own.py' is there already, and nothing was written; choose another name")
    assert [file.name for file in folder.iterdir()] == ["test_my_own.py"]
    assert (folder / "test_my_own.py").read_text() == "mine\n"


def test_a_schema_that_is_there_stays(folder):
    (folder / schema.SCENARIO_FILE).write_text("{}\n")
    files, _ = making.make("scenario", "maze", folder)
    assert [file.name for file in files] == ["maze.toml"]
    assert (folder / schema.SCENARIO_FILE).read_text() == "{}\n"


@pytest.mark.parametrize(
    ("kind", "name", "says"),
    [
        (
            "scenario",
            "My Maze",
            "'My Maze' is no name: give small letters, figures and dashes, like my-scenario",
        ),
        ("scenario", "../maze", "'../maze' is no name: "),
        ("estimator", "numpy", "numpy is a module already: choose another name, like my-numpy"),
        ("law", "lambda", "lambda is a word of Python: choose another name, like my-lambda"),
        ("estimator", "none", "its class would be None, which is taken: choose another name, like my-none"),
        ("estimator", "estimate", "its class would be Estimate, which is taken: choose another name, like my-estimate"),
        ("law", "true", "its class would be True, which is taken: choose another name, like my-true"),
        ("law", "false", "its class would be False, which is taken: choose another name, like my-false"),
        ("project", "json", "json is a module already: choose another name, like my-json"),
    ],
)
def test_a_name_that_will_not_do_is_one_line(kind, name, says, folder, capsys):
    assert main(["new", kind, name]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(says)
    assert list(folder.iterdir()) == []


def test_pytest_is_asked_for_where_it_is_not(folder, monkeypatch):
    _, then = making.make("project", "my-swarm", folder)
    assert then == ["cd my-swarm", "python -m pytest", "affinet run swarm.toml"]
    monkeypatch.setattr(making, "find_spec", lambda _: None)
    _, then = making.make("test", "losses", folder)
    assert then == ["python -m pip install pytest", "python -m pytest test_losses.py"]
    _, then = making.make("scenario", "maze", folder)
    assert not [line for line in then if "pytest" in line]


def test_every_template_is_used():
    used = {template for scaffold in making.KINDS.values() for template in scaffold.files.values()}
    templates = ROOT / "affinet" / "scaffold" / "templates"
    there = {str(file.relative_to(templates)).removesuffix(".template") for file in templates.rglob("*.template")}
    assert used == there
