"""`import affinet`: all that a user's code needs, light, typed and documented; runs flown and read again."""

import ast
import asyncio
import importlib
import inspect
import json
import pickle
import pydoc
import re
import shutil
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from flying import PROCESSES, digest_of
from kept_arrays import rewrite
from own_code import ESTIMATOR, LAW, broken, write

import affinet
from affinet.cli import commands
from affinet.scenario import overrides
from netem.medium.verdict import Verdict
from world.books.history import ARRAYS, load

ROOT = Path(affinet.__file__).parents[1]
SHORT = ("time.dt=0.05", "time.duration=1")
TYPES = {"Array", "Channels", "Fields", "Integers", "Mask"}  # of annotations
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


@pytest.mark.parametrize("kind", [affinet.Brief, affinet.Own])
def test_help_says_of_what_a_law_is_given_what_it_is_in_which_shape_and_unit(kind):
    page = pydoc.plain(pydoc.render_doc(kind))
    fields = re.findall(
        r"^ \|  (\w+)\n((?: \|      .*\n)+)", page.partition("----")[2].partition("Meth")[0], re.MULTILINE
    )
    assert {name for name, _ in fields} == {*kind.__annotations__}
    arrays = [(name, says) for name, says in fields if "Array" in str(kind.__annotations__[name])]
    assert len(arrays) >= 4
    for name, says in arrays:
        assert "(...," in says, name
        assert re.search(r"metres|without a unit", says), name


def test_help_says_what_a_reading_is():
    assert "What a clock says: ticks since take-off." in pydoc.render_doc(affinet.Reading)


def test_no_name_would_be_taken_by_a_module_of_affinet_when_that_is_imported():
    within = {path.stem for path in (ROOT / "affinet").iterdir()} | {"agents", "analysis", "netem", "world"}
    assert within & set(NAMES) == {"scenario"}
    assert inspect.ismodule(affinet.scenario)


def test_the_functions_say_all_of_their_arguments():
    for function in (affinet.run, affinet.load, affinet.journal, affinet.realised):
        told = inspect.signature(function)
        assert all(one.annotation is not inspect.Parameter.empty for one in told.parameters.values())
        assert told.return_annotation is not inspect.Signature.empty


def test_the_short_names_are_keywords_that_help_and_editors_know():
    known = inspect.signature(affinet.run).parameters
    short = [name for name in known if name not in ("scenario", "overrides", "runtime", "out", "tables")]
    assert short == [*overrides.SHORT]


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


def python_of(page):
    return re.findall(r"```python\n(.*?)```", page.read_text(), flags=re.DOTALL)


def blocks():
    """Every piece of Python in the docs."""
    return [text for page in (ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))) for text in python_of(page)]


def test_users_are_told_to_import_from_affinet_alone():
    rooms = re.compile(r"^\s*(?:from|import) +((?:affinet\.|agents|analysis|netem|world).*)$", re.MULTILINE)
    assert len(blocks()) >= 7
    assert [found for text in [*blocks(), ESTIMATOR] for found in rooms.findall(text)] == []


def test_the_program_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (program,) = (text for text in python_of(ROOT / "README.md") if "affinet.run(" in text)
    exec(program, {})


_PROGRAM = re.compile(r"```python\n(.*?)```(?:\n\n```text\n(.*?)```)?", re.DOTALL)


def test_the_programs_of_the_page_run_one_after_the_other_and_print_what_stands_there(tmp_path):
    programs, printed = zip(*_PROGRAM.findall((ROOT / "docs" / "library.md").read_text()), strict=True)
    (tmp_path / "page.py").write_text("\nprint('---')\n".join(programs))
    done = subprocess.run([sys.executable, "page.py"], capture_output=True, text=True, cwd=tmp_path, check=False)
    assert done.returncode == 0, done.stderr
    digest = re.compile("[0-9a-f]{64}")  # other processors have other bits
    assert digest.sub("", done.stdout).split("---\n") == [digest.sub("", text) for text in printed]
    assert sum(map(bool, printed)) >= 5


# ---- runs


def test_a_run_in_process_leaves_nothing_and_has_the_bits_of_the_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = affinet.run("corridor", *SHORT).check(affinet.bounded(100.0))
    assert (run.outcome.verdict, run.outcome.digest) == ("pass", digest_of("corridor", *SHORT))
    assert affinet.run(affinet.scenario.load("corridor", SHORT)).outcome.digest == run.outcome.digest
    assert list(tmp_path.iterdir()) == []


