"""Modules of algorithms: from a folder of the user's own, or from what is installed.

A module in a folder stays what it is whatever else has its name: one beside another scenario, or a copy of an earlier state.
So a folder's modules are imported once, and give way in `sys.modules` when another folder's are wanted.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib.machinery import PathFinder
from importlib.util import module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from netem.processes.user_code import OURS

_HOME = Path(__file__).parents[__name__.count(".")]  # in which our packages lie


class NameTaken(ValueError):
    """A module of a user's own is called like a package of which affinet is made."""


def imported(name: str, folder: str | None) -> ModuleType:
    """The module of this name.

    Parameters
    ----------
    name
        With dots, as an import says it.
    folder
        In which it lies; None for one that is installed.

    Raises
    ------
    ImportError
        When there is no such module; and whatever it raises itself.
    NameTaken
        When it would take the place of a package of ours.
    """
    _refuse_to_replace_ours(name.partition(".")[0], folder)
    found: ModuleType = _SHELVES.installed(name) if folder is None else _SHELVES.module(name, folder)
    return found


def holder(module: str, folders: Iterable[Path]) -> Path | None:
    """The first of these folders in which a module lies."""
    steps = module.split(".")
    for folder in folders if all(steps) else ():
        here = folder.joinpath(*steps)
        if here.with_name(f"{steps[-1]}.py").is_file() or (here / "__init__.py").is_file():
            return folder
    return None


def is_running(path: str) -> bool:
    """Whether "module:Class" is of the script or notebook that runs: no other process has it."""
    return path.startswith(("__main__:", "__mp_main__:"))


def sources(folder: str) -> frozenset[Path]:
    """The files of all modules that were imported from a folder so far."""
    return frozenset(_SHELVES.sources(folder))


@dataclass
class _Shelf:
    """What was imported from a folder: modules by name, and the names that were not there before."""

    modules: dict[str, Any] = field(default_factory=dict)
    brought: set[str] = field(default_factory=set)
    on_path: bool = False


@dataclass
class _Shelves:
    """The folders from which modules came, and the one whose modules are in `sys.modules`."""

    shelves: dict[str, _Shelf] = field(default_factory=dict)
    open: str | None = None

    def module(self, name: str, folder: str) -> Any:
        shelf = self.shelves.setdefault(folder, _Shelf())
        if name not in shelf.modules:
            self._change_to(folder)
            before = set(sys.modules)
            importlib.invalidate_caches()
            _import_top(name.partition(".")[0], folder)
            importlib.import_module(name)
            here = {one: module for one, module in sys.modules.items() if _lies_in(module, folder)}
            shelf.brought |= here.keys() - before
            shelf.modules |= {one: here[one] for one in here if one in shelf.brought or one == name}
        return shelf.modules[name]

    def installed(self, name: str) -> Any:
        if self.open is not None and holder(name, [Path(self.open)]):
            self._close()
        return importlib.import_module(name)

    def sources(self, folder: str) -> Iterable[Path]:
        shelf = self.shelves.get(folder, _Shelf())
        return (Path(module.__file__) for module in shelf.modules.values())

    def _change_to(self, folder: str) -> None:
        if self.open != folder:
            self._close()
        shelf, self.open = self.shelves[folder], folder
        sys.modules.update({name: shelf.modules[name] for name in shelf.brought})
        if folder not in sys.path:
            sys.path.append(folder)  # last: what lies beside takes the place of nothing that is installed
            shelf.on_path = True

    def _close(self) -> None:
        if self.open is None:
            return
        shelf = self.shelves[self.open]
        for name in shelf.brought:
            sys.modules.pop(name, None)
        if shelf.on_path and self.open in sys.path:
            sys.path.remove(self.open)
        shelf.on_path, self.open = False, None


_SHELVES = _Shelves()


def _refuse_to_replace_ours(top: str, folder: str | None) -> None:
    if folder is None or top not in OURS or Path(folder).resolve() == _HOME.resolve():
        return
    package = Path(folder) / top
    file = package if package.is_dir() else package.with_suffix(".py")
    raise NameTaken(f"{file} is called like a package of affinet's own: rename it")


def _import_top(name: str, folder: str) -> None:
    """Import a module from its folder, though a module of its name may be installed, or come from another folder."""
    spec = PathFinder.find_spec(name, [folder])
    known = sys.modules.get(name)
    if spec is None or (known is not None and _lies_in(known, folder)):
        return
    for other in [one for one in sys.modules if one == name or one.startswith(f"{name}.")]:
        del sys.modules[other]
    module = sys.modules[name] = module_from_spec(spec)
    if spec.loader is not None:  # else it is a folder of modules and no more
        try:
            spec.loader.exec_module(module)
        except BaseException:
            sys.modules.pop(name, None)
            raise


def _lies_in(module: Any, folder: str) -> bool:
    """Whether a module lies in a folder, and not in a folder of packages below it."""
    file = getattr(module, "__file__", None)
    if not file or not Path(file).is_relative_to(folder):
        return False
    below = [entry for entry in sys.path if entry and entry != folder and Path(entry).is_relative_to(folder)]
    return not any(Path(file).is_relative_to(entry) for entry in below)
