"""Run directories that somebody damaged: one line that names the file, what is wrong and the way out; never the same bits."""

import json
import shutil

import numpy as np
import pytest
from flying import PROCESSES, plan_of
from kept_arrays import rewrite

from affinet.cli import commands
from affinet.runtimes.run import fly
from world.books import history

pytestmark = PROCESSES

ARRAYS, SCENARIO, CONTROL, BOOK = history.ARRAYS, "scenario.json", "control.json", "inputs/inputs.json"
NOT_WHOLE = "control.json is not whole"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    out = tmp_path_factory.mktemp("damaged") / "run"
    fly(
        plan_of("corridor", "time.dt=0.05", "time.duration=1", "record.enabled=false"),
        "inprocess",
        out,
        lambda *_: None,
    )
    return out


@pytest.fixture
def run(flown, tmp_path):
    """A copy of the run, to be damaged."""
    return shutil.copytree(flown, tmp_path / "damaged")


def said(capsys, *words, status):
    """The line in which it is said what is wrong; those above it are of a run that was under way."""
    assert commands.main([*map(str, words)]) == status
    *under_way, line = capsys.readouterr().err.splitlines()
    assert not under_way or status == 1
    return line


def replayed(capsys, run, tmp_path, *options, status):
    command = ["replay", run, "--runtime", "inprocess", "--json", "--out", tmp_path / "again", *options]
    return said(capsys, *command, status=status)


def rewritten(run, change):
    arrays = history.load(run / ARRAYS)
    rewrite(run / ARRAYS, change(arrays))


@pytest.mark.parametrize("options", [(), ("--verdicts",)])
@pytest.mark.parametrize(
    ("change", "differs"),
    [
        (
            lambda a: a | {"input": a["input"][:, :1]},
            "input is float64 (1, 2) in one run and float64 (7, 2) in the other",
        ),
        (lambda a: a | {"error": a["error"].astype(np.float32)}, "error is float32 () in one run and float64 () in"),
        (lambda a: a | {"newest": a["newest"].astype(np.int64)}, "newest is int64 (4, "),
        (lambda a: a | {"position": a["position"][:, :, :1]}, "position is float64 (7, 1) in one run and"),
        (lambda a: a | {"stranger": a["psi"]}, "stranger is float64 (7,) in one run and missing in the other"),
    ],
    ids=["fewer agents", "short floats", "long integers", "one axis", "a stranger"],
)
def test_what_has_another_form_is_not_the_same_bits(change, differs, options, run, tmp_path, capsys):
    rewritten(run, change)
    line = replayed(capsys, run, tmp_path, *options, status=1)
    assert line.startswith("tick 0: ")
    assert differs in line


def test_a_replay_that_compared_nothing_fails_and_says_so(run, tmp_path, capsys):
    shutil.rmtree(run / ARRAYS)
    line = replayed(capsys, run, tmp_path, status=1)
    assert line.startswith(f"{run / ARRAYS}: not there, so no bit was compared")
    assert (
        commands.main(
            ["replay", str(run), "--runtime", "inprocess", "--json", "--out", str(tmp_path / "b"), "--seed", "7"]
        )
        == 0
    )


def broken_off(folder):
    file = folder / "input.npy"
    file.write_bytes(file.read_bytes()[:2000])


def with_arrays(change):
    return lambda folder: rewritten(folder.parent, change)


def saying(text):
    return lambda folder: (folder / "input.npy").write_bytes(text)


DAMAGES = {
    "truncated": (broken_off, "input.npy", "it breaks off before its (20,) rows end"),
    "empty": (saying(b""), "input.npy", "EOF: reading magic string"),
    "a text": (saying(b"nothing\n"), "input.npy", "the magic string is not correct"),
    "another format": (saying(b"\x93NUMPY\x02\x00"), "input.npy", "another format"),
    "half a header": (saying(b"\x93NUMPY\x01\x00v\x00{'descr'"), "input.npy", "EOF: reading array header"),
    "no header": (saying(b"\x93NUMPY\x01\x00\x02\x00[]"), "input.npy", "not a dictionary"),
    "by columns": (with_arrays(lambda a: a | {"input": np.asfortranarray(a["input"])}), "input.npy", "no plain rows"),
    "without a key": (with_arrays(lambda a: {n: v for n, v in a.items() if n != "input"}), "", "it has no input"),
    "objects": (with_arrays(lambda a: a | {"input": np.array([None] * 20)}), "input.npy", "no plain rows of numbers"),
    "no axes": (with_arrays(lambda a: a | {"input": np.float64(1.0)}), "", "input is a single number"),
    "no ticks": (with_arrays(lambda a: a | {"error": np.float64(1.0)}), "", "error is a single number"),
    "texts": (with_arrays(lambda a: a | {"input": np.full((20, 7, 2), "x")}), "", "input is <U1 of shape (20, 7, 2)"),
    "a text beside": (with_arrays(lambda a: a | {"stranger": np.full((20, 7), "x")}), "", "stranger is <U1"),
}  # fmt: skip


