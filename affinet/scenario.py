"""Scenario files: TOML -> `Scenario`, with overrides, and every error said with its file, key and what would be right."""

from __future__ import annotations

import difflib
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from affinet import events, files, impairments, inputs, sections
from affinet.impairments import Section
from affinet.sections import Scenario, ScenarioError
from affinet.source import Source

FILE = inputs.SCENARIO
_FOLDER = "scenarios"


def shipped() -> list[str]:
    """Names of the scenarios that come with affinet."""
    return files.shipped(_FOLDER)


def load(name: str, overrides: Sequence[str] = (), folder: Path | None = None) -> Scenario:
    """The scenario in a file, or one that is shipped, with `a.b=c` overrides applied.

    Parameters
    ----------
    name
        Of the scenario, or the path of its file. Paths in the file, and modules it names, are relative to its folder.
    overrides
        Changes to it.
    folder
        What paths and modules in the overrides are relative to; by default the scenario's own folder.

    Raises
    ------
    ScenarioError
        When there is no such scenario, or something in it is wrong.
    """
    file = files.read(name, _FOLDER, "scenario")
    source, asked_from = Source(file.name, file.text, tuple(overrides)), folder or file.folder
    scenario = _validated(inputs.anchored(file.says, file.folder), source, asked_from)
    scenario._own = inputs.own(scenario, lambda key, _: _folders(source, key, asked_from, file.folder))
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
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{out}: no run directory: {error}") from error
    source, asked_from = Source(str(file), "", tuple(overrides)), folder or out.absolute()
    scenario = _validated(inputs.anchored(raw, out.absolute()), source, asked_from)
    shelves = {name: out.absolute() / inputs.FOLDER / shelf for name, shelf in inputs.kept(out).modules.items()}

    def folders(key: str, name: str) -> Sequence[Path]:
        return _folders(source, key, asked_from, *([shelves[name]] if name in shelves else []))

    scenario._own = inputs.own(scenario, folders)
    return scenario


def extended(given: Scenario, entries: Sequence[Mapping[str, Any]]) -> Scenario:
    """The scenario with further entries in its timeline, said as a file says them.

    Raises
    ------
    ScenarioError
        When something in them is wrong.
    """
    raw = given.model_dump(mode="json", exclude_none=True)
    raw["timeline"] += entries
    scenario = _validated(raw, Source("in code", "", ()), Path())
    scenario._own = given.own_modules
    return scenario


def to_toml(given: Scenario) -> str:
    """The scenario as a file says it."""
    return tomli_w.dumps(given.model_dump(mode="json", exclude_none=True, exclude_defaults=True) | _verbs(given))


def _verbs(given: Scenario) -> dict[str, Any]:
    # The verb of an entry is a default of its model, and must be said all the same.
    entries = [
        {"verb": entry.model_dump()["verb"]} | entry.model_dump(mode="json", exclude_none=True, exclude_defaults=True)
        for entry in given.timeline
    ]
    return {"timeline": entries} if entries else {}


def _folders(source: Source, key: str, asked_from: Path, *folders: Path) -> Sequence[Path]:
    """Where the module lies that a key names: beside who named it; overrides may name one that lies beside the file, too."""
    return (asked_from, *folders) if source.overrides_say(key) else folders


def _validated(raw: dict[str, Any], source: Source, folder: Path) -> Scenario:
    for override in source.overrides:
        _override(raw, override, folder)
    try:
        scenario = Scenario.model_validate(raw)
    except ValidationError as error:
        raise ScenarioError("\n".join(_explain(source, problem) for problem in error.errors())) from error
    scenario._source = source
    return scenario


def _override(raw: dict[str, Any], override: str, folder: Path) -> None:
    key, equals, text = override.partition("=")
    *tables, name = key.strip().split(".")
    if not equals or not name:
        raise ScenarioError(f"--set {override}: write it as key=value, like network.availability=0.5")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text.strip()
    table: Any = raw
    for step in tables:
        table = table.setdefault(step, {})
        if not isinstance(table, dict):
            raise ScenarioError(f"--set {override}: {step} is not a table")
    said = reduce(lambda inner, step: {step: inner}, reversed([*tables, name]), value)
    table[name] = reduce(lambda outer, step: outer[step], [*tables, name], inputs.anchored(said, folder))


def _explain(source: Source, problem: Mapping[str, Any]) -> str:
    loc = problem["loc"]
    steps = [step for n, step in enumerate(loc) if not _is_tag(loc, n)]
    key = ".".join(str(step + 1) if isinstance(step, int) else step for step in steps) or "scenario"
    return f"{source.place(key)}: {key}: {_what_would_be_right(loc, problem)}"


def _is_tag(loc: Sequence[str | int], place: int) -> bool:
    """Whether a step is the tag of a timeline entry or loss: it stands in pydantic's path, but in no key of the file."""
    return place >= 2 and loc[place - 2] in ("timeline", "loss") and isinstance(loc[place - 1], int)


def _tagged(loc: Sequence[str | int]) -> tuple[str, Mapping[str, type[Section]]]:
    """The key that says which entry of the timeline, or which loss, it is; and all there are."""
    return ("verb", events.VERBS) if loc[0] == "timeline" else ("model", impairments.LOSSES)


def _what_would_be_right(loc: Sequence[str | int], problem: Mapping[str, Any]) -> str:
    message: str = problem["msg"].removeprefix("Value error, ").replace("Input should", "should")
    given = problem.get("input")
    match problem["type"]:
        case "extra_forbidden":
            known = _known_keys(loc[:-1])
            close = difflib.get_close_matches(str(loc[-1]), known, n=1)
            hint = f"did you mean {close[0]!r}? " if close else ""
            return f"unknown key; {hint}known here: {', '.join(known)}"
        case "missing":
            return "is missing; it has no default"
        case "union_tag_not_found" | "union_tag_invalid":
            tag, among = _tagged(loc)
            return f"needs a {tag} among {', '.join(among)}"
        case "value_error":
            return message
    return message if isinstance(given, dict | list) else f"{message}, got {given!r}"


def _known_keys(loc: Sequence[str | int]) -> list[str]:
    if loc and _is_tag(loc, len(loc) - 1):
        return sorted(_tagged(loc)[1][str(loc[-1])].model_fields)
    models: list[Any] = [sections.Scenario]
    for step in loc:
        if isinstance(step, int):
            continue
        annotations = [str(model.model_fields[step].annotation) for model in models if step in model.model_fields]
        if annotations:  # else it is a name that the user gave
            models = [
                model for model in _every_section() if any(re.search(rf"\b{model.__name__}\b", a) for a in annotations)
            ]
    return sorted({field for model in models for field in model.model_fields})


def _every_section() -> list[type[Section]]:
    found, queue = [], [Section]
    while queue:
        for model in queue.pop().__subclasses__():
            found.append(model)
            queue.append(model)
    return found
