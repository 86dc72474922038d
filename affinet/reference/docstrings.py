"""What docstrings say: the first line of anything, and each parameter of a dataclass or a function, with its unit."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, get_type_hints

from affinet.reference.entries import Parameter, kind_of, plain
from netem.loading import parameters

_SECTION = re.compile(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", re.MULTILINE | re.DOTALL)
_NAMES = re.compile(r"^(\w+(?:, \w+)*)(?: *:.*)?\n((?:[ \t]+.*\n?|\n)*)", re.MULTILINE)
# Words of docstrings, the longest first.
_UNITS: Mapping[str, str] = {
    "metres per second squared": "m/s2",
    "metres squared per second": "m2/s",
    "metres per second": "m/s",
    "square metres": "m2",
    "metres": "m",
    "radians": "rad",
    "per second squared": "1/s2",
    "per second": "1/s",
    "seconds": "s",
    "ticks": "ticks",
}
_UNIT = re.compile(rf"(?:\bin |, )(1/s\^\([^)]*\)|(?:{'|'.join(_UNITS)})\b)")


def first_line(of: Any) -> str:
    """What something is, in a line; nothing where its docstring is that of a base, or there is none."""
    written = of.__dict__.get("__doc__") if isinstance(of, type) else of.__doc__
    said = inspect.cleandoc(written or "")
    return (
        "" if said.startswith(f"{getattr(of, '__name__', '')}(") else said.partition("\n")[0]
    )  # dataclasses write one


def unit_of(says: str) -> str:
    """The unit that a description names in words; nothing where it names none."""
    found = _UNIT.search(says)
    return "" if found is None else _UNITS.get(found[1], found[1])


def parameters_of(made: Callable[..., Any]) -> Iterator[Parameter]:
    """What a dataclass or a function takes, each with what its docstring, or that of a base, says of it."""
    said = dict(_described(made))
    hints = get_type_hints(made)
    signature = inspect.signature(made)
    for name in parameters.names(made) if isinstance(made, type) else signature.parameters:
        default = signature.parameters[name].default
        required = default is inspect.Parameter.empty
        says = said.get(name, "")
        kind = kind_of(hints.get(name, Any))
        yield Parameter(name, kind, required, None if required else plain(default), unit_of(says), _one_line(says))


def _described(made: Any) -> Iterator[tuple[str, str]]:
    for one in reversed(made.__mro__) if isinstance(made, type) else (made,):
        if one is object:
            continue
        section = _SECTION.search(inspect.cleandoc(one.__doc__ or "") + "\n")
        for names, says in _NAMES.findall(section[1]) if section else ():
            yield from ((name, " ".join(says.split())) for name in names.split(", "))


def _one_line(says: str) -> str:
    """The first sentence; abbreviations end in no blank and a capital."""
    return re.split(r"(?<=\.) (?=[A-Z])", says, maxsplit=1)[0].removesuffix(".")
