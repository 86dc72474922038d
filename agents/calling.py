"""Where algorithms are loaded and called: what goes wrong in them is said as theirs."""

from __future__ import annotations

import difflib
import inspect
import re
from types import FunctionType, ModuleType, TracebackType
from typing import Any

from agents import modules
from agents.returned import WrongReturn
from netem.user_code import UserCodeError, definition, is_of_a_signal, place_of, worded

_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*(\.[^\W\d]\w*)*")


class NoSuchAlgorithm(ValueError):
    """A path leads to no class."""


class Calling:
    """Whatever is raised inside the block is said as the doing of a method of an algorithm, or of a class or a function.

    Parameters
    ----------
    called
        An algorithm, its class, or a function.
    name
        Of the method, or for a function of what it is for.

    Raises
    ------
    UserCodeError
        When anything is raised, or the code wants to leave the process.
    """

    __slots__ = ("_called", "_name")

    def __init__(self, called: Any, name: str) -> None:
        self._called = called
        self._name = name

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not isinstance(error, Exception | SystemExit) or isinstance(error, UserCodeError) or is_of_a_signal(error):
            return
        where, written = self._name, self._called
        if not isinstance(written, FunctionType):
            described = written if isinstance(written, type) else type(written)
            where, written = f"{name_of(described)}.{self._name}", _written(described, self._name)
        what, place = str(error), definition(written)
        if not isinstance(error, WrongReturn):
            what, place = worded(error), place_of(error, written.__module__.partition(".")[0]) or place
        raise UserCodeError(where, what, place) from error


def _written(algorithm: type, name: str) -> Any:
    """The method of this name, as far as it is written anywhere; else the class."""
    method = inspect.unwrap(getattr(algorithm, name, algorithm))
    return method if isinstance(method, FunctionType) and not method.__code__.co_filename.startswith("<") else algorithm


def name_of(algorithm: type) -> str:
    """A class as a scenario names it."""
    return f"{algorithm.__module__}:{algorithm.__qualname__}"


def load(path: str, folder: str | None) -> type:
    """The class at "module:Class", of which the module lies in a folder, or is installed.

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
    found: Any = _imported(name, folder)
    for attribute in attributes.split("."):
        if not hasattr(found, attribute):
            raise NoSuchAlgorithm(f"{name} has no {attribute!r}{_instead(found, attribute)}")
        found = getattr(found, attribute)
    if not isinstance(found, type):
        raise NoSuchAlgorithm(f"{attributes} is no class, but a {type(found).__name__}")
    return found


def _imported(name: str, folder: str | None) -> ModuleType:
    try:
        return modules.imported(name, folder)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            raise NoSuchAlgorithm(
                f"{error}; it is looked for beside what names it, beside the scenario and among installed packages"
            ) from error
        raise _not_imported(name, error) from error
    except (Exception, SystemExit) as error:  # a module of the user's own may do anything
        if is_of_a_signal(error):
            raise
        raise _not_imported(name, error) from error


def _not_imported(name: str, error: BaseException) -> UserCodeError:
    return UserCodeError(
        f"importing {name}", worded(error), place_of(error, name.partition(".")[0]) or f"module {name}"
    )


def _instead(found: Any, wanted: str) -> str:
    offered = [name for name, each in vars(found).items() if isinstance(each, type)]
    close = difflib.get_close_matches(wanted, offered, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""
