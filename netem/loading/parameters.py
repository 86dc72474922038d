"""Parameters of an algorithm, from what a scenario file can say, by the annotations of its dataclass.

A file says numbers, truths, texts, lists and tables; they become what is annotated, a tuple for instance, and nothing is bent:
no truth is a number, no text is one, and a float is finite.
"""

from __future__ import annotations

import difflib
import inspect
import json
import math
import types
from collections.abc import Collection, Iterable, Mapping, MutableMapping, MutableSequence, Sequence
from dataclasses import InitVar, is_dataclass
from enum import Enum
from functools import lru_cache
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

_LISTS = (list, Sequence, MutableSequence, Collection, Iterable)
_MAPS = (dict, Mapping, MutableMapping)
_BITS = 63


class ParameterError(ValueError):
    """What is wrong with a parameter, and which it is."""

    def __init__(self, says: str, *path: str) -> None:
        super().__init__(f"{'.'.join(path)}: {says}" if path else says)
        self.says = says
        self.path = path

    def inside(self, step: object) -> ParameterError:
        """The same problem, seen from one level further out."""
        return ParameterError(self.says, str(step), *self.path)


def names(algorithm: type) -> list[str]:
    """The parameters there are."""
    return list(_parameters(algorithm))


def arguments(algorithm: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """What to make the algorithm with; parameters that are not given keep their defaults.

    Raises
    ------
    ParameterError
        When one is unknown, missing, or does not fit its annotation.
    NameError
        When an annotation cannot be resolved.
    """
    known = _parameters(algorithm)
    for name in given:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            raise ParameterError(f"unknown{hint}", name)
    for name, parameter in known.items():
        if parameter.default is parameter.empty and name not in given:
            raise ParameterError("is missing; it has no default", name)
    if not given:
        return {}
    hints = _hints(algorithm)
    return {name: _inside(name, hints.get(name, Any), value) for name, value in given.items()}


# Many plans are made of the same algorithms, one after the other.
@lru_cache(maxsize=64)
def _hints(algorithm: type) -> Mapping[str, Any]:
    return get_type_hints(algorithm)


@lru_cache(maxsize=64)
def _parameters(algorithm: type) -> Mapping[str, inspect.Parameter]:
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    return {
        name: parameter
        for name, parameter in inspect.signature(algorithm).parameters.items()
        if parameter.kind not in variable
    }


def _inside(step: object, hint: Any, value: Any) -> Any:
    try:
        return _read(hint, value)
    except ParameterError as error:
        raise error.inside(step) from error


def _read(hint: Any, value: Any) -> Any:
    if isinstance(hint, InitVar):
        return _read(hint.type, value)
    if hasattr(hint, "__supertype__"):
        return _read(hint.__supertype__, value)
    if hasattr(hint, "__value__"):
        return _read(hint.__value__, value)
    origin, inner = get_origin(hint) or hint, get_args(hint)
    if origin in (Annotated, Final):
        return _read(inner[0], value)
    if hint in (Any, object):
        return _plain(value)
    if origin is Literal:
        return _word(inner, value)
    if origin in (Union, types.UnionType):
        return _any_of(inner, value)
    if origin in _LISTS:
        return [_inside(number + 1, (inner or (Any,))[0], each) for number, each in enumerate(_list(value))]
    if origin is tuple:
        return _tuple(inner, value)
    if origin in _MAPS:
        of_values = inner[1] if inner else Any
        return {name: _inside(name, of_values, each) for name, each in _table(value).items()}
    return _one(hint, value)


def _one(hint: Any, value: Any) -> Any:
    if hint in (None, type(None)):
        raise _should("be left out", value)
    if hint is bool:
        return _exactly(bool, "true or false", value)
    if hint is int:
        return _whole(value)
    if hint is float:
        return _number(value)
    if hint is str:
        return _exactly(str, 'text in quotes, like "text"', value)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint(_word([member.value for member in hint], value))
    if isinstance(hint, type) and is_dataclass(hint):
        return hint(**arguments(hint, _table(value)))
    raise ParameterError(
        f"is a {getattr(hint, '__name__', hint)}, which a scenario cannot say; it says numbers, truths, texts, lists and tables"
    )


def _plain(value: Any) -> Any:
    match value:
        case bool() | str():
            return value
        case int():
            return _whole(value)
        case float():
            return _number(value)
        case list():
            return [_inside(number + 1, Any, each) for number, each in enumerate(value)]
        case dict():
            return {name: _inside(name, Any, each) for name, each in value.items()}
    raise _should("be a number, truth, text, list or table", value)


def _word(words: Sequence[Any], value: Any) -> Any:
    for word in words:
        if type(word) is type(value) and word == value:
            return word
    *first, last = map(_said, words)
    raise _should(f"be {', '.join(first)}{' or ' * bool(first)}{last}", value)


def _any_of(options: Sequence[Any], value: Any) -> Any:
    if type(value) in options:  # a whole number is one, where it may be
        return _read(type(value), value)
    refused = []
    for option in options:
        try:
            return _read(option, value)
        except ParameterError as error:
            if option is not type(None):
                refused.append(error)
    if len(refused) == 1:
        raise refused[0]
    raise ParameterError("; or ".join(dict.fromkeys(str(error) for error in refused)))


def _tuple(inner: Sequence[Any], value: Any) -> tuple[Any, ...]:
    given = _list(value)
    each = [inner[0]] * len(given) if len(inner) == 2 and inner[1] is Ellipsis else list(inner or [Any] * len(given))
    if len(each) != len(given):
        raise _should(f"be a list of {len(each)}", value)
    return tuple(_inside(number + 1, hint, one) for number, (hint, one) in enumerate(zip(each, given, strict=True)))


def _list(value: Any) -> list[Any]:
    return _exactly(list, "a list, like [1.0, 2.0]", value)


def _table(value: Any) -> dict[str, Any]:
    return _exactly(dict, "a table", value)


def _exactly(kind: type, what: str, value: Any) -> Any:
    if type(value) is not kind:
        raise _should(f"be {what}", value)
    return value


def _whole(value: Any) -> int:
    if type(value) is not int:
        raise _should("be a whole number, like 3", value)
    if value.bit_length() > _BITS:
        raise ParameterError(f"should fit into {_BITS + 1} bits, got one of {value.bit_length()}")
    return value


def _number(value: Any) -> float:
    if type(value) not in (int, float):
        raise _should("be a number, like 0.5", value)
    if not math.isfinite(_whole(value) if type(value) is int else value):
        raise _should("be a finite number", value)
    return float(value)


def _should(what: str, value: Any) -> ParameterError:
    shown = _said(value)
    return ParameterError(f"should {what}, got {shown if len(shown) < 80 else f'{shown[:77]}...'}")


def _said(value: Any) -> str:
    """A value as a file says it."""
    return repr(value) if isinstance(value, float) else json.dumps(value, default=str, ensure_ascii=False)
