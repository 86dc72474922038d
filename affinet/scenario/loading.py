"""Scenario files: TOML -> `Scenario`, with overrides, and every error said with its file, key and what would be right."""

from __future__ import annotations

import json
import os
import re
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError
from pydantic_core import PydanticSerializationError

from affinet.scenario import files, inputs
from affinet.scenario import overrides as changes
from affinet.scenario.explain import explained
from affinet.scenario.overrides import Given, Override
from affinet.scenario.sections import Scenario
from affinet.scenario.source import IN_CODE, Source
from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from netem.core.plain import shown

FILE = inputs.SCENARIO
_FOLDER = "scenarios"
_ROW = 100  # letters in a row of a list
_LIST = re.compile(r'\[\n(?P<items>(?: +(?:[-+.\w]+|"[^"\\\s]*"),\n)+)(?P<indent> *)\]')


def shipped() -> list[str]:
    """Names of the scenarios that come with affinet."""
    return files.shipped(_FOLDER)


def load(name: str | Path, overrides: Sequence[Given] = (), folder: Path | None = None, **settings: Any) -> Scenario:
    """The scenario in a file, or one that is shipped, changed.

    Parameters
    ----------
    name
        Of the scenario, or the path of its file. Paths in the file, and modules it names, are relative to its folder.
    overrides
        Changes to it, the last of which hold: texts like `network.availability=0.5`, and tables like
        `{"network.availability": 0.5}`.
    folder
        What paths and modules in the overrides are relative to; by default the scenario's own folder.
    settings
        One more table of overrides: `estimator="rkf"`, `network={"availability": 0.5}`.

    Raises
    ------
    ScenarioError
        When there is no such scenario, or something in it is wrong.
    TypeError
        When name or overrides are something else.
    UserCodeError
        When the class of an estimator or a law that is given as an object fails.
    """
    if not isinstance(name, str | os.PathLike):
        raise TypeError(f"{shown(name)} is no scenario: give the name of one that is shipped, or the path of a file")
    if not isinstance(overrides, list | tuple) or not all(isinstance(one, str | Mapping) for one in overrides):
        says = "give a list of texts like 'time.duration=5', and of tables like {'time.duration': 5}"
        raise TypeError(f"{shown(overrides)} are no overrides: {says}")
    file = files.read(os.fspath(name), _FOLDER, "scenario")
    changed = changes.read([*overrides, settings])
    origin, asked_from = _source(file.name, file.text, changed), folder or file.folder
    scenario = _validated(inputs.anchored(file.says, file.folder), origin, changed, asked_from)
    scenario._own = inputs.own(scenario, lambda key, _: _folders(origin, key, asked_from, file.folder))
    return scenario


def resolved(out: Path, overrides: Sequence[str] = (), folder: Path | None = None) -> Scenario:
    """The scenario of a run directory, as it was flown, with overrides applied.

    Parameters
    ----------
    out
        The run directory. What the run read is taken from the copies in there.
    overrides, folder
        Changes to it, and what paths and modules in them are relative to, by default the run directory.

    Raises
    ------
    ScenarioError
        When there is none, or it cannot be read any more.
    """
    file = out / FILE
    try:
        raw = json.loads(file.read_text(encoding="utf-8"))
        if not isinstance(raw, dict):
            raise TypeError(f"{FILE} holds no table")
    except (OSError, ValueError, TypeError, RecursionError) as error:
        of_tests = "" if out.exists() else ", or a failed test: pytest keeps those of its last three sessions"
        named = f"name one that `affinet run` printed{of_tests}"
        why = error.strerror if isinstance(error, OSError) else error
        raise ScenarioError(f"{out}: no run directory: {why}; {named}") from error
    changed = changes.read(overrides)
    origin, asked_from = _source(str(file), "", changed), folder or out.absolute()
    scenario = _validated(inputs.anchored(raw, out.absolute()), origin, changed, asked_from)
    shelves = {name: out.absolute() / inputs.FOLDER / shelf for name, shelf in inputs.kept(out).modules.items()}

    def folders(key: str, name: str) -> Sequence[Path]:
        return _folders(origin, key, asked_from, *([shelves[name]] if name in shelves else []))

    scenario._own = inputs.own(scenario, folders)
    return scenario


def extended(given: Scenario, entries: Sequence[Mapping[str, Any]]) -> Scenario:
    """The scenario with further entries in its timeline, said as a file says them.

    Raises
    ------
    ScenarioError
        When something in them is wrong.
    TypeError
        When these are no scenario and no list.
    """
    if not isinstance(entries, list | tuple):
        raise TypeError(f"{shown(entries)} are no entries: give a list of tables, each like {{'verb': 'kill', ...}}")
    scenario = _again(given, entries)
    scenario._source = IN_CODE
    return scenario


def checked(given: Scenario) -> Scenario:
    """The same scenario, held against what a file may say: a copy that pydantic has changed is not.

    Raises
    ------
    ScenarioError
        When something in it is wrong.
    """
    return _again(given, ())


def _again(given: Scenario, entries: Sequence[Any]) -> Scenario:
    if not isinstance(given, Scenario):
        raise TypeError(f"{shown(given)} is no Scenario: give one that affinet.scenario.load has read")
    try:
        raw = given.model_dump(mode="json", exclude_none=True, warnings=False)
    except PydanticSerializationError as error:
        raise ScenarioError(f"{IN_CODE.file}: {one_line(str(error))}") from error
    if entries and isinstance(raw.get("timeline"), list):
        raw["timeline"] += entries
    scenario = _valid(raw, IN_CODE)
    scenario._source, scenario._own = given._source, given.own_modules
    return scenario


def to_toml(given: Scenario) -> str:
    """The scenario as a file says it."""
    return _in_rows(
        tomli_w.dumps(given.model_dump(mode="json", exclude_none=True, exclude_defaults=True) | _verbs(given))
    )


def _in_rows(text: str) -> str:
    """A file in which lists of numbers, and of words, have as many to a line as it holds, and not one."""

    def row(found: re.Match[str]) -> str:
        items, indent = " ".join(found["items"].split()).removesuffix(","), found["indent"]
        if len(indent) + len(items) < _ROW:
            return f"[{items}]"
        lines = textwrap.fill(items, _ROW, initial_indent=f"{indent}    ", subsequent_indent=f"{indent}    ")
        return f"[\n{lines},\n{indent}]"

    return _LIST.sub(row, text)


def _verbs(given: Scenario) -> dict[str, Any]:
    # The verb of an entry is a default of its model, and must be said all the same.
    entries = [
        {"verb": entry.model_dump()["verb"]} | entry.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        for entry in given.timeline
    ]
    return {"timeline": entries} if entries else {}


def _folders(origin: Source, key: str, asked_from: Path, *folders: Path) -> Sequence[Path]:
    """Where the module lies that a key names: beside who named it; overrides may name one that lies beside the file, too."""
    return (asked_from, *folders) if origin.overrides_say(key) else folders


def _source(name: str, text: str, changed: Sequence[Override]) -> Source:
    return Source(name, text, tuple(one.key for one in changed))


def _validated(raw: dict[str, Any], origin: Source, changed: Sequence[Override], folder: Path) -> Scenario:
    changes.put(raw, changed, folder)
    scenario = _valid(raw, origin)
    scenario._source = origin
    return scenario


def _valid(raw: dict[str, Any], origin: Source) -> Scenario:
    try:
        return Scenario.model_validate(raw)
    except ValidationError as error:
        raise ScenarioError(
            explained(error, Scenario, origin)
        ) from None  # it has all that pydantic says, in better words
