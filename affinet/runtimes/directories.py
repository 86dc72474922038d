"""Places for what a run, a study or a hunt leaves: each is claimed by one alone, however many start together."""

from __future__ import annotations

import itertools
import os
import shlex
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from netem.processes import system_errors

_LONGEST = 180  # bytes, of the 255 that file systems allow


def for_run(name: str) -> Path:
    """A new, empty directory for a run: runs/NAME-TIME, numbered where that is taken.

    Raises
    ------
    OSError
        When none can be made.
    """
    return _claimed(Path("runs"), f"{_shortened(name)}-{time.strftime('%Y%m%d-%H%M%S')}", "", Path.mkdir)


def for_study(name: str) -> Path:
    """A new, empty directory for a study: studies/NAME, numbered where that is taken.

    Raises
    ------
    OSError
        When none can be made.
    """
    return _claimed(Path("studies"), _shortened(name), "", Path.mkdir)


def for_hunt(file: Path | str) -> Path:
    """A new, empty file for the scenario that a hunt finds: this one, or by default hunted-NAME.toml, numbered likewise.

    Raises
    ------
    OSError
        When it is there already, or cannot be made.
    """
    return _file(file, "hunted")


def for_certificate(file: Path | str) -> Path:
    """A new, empty file for what a hunt certifies: this one, or by default certified-NAME.json, numbered likewise.

    Raises
    ------
    OSError
        When it is there already, or cannot be made.
    """
    return _file(file, "certified", ".json", "--certificate")


def for_design(file: Path | str) -> Path:
    """A new, empty file for a scenario that is designed: this one, or by default designed-NAME.toml, numbered likewise.

    Raises
    ------
    OSError
        When it is there already, or cannot be made.
    """
    return _file(file, "designed")


def new_file(file: Path, text: str) -> None:
    """Write a file that is not there yet.

    Raises
    ------
    OSError
        When it is there already, or cannot be written.
    """
    with system_errors.about(file):
        try:
            with file.open("x", encoding="utf-8") as new:
                new.write(text)
        except FileExistsError as error:
            raise FileExistsError(f"{str(file)!r} is there already; name another") from error


def refuse_there(file: Path, option: str = "--out") -> None:
    """Go on if a file that is to be written would take the place of none.

    Raises
    ------
    FileExistsError
        When it would.
    """
    if file.is_file():  # what is no file, like /dev/stdout, is written to
        raise FileExistsError(f"{str(file)!r} is there already; name another with {option}, or remove it")


def refuse_nowhere(file: Path, option: str) -> None:
    """Go on if there is a directory in which a file can be written, before all is flown that it is to hold.

    Raises
    ------
    FileNotFoundError
        When there is none.
    """
    if not file.absolute().parent.is_dir():
        raise FileNotFoundError(f"{option} {file}: there is no directory {file.parent}")


@contextmanager
def unless_empty(path: Path) -> Iterator[None]:
    """A directory or file made for what the block finds; it goes again where that was nothing."""
    with system_errors.afterwards(partial(_remove_if_empty, path)):
        yield


def on_a_command_line(path: Path) -> str:
    """A path as one word of a shell, and never an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def _remove_if_empty(path: Path) -> None:
    if path.is_dir():
        if not any(path.iterdir()):
            path.rmdir()
    elif path.exists() and not path.stat().st_size:
        path.unlink()


def _file(file: Path | str, how: str, ending: str = ".toml", option: str = "--out") -> Path:
    if isinstance(file, str):
        return _claimed(Path(), f"{how}-{_shortened(file)}", ending, partial(Path.touch, exist_ok=False))
    with system_errors.about(file):
        try:
            file.touch(exist_ok=False)
        except FileExistsError as error:
            raise FileExistsError(f"{str(file)!r} is there already; name another file with {option}") from error
    return file


def _claimed(folder: Path, stem: str, ending: str, make: Callable[[Path], None]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number in itertools.count(1):
        path = folder / f"{stem}{f'-{number}' if number > 1 else ''}{ending}"
        try:
            make(path)
        except FileExistsError:
            continue
        return path
    raise AssertionError("there is always another number")


def _shortened(name: str) -> str:
    """A name of a file, as one that can have something appended, and be shown in a line."""
    shown = "".join(letter if letter.isprintable() else "_" for letter in name)
    return os.fsencode(shown)[:_LONGEST].decode(errors="ignore")
