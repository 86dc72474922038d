"""What is said of one thing there is: its name, a line, and its parameters."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from affinet.scenario import values
from affinet.scenario.keys import UNIT

_KINDS: Mapping[Any, str] = {float: "number", int: "whole number", bool: "true or false", str: "text"}
_TABLES = (dict, Mapping)


@dataclass(frozen=True)
class Parameter:
    """A parameter, or a key of a table.

    Parameters
    ----------
    name
        As a file says it.
    kind
        Of its values, in words.
    required
        Whether it has to be given.
    default
        What it is where it is not given, in plain values.
    unit
        Of its numbers, if they have one.
    says
        What it is, in a line.
    """

    name: str
    kind: str
    required: bool
    default: Any
    unit: str
    says: str


@dataclass(frozen=True)
class Entry:
    """Something there is.

    Parameters
    ----------
    name
        By which files and commands say it.
    says
        What it is, in a line.
    parameters
        What it takes.
    package
        Which brings it.
    """

    name: str
    says: str
    parameters: tuple[Parameter, ...] = field(default=())
    package: str = "affinet"


def of_model(model: type[BaseModel]) -> Iterator[Parameter]:
    """The keys of a table, but the word by which it is told from others."""
    for name, info in model.model_fields.items():
        if info.description is not None:
            yield _of_field(name, info)


def _of_field(name: str, info: FieldInfo) -> Parameter:
    extra = info.json_schema_extra
    unit = extra.get(UNIT, "") if isinstance(extra, dict) else ""
    default = None if info.is_required() else plain(info.get_default(call_default_factory=True))
    return Parameter(name, kind_of(info.annotation), info.is_required(), default, str(unit), info.description or "")


def kind_of(hint: Any) -> str:
    """What values of a type are, in words."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return kind_of(inner[0])
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(kind_of(member) for member in inner if member is not type(None)))
    if origin is Literal:
        return " | ".join(map(str, inner))
    if isinstance(hint, type) and issubclass(hint, Enum):
        return " | ".join(str(member.value) for member in hint)
    if (origin or hint) in _TABLES or (isinstance(hint, type) and issubclass(hint, BaseModel)):
        return "table"
    return _KINDS.get(hint, "list" if origin is not None else "any")


def plain(value: Any) -> Any:
    """A default as a file says it; of what none can say, how Python writes it."""
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_none=True)
    try:
        return values.plain(value)
    except TypeError:
        return repr(value)
