"""Scenario files: TOML -> `Scenario`, with overrides, and every error said with its file, key and what would be right."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import ValidationError

from affinet import files, source
from affinet.explain import explained
from affinet.sections import Scenario, ScenarioError
from affinet.source import Source

FILE = "scenario.json"  # in a run directory, as resolved
_FOLDER = "scenarios"


def shipped() -> list[str]:
    """Names of the scenarios that come with affinet."""
    return files.shipped(_FOLDER)


def load(name: str, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario in a file, or one that is shipped, with `a.b=c` overrides applied.

    Raises
    ------
    ScenarioError
        When there is no such scenario, or something in it is wrong.
    """
    file = files.read(name, _FOLDER, "scenario")
    return _validated(file.says, Source(file.name, file.text, tuple(overrides)))


def resolved(out: Path, overrides: Sequence[str] = ()) -> Scenario:
    """The scenario of a run directory, as it was flown, with overrides applied.

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
    return _validated(raw, Source(str(file), "", tuple(overrides)))


def extended(given: Scenario, entries: Sequence[Mapping[str, Any]]) -> Scenario:
    """The scenario with further entries in its timeline, said as a file says them.

    Raises
    ------
    ScenarioError
        When something in them is wrong.
    """
    raw = given.model_dump(mode="json", exclude_none=True)
    raw["timeline"] += entries
    return _validated(raw, Source("in code", "", ()))


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


def _validated(raw: dict[str, Any], origin: Source) -> Scenario:
    for override in origin.overrides:
        _override(raw, override)
    try:
        scenario = Scenario.model_validate(raw)
    except ValidationError as error:
        raise ScenarioError(explained(error, Scenario, origin)) from error
    scenario._source = origin
    return scenario


def _override(raw: dict[str, Any], override: str) -> None:
    key, equals, text = override.partition("=")
    *tables, name = source.parts(key)
    if not equals or not name:
        raise ScenarioError(f"--set {override}: write it as key=value, like network.availability=0.5")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except (ValueError, RecursionError):
        value = text.strip()
    table: Any = raw
    for step in tables:
        table = table.setdefault(step, {})
        if not isinstance(table, dict):
            raise ScenarioError(f"--set {override}: {step} is not a table")
    table[name] = value
