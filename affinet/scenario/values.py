"""Values of Python as a scenario file says them: numbers, truths, texts, lists and tables."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from netem.core.plain import shown


def plain(value: Any) -> Any:
    """The same value, as a file says it; None where it says none.

    Raises
    ------
    TypeError
        When no file can say it.
    """
    match value:
        case Enum():
            return plain(value.value)
        case np.floating():
            return float(value)
        case np.ndarray() | np.generic():
            return plain(value.tolist())
        case os.PathLike():
            return os.fspath(value)
        case Mapping():
            return {str(name): plain(inner) for name, inner in value.items()}
        case list() | tuple():
            return [plain(inner) for inner in value]
        case None | bool() | int() | float() | str():
            return value
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    says = "a scenario says numbers, truths, texts, lists and tables, and arrays as lists"
    raise TypeError(f"{shown(value)}: {says}")
