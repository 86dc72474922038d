"""The public functions of the floors that take or give arrays: whatever is to be compared in a batch and alone."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from importlib.metadata import entry_points
from types import ModuleType
from typing import Any

FLOORS = ("netem", "agents", "world", "analysis")
_ARRAYS = r"\b(Array|Arrays|ArrayLike|NDArray|ndarray|Mask|Integers|Words|VerdictCodes|Marks|Counts|Fields|Reading)\b"


def functions() -> dict[str, Any]:
    """Public functions, methods and properties annotated with arrays, or tuples of arrays, by their full names."""
    modules = [module for floor in FLOORS for module in _modules(floor)]
    bundles = sorted(
        name
        for module in modules
        for name, kind in _own(module)
        if inspect.isclass(kind) and issubclass(kind, tuple) and re.search(_ARRAYS, str(kind.__annotations__))
    )
    speaks = re.compile("|".join([_ARRAYS, rf"\b({'|'.join(bundles)})\b"]))
    return {
        name: function
        for module in modules
        for name, function in _callables(module)
        if any(speaks.search(str(said)) for said in function.__annotations__.values())
    }


def by_entry_point() -> set[str]:
    """The estimators and laws that a scenario can name, as full names of their classes."""
    groups = ("affinet.estimators", "affinet.controllers")
    return {entry.value.replace(":", ".") for group in groups for entry in entry_points(group=group)}


def _modules(floor: str) -> list[ModuleType]:
    package = importlib.import_module(floor)
    names = [found.name for found in pkgutil.walk_packages(package.__path__, f"{floor}.")]
    return [importlib.import_module(name) for name in names if not name.endswith("__main__")]


def _own(module: ModuleType) -> list[tuple[str, Any]]:
    named = vars(module).items()
    return [
        (name, held) for name, held in named if name[0] != "_" and getattr(held, "__module__", "") == module.__name__
    ]


def _callables(module: ModuleType) -> Iterator[tuple[str, Any]]:
    for name, held in _own(module):
        if not inspect.isclass(held):
            if inspect.isfunction(inspect.unwrap(held)):
                yield f"{module.__name__}.{name}", inspect.unwrap(held)
            continue
        for method, member in vars(held).items():
            function = _function(member)
            if method[0] != "_" and inspect.isfunction(function):
                yield f"{module.__name__}.{name}.{method}", function


def _function(member: Any) -> Any:
    for inner in ("fget", "func", "__func__"):
        member = getattr(member, inner, member)
    return member
