"""Where algorithms are loaded and called: what goes wrong in them is said as theirs."""

from __future__ import annotations

import difflib
import importlib
import re
import sys
from contextlib import redirect_stdout
from types import ModuleType, TracebackType
from typing import Any

from agents.returned import WrongReturn
from netem.user_code import UserCodeError, definition, is_of_a_signal, place_of, worded

_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


class NoSuchAlgorithm(ValueError):
    """A path leads to no class."""


class Calling:
    """Whatever is raised inside the block is said as the doing of a method of an algorithm, a class or an instance of it.

    Raises
    ------
    UserCodeError
        When anything is raised, or the code wants to leave the process.
    """

    __slots__ = ("_algorithm", "_method")

    def __init__(self, algorithm: Any, method: str) -> None:
        self._algorithm = algorithm
        self._method = method

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not isinstance(error, Exception | SystemExit) or is_of_a_signal(error):
            return
        described = self._algorithm if isinstance(self._algorithm, type) else type(self._algorithm)
        method = getattr(described, self._method, described)
        written = hasattr(method, "__code__") and not method.__code__.co_filename.startswith("<")
        here = definition(method if written else described)
        if isinstance(error, WrongReturn):
            what, place = str(error), here
        else:
            what, place = worded(error), place_of(error, described.__module__.partition(".")[0]) or here
        raise UserCodeError(f"{name_of(described)}.{self._method}", what, place) from error


def name_of(algorithm: type) -> str:
    """A class as a scenario names it."""
    return f"{algorithm.__module__}:{algorithm.__qualname__}"


def load(path: str) -> type:
    """The class at "module:Class".

    Raises
    ------
    NoSuchAlgorithm
        When there is no such module, or no such class in it.
    UserCodeError
        When the module cannot be imported.
    """
    if not _PATH.fullmatch(path):
        raise NoSuchAlgorithm("write it as module:Class")
    name, _, attributes = path.partition(":")
    found: Any = _imported(name)
    for attribute in attributes.split("."):
        if not hasattr(found, attribute):
            raise NoSuchAlgorithm(f"{name} has no {attribute!r}{_instead(found, attribute)}")
        found = getattr(found, attribute)
    if not isinstance(found, type):
        raise NoSuchAlgorithm(f"{attributes} is no class, but a {type(found).__name__}")
    return found


def _imported(name: str) -> ModuleType:
    try:
        with redirect_stdout(sys.stderr):
            return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            raise NoSuchAlgorithm(f"{error}; it is looked for beside the scenario and among installed packages") from error
        raise _not_imported(name, error) from error
    except (Exception, SystemExit) as error:  # a module of the user's own may do anything
        if is_of_a_signal(error):
            raise
        raise _not_imported(name, error) from error


def _not_imported(name: str, error: BaseException) -> UserCodeError:
    return UserCodeError(f"importing {name}", worded(error), place_of(error, name.partition(".")[0]) or f"module {name}")


def _instead(found: Any, wanted: str) -> str:
    offered = [name for name, each in vars(found).items() if isinstance(each, type)]
    close = difflib.get_close_matches(wanted, offered, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""