@pytest.mark.parametrize("verb", ["replay", "fit"])
@pytest.mark.parametrize(("damage", "file", "why"), DAMAGES.values(), ids=DAMAGES)
def test_damaged_arrays_are_named_with_the_way_out(damage, file, why, verb, run, tmp_path, capsys):
    damage(run / ARRAYS)
    line = replayed(capsys, run, tmp_path, status=2) if verb == "replay" else said(capsys, "fit", run, status=2)
    assert line.startswith(f"{run / ARRAYS / file}: not what a run wrote there: ")
    assert why in line
    assert line.endswith("fly the run again, or restore the file")
    assert not (tmp_path / "again").exists()


def test_a_byte_that_was_flipped_is_not_the_same_bits(run, tmp_path, capsys):
    file = run / ARRAYS / "input.npy"
    body = bytearray(file.read_bytes())
    body[-1] ^= 0x01
    file.write_bytes(body)
    assert "tick 19: input of agent 7 is " in replayed(capsys, run, tmp_path, status=1)


def test_a_directory_that_is_not_there_is_said_in_words(tmp_path, capsys):
    line = said(capsys, "watch", tmp_path / "nope", status=2)
    assert line.startswith(f"{tmp_path / 'nope'}: no run directory: No such file or directory; name one that")
    assert "Errno" not in line


@pytest.mark.parametrize("verb", ["replay", "fit", "inject"])
@pytest.mark.parametrize("text", ["[" * 100_000, "[]", "7", "null", '"run"', "", "{"])
def test_a_scenario_that_is_no_table_is_no_run(text, verb, run, tmp_path, capsys):
    (run / SCENARIO).write_text(text)
    words = {"replay": ["--out", tmp_path / "again", "--seed", "3"], "fit": [], "inject": ["heal"]}[verb]
    line = said(capsys, verb, run, *words, status=2)
    assert line.startswith(f"{run}: no run directory: ")
    assert line.endswith("name one that `affinet run` printed")


def test_a_run_that_is_gone_may_have_been_that_of_a_test(tmp_path, capsys):
    line = said(capsys, "replay", tmp_path / "pytest-3", "--out", tmp_path / "again", status=2)
    assert line.endswith("printed, or a failed test: pytest keeps those of its last three sessions")


@pytest.mark.parametrize(
    ("changes", "differs"),
    [
        ({"agents": {"estimator": "none"}}, "in one run and"),
        ({"formation": {"preset": "hexa10"}, "agents": {}}, " is float64 (7, 2) in one run and float64 (10, "),
    ],
    ids=["another estimator", "more agents"],
)
def test_another_scenario_than_was_flown_differs(changes, differs, run, tmp_path, capsys):
    told = json.loads((run / SCENARIO).read_text())
    for section, keys in changes.items():
        told[section] |= keys
    (run / SCENARIO).write_text(json.dumps(told))
    line = replayed(capsys, run, tmp_path, status=1)
    assert line.startswith("tick 0: ")
    assert differs in line


@pytest.mark.parametrize("verb", ["replay", "inject"])
@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('{"originals": 3, "modules": {"x": 1}}', "originals must be a table of paths"),
        ('{"modules": {"x": 1}}', "modules must be a table of paths"),
        ('{"originals": {"x": "\\u0000"}}', "originals must be a table of paths"),
        ('{"verdicts": 7}', "verdicts must be a path"),
        ("[]", "must be a mapping"),
        ("[" * 100_000, "recursion"),
    ],
)
def test_a_book_of_inputs_that_no_run_wrote_is_named(text, why, verb, run, tmp_path, capsys):
    (run / BOOK).parent.mkdir(exist_ok=True)
    (run / BOOK).write_text(text)
    words = {"replay": ["--out", tmp_path / "again"], "inject": ["heal"]}[verb]
    line = said(capsys, verb, run, *words, status=2)
    assert line.startswith(f"{run / BOOK}: not what a run wrote there: ")
    assert why in line


@pytest.mark.parametrize(
    "text",
    [
        "{}", "[]", "null", "7", "", "[" * 100_000, '{"run": 1, "login": {}}', '{"run": "r", "login": 3}', '{"run": "r"}',
        '{"run": "r", "login": {"endpoint": "e"}}', '{"run": "r", "login": {"endpoint": 1, "name": "n"}}',
    ],
    ids=lambda text: text[:40],
)  # fmt: skip
def test_a_way_in_that_is_not_whole_is_none(text, run, capsys):
    (run / CONTROL).write_text(text)
    assert NOT_WHOLE in said(capsys, "inject", run, "heal", status=2)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["cut", "1-2", "--for", "inf"], "cut: --for inf: give seconds above 0"),
        (["cut", "1-2", "--for", "1e400"], "cut: --for inf: give seconds above 0"),
        (["cut", "1-2", "--for", "nan"], "cut: --for nan: give seconds above 0"),
        (["cut", "1-2", "--for=-1"], "cut: --for -1: give seconds above 0"),
        (["cut", "1-2", "--for", "0"], "cut: --for 0: give seconds above 0"),
        (["cut", "1-2", "--for", "1e10"], "cut: --for 1e+10: give seconds above 0, at most 1e+09"),
        (["partition", "1,2/3,4", "--for", "inf"], "partition: --for inf: give seconds above 0"),
        (["lose", "nan"], "lose: a loss of nan: a probability lies in [0, 1]"),
        (["lose", "1.5"], "lose: a loss of 1.5: a probability lies in [0, 1]"),
    ],
)
def test_numbers_that_say_nothing_are_not_injected(words, why, flown, capsys):
    assert said(capsys, "inject", flown, *words, status=2).startswith(why)
