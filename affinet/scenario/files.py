"""TOML files by name: the user's own, or those that come with affinet."""

from __future__ import annotations

import os
import re
import tomllib
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

from affinet.scenario.words import hint, one_line
from affinet.scenario.wrong import ScenarioError


class Read(NamedTuple):
    """A file: its name, its text, what it says, and the folder that paths in it are relative to."""

    name: str
    text: str
    says: dict[str, Any]
    folder: Path


def working_directory() -> Path:
    """Where the process works.

    Raises
    ------
    ScenarioError
        When that has been deleted meanwhile.
    """
    try:
        return Path.cwd()
    except FileNotFoundError as error:
        raise ScenarioError("the working directory is not there any more: go to one that is") from error


def shipped(folder: str) -> list[str]:
    """Names of the files in a folder of the package."""
    items = (resources.files("affinet.shipped") / folder).iterdir()
    return sorted(item.name.removesuffix(".toml") for item in items if item.name.endswith(".toml"))


def read(name: str, folder: str, what: str) -> Read:
    """The file of this path, or the one that is shipped under this name; `what` it should be, for people.

    Raises
    ------
    ScenarioError
        When there is none, or it is not TOML.
    """
    path = Path(name)
    if path.suffix == ".toml" and path.is_file():
        try:
            text = path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise ScenarioError(f"{path.name}: not UTF-8, as TOML must be: {error}") from error
    elif name in shipped(folder):
        path = Path(str(resources.files("affinet.shipped") / folder)) / f"{name}.toml"
        text = path.read_text(encoding="utf-8")
    else:
        near = hint(path.stem, shipped(folder))
        raise ScenarioError(f"{name}: no such file, and no such {what}; {near}shipped are {', '.join(shipped(folder))}")
    try:
        return Read(path.name, text, tomllib.loads(text), Path(os.path.abspath(path)).parent)
    except (ValueError, RecursionError) as error:  # of nests and numbers that are too large, beside what is no TOML
        raise ScenarioError(_not_toml(path.name, one_line(str(error)))) from error


def _not_toml(name: str, said: str) -> str:
    """What the parser said, with its line where ours stand."""
    place = re.fullmatch(r"(.*?) \(at line (\d+), column (\d+)\)", said)
    return f"{name}:{place[2]}: not TOML: {place[1]}, at column {place[3]}" if place else f"{name}: not TOML: {said}"