def test_overrides_are_texts_tables_and_keywords():
    flown = affinet.run("corridor", {"network": {"availability": 0.5}}, "seed=2", estimator="rkf", dt=0.05, duration=1)
    as_texts = (*SHORT, "network.availability=0.5", "seed=2", "agents.estimator=rkf")
    assert flown.outcome.digest == digest_of("corridor", *as_texts)
    again = affinet.run(
        affinet.scenario.load("corridor", [*SHORT, {"network.availability": 0.5}], seed=2, estimator="rkf")
    )
    assert again.outcome.digest == flown.outcome.digest


PLACES = {
    "in process": {},
    "kept": {"out": "run"},
    "processes": {"runtime": "processes"},
}


@PROCESSES
@pytest.mark.parametrize("place", PLACES)
def test_an_estimator_and_a_law_that_are_objects_of_a_module_fly_anywhere(place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    names = {"estimator": write(tmp_path, ESTIMATOR), "law": write(tmp_path, LAW)}
    objects = {key: importlib.import_module(name).Own() for key, name in names.items()}
    flown = affinet.run("corridor", *SHORT, **objects, **PLACES[place])
    by_name = affinet.run("corridor", *SHORT, **{key: f"{name}:Own" for key, name in names.items()})
    assert flown.outcome.digest == by_name.outcome.digest
    assert flown.outcome.flown["estimator"] == f"{names['estimator']}:Own"


SCRIPT = """
import affinet
{estimator}
short = {{"duration": 1, "dt": 0.05}}
flown = affinet.run("corridor", estimator=Own(), **short, out="run")
assert affinet.load("run").outcome.digest == flown.outcome.digest
print(flown.outcome.digest)
try:
    affinet.run("corridor", estimator=Own(), **short, runtime="processes")
except affinet.PlanError as error:
    print(error)
"""


def test_an_object_of_a_script_flies_in_its_process_alone(tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    script = tmp_path / "elsewhere" / "script.py"
    script.write_text(SCRIPT.format(estimator=ESTIMATOR))
    (tmp_path / "__main__.py").write_text("1 / 0\n")  # a file of that name is another module
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, cwd=tmp_path, check=True)
    digest, refusal = done.stdout.splitlines()
    name = write(tmp_path, ESTIMATOR)
    monkeypatch.chdir(tmp_path)
    assert digest == affinet.run("corridor", *SHORT, estimator=f"{name}:Own").outcome.digest
    assert refusal.startswith(
        "processes: __main__:Own is of the script or notebook that runs, which no other process has: "
    )
    with pytest.raises(affinet.ScenarioError, match=r"only the script or notebook that made it has it$"):
        affinet.load(tmp_path / "run")


@PROCESSES
@pytest.mark.parametrize("runtime", ["inprocess", "processes"])
def test_a_run_flies_within_a_running_event_loop(runtime):
    async def cell():
        return affinet.run("corridor", *SHORT, runtime=runtime).outcome.digest

    assert asyncio.run(cell()) == digest_of("corridor", *SHORT)


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


@pytest.mark.parametrize(("given", "settings", "said"), [(["seed=3"], {}, "seed=3"), ([], {"seed": 3}, "seed")])
def test_overrides_of_what_is_read_already_are_refused(given, settings, said):
    with pytest.raises(affinet.ScenarioError, match=f"^{said}: give overrides where the scenario is read"):
        affinet.run(READ, *given, **settings)


@PROCESSES
@pytest.mark.parametrize(
    "keys", [{}, {"out": "run"}, {"runtime": "processes"}], ids=["in process", "kept", "processes"]
)
def test_what_an_estimator_does_wrong_is_said_however_it_is_flown(keys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = write(tmp_path, broken(ESTIMATOR, ("return state, estimate", "return state, 1 / 0 if late else estimate")))
    with pytest.raises(affinet.Broken, match=rf"{name}:Own\.fuse in tick 7: ZeroDivisionError"):
        affinet.run("corridor", *SHORT, f"agents.estimator={name}:Own", "agents.law=rest", **keys)


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    out = tmp_path_factory.mktemp("kept") / "run"
    affinet.run("corridor", *SHORT, "record.enabled=false", out=out)
    return out


@pytest.fixture
def flown(kept, tmp_path):
    """A copy of a run directory, to be damaged."""
    return shutil.copytree(kept, tmp_path / "flown")


NO_RUNS = {
    "no run": (lambda out: [file.unlink() for file in out.iterdir() if file.is_file()], "no run that has ended"),
    "no arrays": (lambda out: shutil.rmtree(out / "arrays"), "the run left no arrays:"),
}


@pytest.mark.parametrize("lack", NO_RUNS)
def test_a_directory_that_holds_no_whole_run_is_refused(lack, flown):
    harm, says = NO_RUNS[lack]
    harm(flown)
    with pytest.raises(affinet.ScenarioError, match=says):
        affinet.load(flown)


def saying(**changes):
    """A change of keys in a summary; None takes one away."""

    def change(said):
        return {key: value for key, value in (said | changes).items() if value is not GONE}

    return change


def of_messages(**changes):
    return lambda said: said | {"messages": said["messages"] | changes}


GONE = object()
SUMMARIES = {
    "no verdict": (saying(verdict=GONE), "object missing required field `verdict`"),
    "verdict 5": (saying(verdict=5), "verdict: "),
    "another verdict": (saying(verdict="fine"), "verdict: expected `str` matching regex"),
    "no reasons": (saying(reasons=None), "reasons: "),
    "a reason that is a number": (saying(reasons=[1]), "reasons[0]: "),
    "no messages": (saying(messages={}), "messages: object missing required field"),
    "messages null": (saying(messages=None), "messages: "),
    "messages a text": (saying(messages="none"), "messages: "),
    "less than no messages": (of_messages(offered=-1), "messages.offered: "),
    "dropped numbers": (of_messages(dropped={"lost": "many"}), "messages.dropped[...]: "),
    "no processes": (saying(processes=None), "processes: "),
    "a process that is a number": (saying(processes=[1]), "processes[0]: "),
    "no time": (saying(wall_s=None), "wall_s: "),
    "a time in words": (saying(wall_s="long"), "wall_s: "),
    "an endless time": (saying(wall_s=float("inf")), "Infinity is no number of JSON"),
    "nothing flown": (saying(flown=None), "flown: "),
    "flown by nobody": (saying(flown={"law": "rest"}), "flown: object missing required field `estimator`"),
    "a list": (lambda _: [], "expected `object`, got `array`"),
    "null": (lambda _: None, "expected `object`, got `null`"),
}  # fmt: skip


def damaged(out):
    with pytest.raises(affinet.Damaged) as error:
        affinet.load(out)
    return str(error.value)


@pytest.mark.parametrize("damage", SUMMARIES)
def test_a_summary_that_no_run_wrote_is_damaged(damage, flown):
    change, why = SUMMARIES[damage]
    file = flown / "summary.json"
    file.write_text(json.dumps(change(json.loads(file.read_text()))))
    said = damaged(flown)
    assert said.startswith(f"{file}: not what a run wrote there: {why}")
    assert said.endswith("; fly the run again, or restore the file")
    assert "\n" not in said


@pytest.mark.parametrize(
    "text",
    [b"text", b"", b"\xff\xfe", b"[" * 100_000, b'{"wall_s":' + b"9" * 5000 + b"}"],
    ids=["a text", "empty", "no UTF-8", "deep", "a long number"],
)
def test_a_summary_that_is_no_json_is_damaged(text, flown):
    (flown / "summary.json").write_bytes(text)
    assert damaged(flown).startswith(f"{flown / 'summary.json'}: not what a run wrote there: ")


def only(name, change):
    return lambda a: a | {name: change(a[name])}


def every(change):
    return lambda a: {name: change(array) for name, array in a.items()}


OTHER_ARRAYS = {
    "fewer reasons": (only("dropped", lambda a: a[:, :-1]), f"dropped counts {len(Verdict) - 1} verdicts, and"),
    "no verdicts": (only("verdicts", lambda a: np.full_like(a, 255)), "verdicts has a 255, which is no verdict"),
    "fewer agents": (only("input", lambda a: a[:, :3]), "input is float64 (3, 2) in a tick, where its scenario"),
    "fewer links": (only("verdicts", lambda a: a[:, :, :2]), "verdicts is uint8 (4, 2) in a tick"),
    "four axes": (only("position", lambda a: np.concatenate([a, a], axis=2)), "position is float64 (7, 4) in a tick"),
    "short floats": (only("position", lambda a: a.astype(np.float16)), "position is float16 (7, 2) in a tick"),
    "a stranger": (lambda a: a | {"stranger": a["psi"]}, "stranger is float64 (7,) in a tick, where"),
    "fewer ticks": (every(lambda a: a[:-5]), "it is not that of summary.json, which has 20 ticks"),
    "more ticks": (every(lambda a: np.concatenate([a, a])[: len(a) + 20]), "it has 40 ticks, where its scenario has 20"),
    "other contents": (only("newest", lambda a: a * 0 + 99), "it is not that of summary.json, which has another digest"),
    "other verdicts": (only("verdicts", lambda a: a * 0 + 5), "it is not that of summary.json, which has another digest"),
}  # fmt: skip


@pytest.mark.parametrize("damage", OTHER_ARRAYS)
def test_arrays_that_the_run_did_not_leave_are_damaged(damage, flown):
    change, why = OTHER_ARRAYS[damage]
    file = flown / ARRAYS
    rewrite(file, change(load(file)))
    assert damaged(flown).startswith(f"{file}: not what a run wrote there: {why}")


def test_arrays_without_a_digest_are_damaged(flown):
    file = flown / "summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {"digest": None}))
    assert "it is not that of summary.json, which has another digest" in damaged(flown)


def cut_short(file):
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])


