"""An estimator or a law that was made in Python, as a scenario says it: the name of its class, and its parameters."""

from __future__ import annotations

import sys
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from affinet.scenario import values
from affinet.scenario.wrong import ScenarioError
from netem.core.plain import shown
from netem.loading import parameters
from netem.loading.calling import Calling, name_of
from netem.loading.parameters import ParameterError
from netem.processes.user_code import UserCodeError

KEYS = frozenset({"agents.estimator", "agents.law"})


def said(key: str, algorithm: Any) -> tuple[str, dict[str, Any]]:
    """The "module:Class" of an algorithm, and those of its parameters that are not as by default.

    Parameters
    ----------
    key
        Of the scenario, for error messages.
    algorithm
        An object of a dataclass.

    Raises
    ------
    ScenarioError
        When it is none, or it cannot be made again of its name and of what a scenario can say.
    UserCodeError
        When its class fails to make it again.
    """
    kind = type(algorithm)
    if isinstance(algorithm, type):
        raise ScenarioError(
            f"{key}: {algorithm.__qualname__} is a class: give an object, {algorithm.__qualname__}(...)"
        )
    if not is_dataclass(algorithm):
        raise ScenarioError(f"{key}: {shown(algorithm)} is no name, and no object of a dataclass of parameters")
    name = name_of(kind)
    if _named(kind) is not kind:
        raise ScenarioError(
            f"{key}: {name} does not lead to the class of this object: define it at the top of a module, a script or a "
            "notebook, and make the object after that"
        )
    given = {
        one.name: _plain(key, one.name, getattr(algorithm, one.name))
        for one in fields(algorithm)
        if one.init and not _is_default(one, getattr(algorithm, one.name))
    }
    _refuse_another(key, algorithm, _made(key, kind, given))
    return name, given


def _named(kind: type) -> Any:
    found: Any = sys.modules.get(kind.__module__)
    for step in kind.__qualname__.split("."):
        found = getattr(found, step, None)
    return found


def _is_default(one: Field[Any], value: Any) -> bool:
    default = one.default if one.default_factory is MISSING else one.default_factory()
    return type(value) is type(default) and _alike(value, default)


def _alike(one: Any, other: Any) -> bool:
    """Whether a scenario says the same of both; of what none can say, whether they are one."""
    try:
        return one is other or bool(values.plain(one) == values.plain(other))
    except TypeError:
        return False


def _plain(key: str, name: str, value: Any) -> Any:
    try:
        return values.plain(value)
    except TypeError as error:
        raise ScenarioError(f"{key}: {name} is {error}") from error


def _made(key: str, kind: type, given: dict[str, Any]) -> Any:
    try:
        with Calling(kind, "__init__"):
            return kind(**parameters.arguments(kind, given))
    except UserCodeError as error:
        if isinstance(refused := error.__cause__, ParameterError):
            raise ScenarioError(f"{key}: {name_of(kind)}: {refused}") from error
        raise


def _refuse_another(key: str, algorithm: Any, again: Any) -> None:
    for one in fields(algorithm):
        before, after = getattr(algorithm, one.name), getattr(again, one.name)
        if one.init and not _alike(before, after):
            says = f"made again of its parameters it has {one.name} {shown(after)}, not {shown(before)}"
            raise ScenarioError(f"{key}: {name_of(type(algorithm))}: {says}: let its parameters say all that it is")
