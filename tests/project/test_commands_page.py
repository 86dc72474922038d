"""docs/commands.md shows what is: every command is on it, and what it says they answer they do."""

import os
import re
import shlex
import subprocess
import sys

import pytest
from flying import PROCESSES
from paths import DOCS

from affinet.cli import options
from affinet.cli.helping import commands_of
from affinet.scaffold import making

pytestmark = PROCESSES

PAGE = (DOCS / "commands.md").read_text(encoding="utf-8")
ANSWERED = re.findall(r"^    \$ (affinet .*)\n((?:    (?!\$ ).*\n|\n(?=    (?!\$ )))+)", PAGE, flags=re.MULTILINE)
WIDTH = "100"


def answer(command, folder):
    words = [sys.executable, "-m", *shlex.split(command)]
    return subprocess.run(
        words, cwd=folder, env=os.environ | {"COLUMNS": WIDTH}, capture_output=True, text=True, check=False
    ).stdout


def is_answered(shown, said):
    """Whether the lines that are shown stand in what is said, one after the other; at `...` some may be missing."""
    parts = [part.strip("\n").splitlines() for part in re.split(r"^ *\.\.\.$", shown, flags=re.MULTILINE)]
    lines, start = [line.rstrip() for line in said.splitlines()], 0
    for part in parts:
        wanted = [line.removeprefix("    ").rstrip() for line in part]
        places = [n for n in range(start, len(lines)) if lines[n : n + len(wanted)] == wanted]
        if not places:
            return False
        start = places[0] + len(wanted)
    return True


@pytest.mark.parametrize(("command", "shown"), ANSWERED, ids=[command for command, _ in ANSWERED])
def test_a_command_answers_what_the_page_shows(command, shown, tmp_path):
    said = answer(command, tmp_path)
    assert is_answered(shown, said), said


def test_what_is_not_answered_is_found():
    said = "one\ntwo\nthree\n"
    assert is_answered("    one\n    ...\n    three\n", said)
    assert is_answered("    two\n    three\n", said)
    assert not is_answered("    one\n    three\n", said)
    assert not is_answered("    three\n    ...\n    one\n", said)


def test_the_page_shows_enough():
    assert len(ANSWERED) >= 6


def test_every_command_is_on_the_page():
    table = PAGE.partition("| when | command |")[2].partition("\n\n")[0]
    named = set(re.findall(r"`(?:affinet )?([\w-]+)(?: --\w+)*`", table))
    assert named == set(commands_of(options.parser()))


def test_every_kind_of_scaffold_is_on_the_page():
    rows = re.findall(r"^\| (`\w+`(?:, `\w+`)*) \|", PAGE.partition("## Begin with")[2], flags=re.MULTILINE)
    assert {kind for row in rows for kind in re.findall(r"\w+", row)} == set(making.KINDS)


@pytest.mark.parametrize("command", re.findall(r"^    (affinet schema .*)$", PAGE, flags=re.MULTILINE))
def test_a_command_of_the_page_passes(command, tmp_path):
    assert answer(command, tmp_path)
    assert list(tmp_path.glob("*.json"))
