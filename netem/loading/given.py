"""What is given to a user's own code: arrays that it can read and not write, since others hold the same ones.

What is made for it alone, or by it, is protected where it is; what others still write to is given as a view.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

_PLAIN = frozenset({int, float, bool, str, bytes})  # the commonest: to ask what else they may be takes longer


def readonly(given: Any) -> Any:
    """The same value, with views that cannot be written to in place of its arrays; tuples and maps are gone through."""
    if isinstance(given, np.ndarray):
        if given.flags.writeable:
            given = given.view()
            given.setflags(write=False)
        return given
    if given is None or type(given) in _PLAIN:
        return given
    if isinstance(given, tuple):
        parts = map(readonly, given)
        return type(given)(*parts) if hasattr(given, "_fields") else tuple(parts)
    if isinstance(given, (dict, Mapping)):
        return {name: readonly(part) for name, part in given.items()}
    return given


def protect(given: Any) -> None:
    """Make the arrays in a value that lasts, in its fields and theirs, such that nobody can write to them."""
    if isinstance(given, np.ndarray):
        if given.flags.writeable:  # asking costs less than telling
            given.setflags(write=False)
    elif given is None or type(given) in _PLAIN:
        return
    elif isinstance(given, tuple):
        for part in given:
            protect(part)
    elif isinstance(given, (dict, Mapping)):
        for part in given.values():
            protect(part)
    elif is_dataclass(given) and not isinstance(given, type):
        for field in fields(given):
            protect(getattr(given, field.name))
