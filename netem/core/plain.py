"""Records of arrays <-> plain maps of numbers and nested lists, validated field by field.

A record is a NamedTuple (messages, of which there are many) or a frozen dataclass (briefs). What travels is readable by any
MessagePack codec; what arrives is checked against the record it claims to be. A reader is built once per record, so
checking a message costs microseconds.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import msgpack
import numpy as np
from numpy.typing import NDArray

from analysis.models.arrays import Array, Integers, Mask

T = TypeVar("T")
Reader = Callable[[Any], Any]


class PlainError(ValueError):
    """What was wrong in a plain value, and in which field."""

    def __init__(self, problem: str, path: str = "") -> None:
        super().__init__(f"{path.lstrip('.')}: {problem}" if path else problem)
        self.problem = problem
        self.path = path

    def inside(self, step: str) -> PlainError:
        """The same problem, seen from one level further out."""
        return PlainError(self.problem, f"{step}{self.path}")


def plainly(value: Any) -> Any:
    """One level of a dataclass or array as a map or list: a `default` hook for a packer."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if is_dataclass(value):
        kind: Any = type(value)
        return {name: getattr(value, name) for name in _names(kind)}
    raise TypeError(f"{type(value).__name__} has no plain form")


def to_plain(record: Any) -> Any:
    """A record, or a list of them, as plain maps and lists all the way down."""
    return msgpack.unpackb(msgpack.packb(record, default=plainly))


def from_plain(kind: type[T], value: Any) -> T:
    """An instance of the record `kind` from plain maps and lists.

    Raises
    ------
    PlainError
        When a field is missing, unknown or of the wrong type.
    """
    hint: Any = kind
    built: T = _reader(hint)(value)
    return built


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(f.name for f in fields(kind)) if is_dataclass(kind) else getattr(kind, "_fields", ())


@cache
def _reader(hint: Any) -> Reader:
    origin = get_origin(hint)
    if hint is Any:
        return lambda value: value
    if origin in (Union, types.UnionType):
        return _optional(hint)
    if origin is tuple:
        return _tuple(hint)
    if origin is Literal:
        return _word(get_args(hint))
    if origin in (dict, Mapping):
        return _map(hint)
    if origin is list:
        return _list
    if isinstance(hint, type) and _names(hint):
        return _record(hint)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return _enum(hint)
    if hint not in _LEAVES:
        leaves = ", ".join(leaf.__name__ if isinstance(leaf, type) else str(leaf) for leaf in _LEAVES)
        raise TypeError(f"{hint} has no plain form: records are made of {leaves}, and of tuples and records of them")
    return _LEAVES[hint]


def _refuse(what: str, value: Any) -> PlainError:
    shown = repr(value)
    return PlainError(f"expected {what}, got {shown if len(shown) < 80 else shown[:77] + '...'}")


def _int(value: Any) -> int:
    if type(value) is not int:
        raise _refuse("an integer", value)
    return value


def _float(value: Any) -> float:
    if type(value) is not float and type(value) is not int:
        raise _refuse("a number", value)
    return float(value)


def _str(value: Any) -> str:
    if type(value) is not str:
        raise _refuse("a text", value)
    return value


def _bool(value: Any) -> bool:
    if type(value) is not bool:
        raise _refuse("true or false", value)
    return value


def _list(value: Any) -> list[Any]:
    if type(value) is not list:
        raise _refuse("a list", value)
    return value


def _word(words: tuple[str, ...]) -> Reader:
    def read(value: Any) -> str:
        if type(value) is not str or value not in words:
            raise _refuse(f"one of {list(words)}", value)
        return value

    return read


def _enum(kind: type[Enum]) -> Reader:
    members = {member.value: member for member in kind}

    def read(value: Any) -> Enum:
        if not isinstance(value, str | int) or value not in members:
            raise _refuse(f"one of {list(members)}", value)
        return members[value]

    return read


def _optional(hint: Any) -> Reader:
    """Of several options the last is read; but a whole number is one, where it may be."""
    options = get_args(hint)
    inner = [_reader(option) for option in options if option is not type(None)][-1]

    def read(value: Any) -> Any:
        if (value is None and type(None) in options) or (type(value) is int and int in options):
            return value
        return inner(value)

    return read


def _array(dtype: np.dtype[Any]) -> Reader:
    accepted = {"b": "b", "i": "i", "u": "i", "f": "if"}[dtype.kind]

    def read(value: Any) -> Any:
        try:
            array = np.array(value)
        except (TypeError, ValueError, OverflowError) as error:
            raise _refuse(f"a rectangular list of {dtype}", value) from error
        if array.dtype.kind not in accepted and array.size:
            raise _refuse(f"a nested list of {dtype}, or one", value)
        return array.astype(dtype)

    return read


def _tuple(hint: Any) -> Reader:
    items = get_args(hint)
    each = _reader(items[0]) if len(items) == 2 and items[1] is Ellipsis else None
    readers = [] if each else [_reader(item) for item in items]

    def read(value: Any) -> tuple[Any, ...]:
        if type(value) is not list or not (each or len(value) == len(readers)):
            raise _refuse("a list" if each else f"a list of {len(readers)}", value)
        try:
            if each:
                return tuple([each(entry) for entry in value])
            return tuple([item(entry) for item, entry in zip(readers, value, strict=True)])
        except PlainError as error:
            raise error.inside("[]") from error

    return read


def _map(hint: Any) -> Reader:
    item = _reader(get_args(hint)[1])

    def read(value: Any) -> dict[str, Any]:
        if type(value) is not dict:
            raise _refuse("a map", value)
        return {key: item(entry) for key, entry in value.items()}

    return read


def _record(kind: Any) -> Reader:
    hints = get_type_hints(kind)
    names = _names(kind)
    expected = frozenset(names)
    readers = [(name, _reader(hints[name])) for name in names]

    def read(value: Any) -> Any:
        if type(value) is not dict:
            raise _refuse(f"a map ({kind.__name__})", value)
        if value.keys() != expected:
            unknown, missing = sorted(map(str, value.keys() - expected)), sorted(expected - value.keys())
            raise PlainError(f"{kind.__name__} has the fields {list(names)}: unknown {unknown}, missing {missing}")
        built = []
        for name, reader in readers:
            try:
                built.append(reader(value[name]))
            except PlainError as error:
                raise error.inside(f".{name}") from error
        return kind(*built)

    return read


# Array types are told by being equal to these: what NumPy makes of `NDArray` inside differs between its releases.
_LEAVES: Mapping[Any, Reader] = {
    int: _int,
    float: _float,
    str: _str,
    bool: _bool,
    Array: _array(np.dtype(np.float64)),
    Integers: _array(np.dtype(np.int64)),
    NDArray[np.uint8]: _array(np.dtype(np.uint8)),
    NDArray[np.uint64]: _array(np.dtype(np.uint64)),
    Mask: _array(np.dtype(np.bool_)),
}
