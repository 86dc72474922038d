"""What is shown never decides what comes of a command: few characters, closed streams, readers that have gone, no terminal."""

import io
import os
import pty
import subprocess
import sys
import threading
from contextlib import closing

import pytest
from rich.progress import BarColumn
from terminals import written_to

from affinet.cli.progress import Bar
from world.recording.logbook import RECORDING

COARSE = ("--set", "time.dt=0.05", "--set", "time.duration=1")
RUN = ("run", "corridor", "--runtime", "inprocess", *COARSE)


def affinet(*arguments, cwd, environment=os.environ, **streams):
    command = [sys.executable, "-m", "affinet", *arguments]
    return subprocess.run(command, cwd=cwd, env=environment, check=False, **streams)


@pytest.mark.parametrize(
    ("encoding", "shown"),
    [
        ("ascii", b"1 m? ? 2"),  # UnicodeEncodeError for all but plain tables
        ("latin-1", b"1 m\xb2 ? 2"),  # UnicodeEncodeError wherever a cell was too long for its column
        ("utf-8", "1 m² … 2".encode()),
        ("ascii:backslashreplace", rb"1 m\xb2 \u2026 2"),  # somebody has said how
    ],
)
def test_characters_a_terminal_does_not_have_are_question_marks(encoding, shown):
    program = "from affinet.cli import terminal; terminal.settle(); print('1 m² … 2')"
    command = [sys.executable, "-X", "utf8", "-c", program]
    done = subprocess.run(command, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding}, check=False)
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, shown, b"")


def test_a_run_passes_at_a_terminal_of_few_characters(tmp_path):
    # A traceback, exit status 1, and no table; the run itself had passed.
    done = affinet(*RUN, cwd=tmp_path, environment=os.environ | {"PYTHONIOENCODING": "ascii"}, capture_output=True)
    assert done.returncode == 0
    assert b" m?" in done.stdout
    assert b"Traceback" not in done.stderr


@pytest.mark.parametrize(
    "command",
    [
        pytest.param(RUN, id="run"),  # exit status 1: rich ends the process when a pipe breaks
        pytest.param((*RUN, "--json"), id="run --json"),  # a traceback of BrokenPipeError, exit status 120
        pytest.param(("check", "corridor"), id="check"),
    ],
)
def test_a_reader_that_has_gone_is_no_failure(command, tmp_path):
    nobody_reads, pipe = os.pipe()
    os.close(nobody_reads)
    with open(pipe, "wb") as gone:
        quiet = affinet(*command, cwd=tmp_path, stdout=gone, stderr=subprocess.PIPE)
        deaf = affinet(*command, cwd=tmp_path, stdout=gone, stderr=gone) if command == RUN else quiet
    assert (quiet.returncode, deaf.returncode) == (0, 0)
    assert b"Traceback" not in quiet.stderr
    assert b"Broken" not in quiet.stderr


@pytest.mark.parametrize(
    ("arguments", "complaints", "status", "says"),
    [
        # Before: a second complaint of the interpreter as it ended, or its exit status 120.
        pytest.param(("check", "corridor"), "pipe", 2, [b"'what it prints': No space left on device; "], id="answer"),
        pytest.param(("--help",), "pipe", 2, [b"'what it prints': No space left on device; free"], id="help"),
        pytest.param(("list", "laws"), "pipe", 2, [b"'what it prints': No space left on device; free"], id="list"),
        pytest.param(("check", "corridor"), "full", 2, [], id="both"),
        pytest.param(("check", "nowhere"), "full", 2, [], id="complaint"),
    ],
)
def test_a_full_disk_under_the_streams_is_said_in_a_line(arguments, complaints, status, says, tmp_path):
    with open("/dev/full", "wb") as full:
        stderr = full if complaints == "full" else subprocess.PIPE
        done = affinet(*arguments, cwd=tmp_path, stdout=full, stderr=stderr)
    lines = (done.stderr or b"").splitlines()
    assert done.returncode == status
    assert [line[: len(says[0])] for line in lines] == says


def test_closed_streams_are_not_taken_for_files_of_the_run(tmp_path):
    # The recording became descriptor 1 or 2, and the run was bad input.
    command = [sys.executable, "-m", "affinet", *RUN, "--out", "run"]
    done = subprocess.run(["sh", "-c", '"$@" <&- >&- 2>&-', "sh", *command], cwd=tmp_path, check=False)
    assert done.returncode == 0
    assert (tmp_path / "run" / RECORDING).exists()


class Heard(io.StringIO):
    """No terminal; knows when a text was written."""

    def __init__(self, awaited):
        super().__init__()
        self._awaited, self.heard = awaited, threading.Event()

    def write(self, text):
        written = super().write(text)
        if self._awaited in self.getvalue():
            self.heard.set()
        return written


@pytest.mark.parametrize("colour", ["", "1"], ids=["as it is", "with FORCE_COLOR"])
def test_where_there_is_no_terminal_lines_say_how_far_it_is(monkeypatch, colour):
    # Nothing at all from the first line to the last.
    monkeypatch.setenv("FORCE_COLOR", colour)
    monkeypatch.setattr(sys, "stderr", log := Heard("corridor: 42 %  4.20 s"))
    with Bar("corridor", 1000, every_s=0.001) as bar:
        bar.see(420, "4.20 s")
        assert log.heard.wait(60)
    over = log.getvalue()
    assert over.endswith("\n")
    bar.see(1000, "10.00 s")
    assert log.getvalue() == over


def test_at_a_terminal_a_bar_is_all_there_is(monkeypatch):
    terminal, shown = pty.openpty()
    monkeypatch.setenv("TERM", "xterm")
    with closing(os.fdopen(shown, "w")) as screen, monkeypatch.context() as here:
        here.setattr(sys, "stderr", screen)
        with Bar("corridor", 1000, BarColumn(), every_s=0.001) as bar:
            bar.see(420, "4.20 s")
    drawn = written_to(terminal)
    assert "━" in drawn
    assert "42 %" not in drawn
