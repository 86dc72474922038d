"""What says nothing of a run is there at once: nothing that flies, draws or checks is imported for it."""

import subprocess
import sys

import pytest

from affinet.cli import commands, options
from affinet.cli.helping import commands_of
from affinet.cli.options import flown, many
from affinet.verdicts.export.formats import FORMATS
from world.formation.layouts import KINDS

HEAVY = {"numpy", "scipy", "numba", "pydantic", "rerun", "matplotlib", "pyarrow", "zenoh", "rich", "hypothesis"}
IMPORTED = """
import atexit, os, sys
sys.argv = ["affinet", *{words!r}]
leave = os._exit  # by which the command ends
os._exit = lambda status: (print("\\nimported", *sorted(set(sys.modules) & {heavy!r})), sys.stdout.flush(), leave(status))
from affinet.__main__ import command
command()
"""


def imported(*words):
    code = IMPORTED.format(words=list(words), heavy=HEAVY)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    *answer, says = filter(None, done.stdout.splitlines())
    assert says.split()[0] == "imported", done.stderr
    return done.returncode, answer, set(says.split()[1:])


@pytest.mark.parametrize(
    "words", [("--version",), ("--help",), ("run", "--help"), ("completion", "bash")], ids=" ".join
)
def test_nothing_heavy_is_imported(words):
    status, answer, heavy = imported(*words)
    assert (status, heavy) == (0, set())
    assert answer


def test_a_command_imports_what_does_its_work():
    assert imported("check", "corridor")[2] >= {"numpy", "pydantic"}  # what the test above looks at can be seen


def test_each_command_has_somebody_who_does_its_work():
    assert commands._WORK.keys() == commands_of(options.parser()).keys()
    assert all(callable(commands._work(word)) for word in commands._WORK)


def test_the_command_line_names_what_it_does_not_import():
    assert {name: form.says for name, form in FORMATS.items()} == flown.FORMATS
    assert many.LAYOUTS == KINDS