JOURNALS = {
    "gone": (Path.unlink, "no such table"),
    "a text": (lambda file: file.write_text("text"), "no such table"),
    "cut short": (cut_short, "its accounts are not those of summary.json"),
    "other accounts": (
        lambda file: file.write_bytes(file.read_bytes().replace(b'"in_flight"', b'"in_fright"')),
        "its accounts cannot be read: Accounts: ",
    ),
}


@pytest.mark.parametrize("damage", JOURNALS)
def test_a_journal_that_the_run_did_not_leave_is_damaged(damage, flown):
    harm, why = JOURNALS[damage]
    file = flown / "journal.arrows"
    harm(file)
    assert damaged(flown).startswith(f"{file}: not what a run wrote there: {why}")


def test_the_journal_of_no_run_is_damaged(tmp_path):
    with pytest.raises(affinet.Damaged, match=r"journal\.arrows: not what a run wrote there: no such table"):
        affinet.journal(tmp_path)


# ---- what is asked for


READ = affinet.scenario.load("corridor")
NO_RUNTIME = '^runtime "bogus": there are processes, inprocess$'
WRONG_CALLS = {
    "no such runtime": (lambda: affinet.run("corridor", runtime="bogus"), ValueError, NO_RUNTIME),
    "out is empty": (lambda: affinet.run("corridor", out=""), ValueError, "^out is '', which is no path"),
    "out has a NUL": (lambda: affinet.run("corridor", out="a\0b"), ValueError, r"^out is 'a\\x00b', which is no path"),
    "out is a number": (lambda: affinet.run("corridor", out=5), TypeError, "^out is 5: give the path of a run directory"),
    "a number": (lambda: affinet.run(5), TypeError, "^5 is no scenario: give the name"),
    "a table": (lambda: affinet.run({"a": 1}), TypeError, r"^\{'a': 1\} is no scenario: give the name"),
    "an override that is a number": (lambda: affinet.run("corridor", 5), TypeError, r"^\(5,\) are no overrides: give a"),
    "one override": (lambda: affinet.scenario.load("corridor", "seed=3"), TypeError, "^'seed=3' are no overrides"),
    "no scenario extended": (lambda: affinet.scenario.extended("corridor", []), TypeError, "^'corridor' is no Scenario"),
    "extended by a table": (lambda: affinet.scenario.extended(READ, {}), TypeError, r"^\{\} are no entries"),
    "load nothing": (lambda: affinet.load(None), TypeError, "^directory is None: give the path of a run directory"),
    "load an empty path": (lambda: affinet.load(""), ValueError, "^directory is '', which is no path"),
    "load a NUL": (lambda: affinet.load("\0"), ValueError, "^directory is"),
    "journal of nothing": (lambda: affinet.journal(None), TypeError, "^directory is None"),
    "realised nothing": (lambda: affinet.realised("run"), TypeError, "^'run' is no run: give what"),
}  # fmt: skip


