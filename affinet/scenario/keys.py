"""What a key of a file is, for people: a line and its unit, of which the JSON schema, `affinet list` and the docs are made."""

from __future__ import annotations

from typing import Any

from pydantic import Field
from pydantic.config import JsonDict

UNIT = "unit"  # in the JSON schema of a key


def key(default: Any, says: str, unit: str = "") -> Any:
    """A field of a model.

    Parameters
    ----------
    default
        Its value where a file says none; `...` of one that has to be said, and `list` or `dict` of one that is empty.
    says
        What it is, in one line, without its unit.
    unit
        Of its numbers.
    """
    extra: JsonDict | None = {UNIT: unit} if unit else None
    if default in (list, dict):
        return Field(default_factory=default, description=says, json_schema_extra=extra)
    return Field(default=default, description=says, json_schema_extra=extra)
