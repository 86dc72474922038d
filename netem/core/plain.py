"""Records of arrays <-> plain maps of numbers and nested lists: what may stand in a file or travel to another process.

msgspec reads and checks them by their type hints (docs/decisions/0015); arrays are the one thing it does not know.
"""

from __future__ import annotations

from typing import Any, TypeVar, get_args, get_origin

import msgspec
import numpy as np

T = TypeVar("T")

# Kinds of numbers that will do for an array of a kind.
_KINDS = {"b": "b", "i": "i", "u": "iu", "f": "iuf"}

_WHOLE = 2**53  # up to here every whole number is a float


class PlainError(ValueError):
    """What was wrong in a plain value, and in which field."""


def plainly(value: Any) -> Any:
    """An array as nested lists: what an encoder does with all it does not know."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no plain form")


def as_array(hint: Any, value: Any) -> Any:
    """Nested lists as the array that a type hint asks for: what a decoder does with all it does not know.

    Raises
    ------
    TypeError
        When the hint is no array.
    ValueError
        When the value is none of that kind.
    """
    if get_origin(hint) is not np.ndarray:
        raise TypeError(
            f"{hint} has no plain form: records are made of numbers, texts, truths, arrays, and records of them"
        )
    dtype = np.dtype(get_args(get_args(hint)[1])[0])
    try:
        array = np.array(value)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        raise ValueError(f"expected a rectangular list of {dtype}, got {shown(value)}") from error
    if array.size and (array.dtype.kind not in _KINDS[dtype.kind] or not _holds(dtype, array)):
        raise ValueError(f"expected a nested list of {dtype}, or one, got {shown(value)}")
    return array.astype(dtype)


def to_plain(record: Any) -> Any:
    """A record, or a list of them, as plain maps and lists all the way down."""
    return msgspec.to_builtins(record, enc_hook=plainly)


def from_plain(kind: type[T], value: Any) -> T:
    """An instance of the record `kind` from plain maps and lists.

    Raises
    ------
    PlainError
        When a field is missing, or of the wrong type.
    """
    try:
        return msgspec.convert(value, kind, dec_hook=as_array)
    except msgspec.ValidationError as error:
        raise PlainError(f"{kind.__name__}: {located(error)}") from error


def located(error: msgspec.ValidationError, root: str = "$") -> str:
    """What was wrong in a plain value, the field first, as seen from `root`."""
    problem, _, place = str(error).partition(" - at ")
    field = place.strip("`").removeprefix(root).removeprefix(".")
    problem = problem[:1].lower() + problem[1:]
    return f"{field}: {problem}" if field else problem


def shown(given: Any) -> str:
    """Whatever it is, in a few words."""
    try:
        text = repr(given)
    except RecursionError:
        return f"a {type(given).__name__} that nests too deep"
    return text if len(text) < 80 else text[:77] + "..."


def _holds(dtype: np.dtype[Any], array: np.ndarray[Any, Any]) -> bool:
    if dtype.kind == "f" and array.dtype.kind in "iu":
        return bool(((array <= _WHOLE) & (array >= -_WHOLE)).all())
    return dtype.kind not in "iu" or bool((array.astype(dtype) == array).all())