@pytest.mark.parametrize("call", WRONG_CALLS)
def test_what_is_not_asked_for_is_refused_in_one_line(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    calling, kind, says = WRONG_CALLS[call]
    with pytest.raises(kind, match=says):
        calling()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("call", [lambda: affinet.run("corridor"), lambda: commands.main(["check", "corridor"])])
def test_a_working_directory_that_is_gone_is_said(call, tmp_path, monkeypatch, capsys):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    try:
        status = call()
    except affinet.ScenarioError as error:
        said = str(error)
    else:
        assert status == 2
        said = capsys.readouterr().err.strip()
    assert said == "the working directory is not there any more: go to one that is"


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"seed": -1}, "^in code: seed: should be greater than or equal to 0, got -1"),
        ({"agents": None}, "^in code: agents: is missing"),
        ({"timeline": 5}, "^in code: timeline: "),
        ({"seed": object()}, "^in code: "),
    ],
)
def test_a_scenario_that_was_changed_behind_its_back_is_read_again(changes, says):
    given = affinet.scenario.load("corridor", SHORT)
    with pytest.raises(affinet.ScenarioError, match=says):
        affinet.run(given.model_copy(update=changes))


def test_a_scenario_that_was_changed_to_another_is_flown():
    given = affinet.scenario.load("corridor", [*SHORT, "seed=5"]).model_copy(update={"seed": 6})
    assert affinet.run(given).outcome.digest == digest_of("corridor", *SHORT, "seed=6")


