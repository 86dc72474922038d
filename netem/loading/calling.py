"""Where algorithms are loaded and called: what goes wrong in them is said as theirs."""

from __future__ import annotations

import difflib
import inspect
import re
from types import FunctionType, ModuleType, TracebackType
from typing import Any

from netem.loading import modules
from netem.loading.returned import WrongReturn
from netem.processes.user_code import UserCodeError, definition, is_of_a_signal, place_of, text_of, worded

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
        if error is None or isinstance(error, UserCodeError) or is_of_a_signal(error):
            return
        where, written = self._name, self._called
        if not isinstance(written, FunctionType):
            described = written if isinstance(written, type) else type(written)
            where, written = f"{name_of(described)}.{self._name}", _written(described, self._name)
        place = definition(written)
        if isinstance(error, WrongReturn):
            what = text_of(error)
        else:
            what, place = worded(error), place_of(error, written.__module__.partition(".")[0]) or place
        raise UserCodeError(where, what, place) from error


def _written(algorithm: type, name: str) -> Any:
    """The method of this name, as far as it is written anywhere; else the class."""
    method = inspect.getattr_static(algorithm, name, algorithm)  # looking it up may be what went wrong
    method = inspect.unwrap(method.__func__ if isinstance(method, staticmethod | classmethod) else method)
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
        found = _looked_up(found, attribute, name)
    if not isinstance(found, type):
        raise NoSuchAlgorithm(f"{attributes} is no class, but a {type(found).__name__}")
    return found


def _imported(name: str, folder: str | None) -> ModuleType:
    try:
        return modules.imported(name, folder)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            raise NoSuchAlgorithm(
                f"{text_of(error)}; it is looked for beside what names it, beside the scenario and among installed packages"
            ) from error
        raise _not_imported(name, error) from error
    except modules.NameTaken as error:
        raise NoSuchAlgorithm(str(error)) from error
    except BaseException as error:  # a module of the user's own may do anything
        if is_of_a_signal(error):
            raise
        raise _not_imported(name, error) from error


def _not_imported(name: str, error: BaseException) -> UserCodeError:
    return _failed(f"importing {name}", name, error)


def _looked_up(found: Any, attribute: str, module: str) -> Any:
    try:
        return getattr(found, attribute)
    except AttributeError as error:
        raise NoSuchAlgorithm(f"{module} has no {attribute!r}{_instead(found, attribute)}") from error
    except BaseException as error:  # a module's __getattr__ is the user's own code
        if is_of_a_signal(error):
            raise
        raise _failed(f"looking up {attribute!r} in {module}", module, error) from error


def _failed(where: str, module: str, error: BaseException) -> UserCodeError:
    return UserCodeError(where, worded(error), place_of(error, module.partition(".")[0]) or f"module {module}")


def _instead(found: Any, wanted: str) -> str:
    within = vars(found) if isinstance(found, type | ModuleType) else {}
    offered = [name for name, each in within.items() if isinstance(each, type)]
    close = difflib.get_close_matches(wanted, offered, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""
