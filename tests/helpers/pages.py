"""What stands on a page of the docs, done as somebody who reads it does it, and compared with what it shows.

A page is worked through in one folder, from top to bottom: a block that begins with `# name.py:`, or with another name of a
file, is written there, or with `# name.toml, at its end:` added to it; a program runs, and prints what the `text` below it
says; an indented `$ command` runs, and answers what stands below it. `...` in a line of its own stands for lines that are left
out, within a line for words.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from paths import DOCS, ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
INDENTED = re.compile(r"(?:^|\n\n)((?:    .*(?:\n|$))+)")
WIDTH = "100"
# What whoever runs the tests has set up for these tests, and a reader has not.
_NOT_A_READERS = ("DISPLAY", "WAYLAND_DISPLAY", "PYTEST_ADDOPTS")
_DIGEST = re.compile(r"\b[0-9a-f]{64}\b")  # other processors have other bits
_STEP = re.compile(
    r"^```(?P<kind>python|toml|yaml)\n(?P<text>.*?)^```\n(?:\n```text\n(?P<printed>.*?)^```\n)?"
    r"|^    \$ (?P<command>[^\n]*)\n(?P<shown>(?:    (?!\$ )[^\n]*\n|\n+(?=    (?!\$ )))*)",
    re.MULTILINE | re.DOTALL,
)
_NAMED = re.compile(r"# ([\w/.-]+\.\w+)(, at its end)?(?::.*)?\n")


class Step(NamedTuple):
    """Something to do: a command, or a program; or a file to write, by its name.

    Parameters
    ----------
    what
        The command, the program, or what is in the file.
    shown
        What the page shows of what it says.
    file, more
        The name of the file, and whether it is there already, and this comes at its end.
    program
        Whether it is Python.
    """

    what: str
    shown: str
    file: str | None = None
    more: bool = False
    program: bool = False


class Wrong(AssertionError):
    """What is done says something else than the page shows."""


def page(name: str) -> str:
    """The text of a page."""
    return (DOCS / name).read_text(encoding="utf-8")


def steps(text: str) -> list[Step]:
    """All there is to do on a page."""
    found = []
    for match in _STEP.finditer(text):
        if match["command"] is not None:
            found.append(Step(match["command"], match["shown"]))
        elif named := _NAMED.match(match["text"]):
            found.append(Step(match["text"], "", named[1], more=named[2] is not None))
        elif match["kind"] == "python":
            found.append(Step(match["text"], match["printed"] or "", program=True))
    return found


def blocks(text: str) -> Iterator[tuple[str, str]]:
    """Language and text of every block of a page."""
    for language, block in FENCED.findall(text):
        yield language, block
    for block in INDENTED.findall(FENCED.sub("", text)):
        yield "", re.sub(r"^    ", "", block, flags=re.MULTILINE)


def answered(text: str) -> list[tuple[str, str]]:
    """The commands of affinet on a page that stand there with what they answer."""
    told = (step for step in steps(text) if step.file is None and not step.program)
    return [(step.what, step.shown) for step in told if step.what.startswith("affinet ") and step.shown]


def said(command: str, folder: Path) -> tuple[int, str]:
    """The exit status of a line typed into a shell in a folder, and what it says on both streams."""
    return _done(["bash", "-c", command], folder)


def is_answered(shown: str, told: str) -> bool:
    """Whether the lines that are shown stand in what is told, one after the other; at `...` lines or words may be missing."""
    parts = [part.strip("\n").splitlines() for part in re.split(r"^ *\.\.\.$", shown, flags=re.MULTILINE)]
    lines, start = [line.rstrip() for line in told.splitlines()], 0
    for part in parts:
        wanted = [line.removeprefix("    ").rstrip() for line in part]
        places = [n for n in range(start, len(lines) + 1) if _alike(wanted, lines[n : n + len(wanted)])]
        if not places:
            return False
        start = places[0] + len(wanted)
    return True


def _alike(wanted: Sequence[str], lines: Sequence[str]) -> bool:
    def fits(shown: str, line: str) -> bool:
        return re.fullmatch(".*".join(map(re.escape, shown.split("..."))), line) is not None

    return len(wanted) == len(lines) and all(map(fits, wanted, lines))


def work_through(text: str, folder: Path, elsewhere: Mapping[str, str]) -> list[Step]:
    """Do all that stands on a page in a folder; returns what was done.

    A command has exit status 0, unless the next one is `echo $?`, which then says another.

    Parameters
    ----------
    text
        Of the page.
    folder
        Where.
    elsewhere
        Commands that are not typed here, and which test does it.

    Raises
    ------
    Wrong
        When something says what the page does not show.
    """
    todo, status, done = steps(text), 0, []
    for number, step in enumerate(todo):
        if step.file is not None:
            path = folder / step.file
            path.parent.mkdir(parents=True, exist_ok=True)
            there = path.read_text(encoding="utf-8") + "\n" if step.more else ""
            path.write_text(there + step.what, encoding="utf-8")
        elif step.program:
            status, told = _done([sys.executable, "-c", step.what], folder)
            _compare(step, status, told, exact=True)
        elif step.what == "echo $?":
            _compare(step, 0, f"{status}\n")
        elif step.what not in elsewhere:
            status, told = said(step.what, folder)
            asked = todo[number + 1 : number + 2]
            _compare(step, 0 if asked and asked[0].what == "echo $?" else status, told)
        else:
            continue
        done.append(step)
    return done


def _compare(step: Step, status: int, told: str, *, exact: bool = False) -> None:
    shown = _DIGEST.sub("", step.shown)
    same = _DIGEST.sub("", told) == shown if exact else is_answered(shown, _DIGEST.sub("", told))
    if status != 0 or not same:
        raise Wrong(f"$ {step.what}\nends with {status} and says:\n{told}\nwhere the page shows:\n{step.shown}")


def _done(words: Sequence[str], folder: Path) -> tuple[int, str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environ = {name: value for name, value in os.environ.items() if name not in _NOT_A_READERS}
    done = subprocess.run(
        words,
        cwd=folder,
        env=environ | {"COLUMNS": WIDTH, "PATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    return done.returncode, done.stdout
