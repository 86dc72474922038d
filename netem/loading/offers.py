"""What installed packages offer, by name; none of it is imported."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from functools import lru_cache
from importlib.metadata import entry_points
from pathlib import Path
from types import MappingProxyType

_Folders = tuple[tuple[str, int], ...]


def offered(group: str) -> Mapping[str, str]:
    """What installed packages offer in a group of entry points: "module:Class" by name."""
    return _offered(group, _folders())


def _folders() -> _Folders:
    """Where packages lie, and when one was last installed there or taken away: reading them all takes milliseconds."""
    paths = (Path(folder) for folder in sys.path)
    return tuple((str(path), path.stat().st_mtime_ns) for path in paths if path.exists())


@lru_cache(maxsize=8)
def _offered(group: str, _: _Folders) -> Mapping[str, str]:
    return MappingProxyType({point.name: f"{point.module}:{point.attr}" for point in entry_points(group=group)})
