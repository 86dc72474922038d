"""What some exports need beside affinet, which not everybody has installed."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


class NotInstalled(ImportError):
    """A library is missing: which, and how it is installed."""


def needed(library: str, extra: str, what: str) -> ModuleType:
    """A library that comes with an extra of affinet.

    Parameters
    ----------
    library, extra
        Its module, and the extra that brings it.
    what
        What is made with it, for the error.

    Raises
    ------
    NotInstalled
        When it is missing.
    """
    try:
        return import_module(library)
    except ModuleNotFoundError as error:
        raise NotInstalled(
            f"{what} is made with {library.partition('.')[0]}: pip install 'affinet[{extra}]'"
        ) from error
