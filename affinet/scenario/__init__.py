"""A TOML in, a typed scenario out; every error with its file, key and what would be right.

What reads scenarios is imported when it is asked for: the command line knows words and files of theirs, and no models.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from affinet.scenario.loading import extended as extended
    from affinet.scenario.loading import load as load
    from affinet.scenario.loading import shipped as shipped

__all__ = ["extended", "load", "shipped"]


def _looked_up(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from affinet.scenario import loading

    globals()[name] = found = getattr(loading, name)
    return found


if not TYPE_CHECKING:
    __getattr__ = _looked_up  # type checkers would take any name for one that is there