# ---- what a run is


@pytest.mark.parametrize("scenario", ["corridor", "target", "localization", "partition"])
def test_a_run_can_be_pickled_compared_and_shown(scenario):
    flown = affinet.run(scenario, "time.duration=0.1")
    again = pickle.loads(pickle.dumps(flown))
    assert flown != again
    assert len({flown, again, flown}) == 2
    assert flown.plan != again.plan
    assert affinet.realised(flown) != affinet.realised(again)
    digest = flown.outcome.digest
    assert repr(flown) == repr(again)
    assert repr(flown).startswith(f"<FlownRun: {scenario}.toml, {flown.outcome.verdict}\n")
    assert f" {flown.ticks} ticks of " in repr(flown)
    assert repr(flown).endswith(f"digest: {digest}>")
    assert affinet.run(again.plan.scenario).outcome.digest == digest
    assert (affinet.realised(again).heard == affinet.realised(flown).heard).all()
    assert again.check(affinet.bounded(1e9)) is again


def test_a_metric_of_a_run_is_that_of_below_in_each_tick():
    flown = affinet.run("corridor", *SHORT, estimator="rkf")
    nees = flown.metric("nees")
    assert nees.shape == (flown.ticks,)
    assert not np.isnan(nees).any()
    flown.check(affinet.below("nees", np.nextafter(np.nanmax(nees), np.inf)))
    with pytest.raises(affinet.Broken, match=rf"\(tick {np.nanargmax(nees)}\)"):
        flown.check(affinet.below("nees", np.nanmax(nees)))
    with pytest.raises(ValueError, match=r"^no metric 'ness'; did you mean 'nees'\?"):
        flown.metric("ness")


def test_a_run_says_where_another_parts_from_it():
    given = affinet.scenario.load("corridor", SHORT)
    cut = affinet.scenario.extended(given, [{"verb": "dropout", "links": ["2->4"], "at": 0.4}])
    one, other = affinet.run(given), affinet.run(cut)
    said = one.parting(other)
    assert said == "tick 8: verdicts of sense on 2->4 is delivered in one run and dropout in the other"
    assert one.parting(affinet.run(given)) == "the same bits as the first"


def test_a_run_comes_back_from_another_process():
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        flown = pool.submit(affinet.run, "corridor", *SHORT).result()
    assert flown.outcome.digest == digest_of("corridor", *SHORT)


# ---- checkers


def test_what_is_no_checker_is_refused(short_run):
    with pytest.raises(TypeError, match=r"^'bounded' is no checker: give checkers, like bounded\(5\.0\)"):
        short_run.check("bounded")


def says_nothing(_):
    return None


def breaks(_):
    return 1 / 0


@pytest.mark.parametrize("wrapped", [lambda check: check, lambda check: affinet.Checker(check.__name__, check)])
@pytest.mark.parametrize(
    ("check", "says"),
    [(says_nothing, "must return a CheckResult, got None"), (breaks, "ZeroDivisionError: division by zero")],
)
def test_a_checker_that_fails_is_named_with_file_and_line(check, says, wrapped, short_run):
    with pytest.raises(affinet.UserCodeError, match=rf"^{check.__name__}: {says} \({re.escape(__file__)}:\d+\)$"):
        short_run.check(wrapped(check))


@pytest.fixture(scope="module")
def short_run():
    return affinet.run("corridor", "time.duration=0.1")
