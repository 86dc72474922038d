"""Where the rooms are that affinet is made of: within it in a wheel, beside it in a checkout.

In a checkout anybody may have their names: a project its own `agents/` or `world.py`, openai-agents its `agents`. Whichever
comes first on the path takes the place of the other, and no part of affinet could be imported.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.machinery import PathFinder
from pathlib import Path

_ROOMS = ("agents", "analysis", "netem", "world")
_HERE = Path(__file__).parent
_WITHIN = (_HERE / _ROOMS[0]).is_dir()


class RoomShadowed(RuntimeError):
    """Another module comes before a room of a checkout: which, and the way out."""


def module(room: str, path: str) -> str:
    """The name by which a module of a room, or of affinet itself, is imported."""
    return ".".join([*(["affinet"] if _WITHIN and room in _ROOMS else []), room, path])


def folder(room: str) -> Path:
    """In which a room lies, or affinet itself."""
    if room == _HERE.name:
        return _HERE
    return (_HERE if _WITHIN else _HERE.parent) / room


def refuse_shadows() -> None:
    """Go on if the rooms are affinet's own.

    Raises
    ------
    RoomShadowed
        If one is not.
    """
    __tracebackhide__ = True
    for room in () if _WITHIN else _ROOMS:
        ours = _HERE.parent / room / "__init__.py"
        for file in _found(room):
            if not (file.exists() and file.samefile(ours)):
                raise RoomShadowed(
                    f"{file} comes before affinet's own {ours.parent}: rename it, run where it is not on the path, "
                    f"or install affinet as a wheel, which keeps its names to itself: pip install {_HERE.parent}"
                )


def _found(room: str) -> Iterator[Path]:
    """The files that have a room's name: what was imported, and what a new process would import."""
    for file in (getattr(sys.modules.get(room), "__file__", None), getattr(PathFinder.find_spec(room), "origin", None)):
        if file is not None:
            yield Path(file)
