"""Estimators and control laws by name: entry points of any installed package, or "module:Class"."""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from importlib.metadata import entry_points
from typing import Any, get_type_hints

from pydantic import ConfigDict, ValidationError, create_model

from affinet import explain, forms
from affinet.sections import ScenarioError
from affinet.words import among, hint
from agents.process import Choice

ESTIMATORS = "affinet.estimators"
LAWS = "affinet.controllers"


def names(group: str) -> list[str]:
    """The names that installed packages offer in a group."""
    return sorted(point.name for point in entry_points(group=group))


def choose(group: str, key: str, name: str, parameters: dict[str, Any]) -> Choice:
    """The algorithm of this name with these parameters, checked against its fields.

    Parameters
    ----------
    group
        `ESTIMATORS` or `LAWS`.
    key
        Of the scenario, for error messages.
    name
        An entry point, or "module:Class".
    parameters
        Keyword arguments; those not given keep their defaults.

    Raises
    ------
    ScenarioError
        When there is no such algorithm, or it has no such parameter, or a value does not fit.
    """
    path = _path(group, key, name)
    algorithm = _load(key, path)
    if not is_dataclass(algorithm):
        raise ScenarioError(f"{key}: {path} is not a dataclass of its parameters")
    hints = get_type_hints(algorithm)
    known: dict[str, Any] = {field.name: (hints[field.name], field.default) for field in fields(algorithm)}
    model = create_model("Parameters", __config__=ConfigDict(extra="forbid", strict=True), **known)
    try:
        checked = model.model_validate(parameters)
    except ValidationError as error:
        (first, *_) = error.errors()
        where = f"agents.parameters.{name}.{forms.place(model, first['loc']).key}"
        wrong = explain.wrong(first, model)
        if first["type"] == "extra_forbidden":
            wrong = f"unknown; {hint(first['loc'][0], known)}".rstrip("; ")
        raise ScenarioError(f"{where}: {wrong}; {name} has {', '.join(known) or 'no parameters'}") from error
    return Choice(path, checked.model_dump())


def check_names(key: str, given: Iterable[str]) -> None:
    """Refuse parameters of an algorithm that does not exist.

    Raises
    ------
    ScenarioError
        When a name is neither an entry point nor "module:Class".
    """
    known = [*names(ESTIMATORS), *names(LAWS)]
    for name in given:
        if name not in known and ":" not in name:
            raise ScenarioError(f"{key}.{name}: no such estimator or law; {among(name, known)}")


def _path(group: str, key: str, name: str) -> str:
    if ":" in name:
        return name
    offered = {point.name: point.value for point in entry_points(group=group)}
    if name not in offered:
        raise ScenarioError(f"{key}: no {name!r}; {among(name, sorted(offered))}, or give 'module:Class'")
    return offered[name]


def _load(key: str, path: str) -> Any:
    module, _, attribute = path.partition(":")
    try:
        return getattr(importlib.import_module(module), attribute)
    except (ImportError, AttributeError) as error:
        raise ScenarioError(f"{key}: cannot load {path}: {error}") from error
