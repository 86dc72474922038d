"""The files that a scenario names: where they lie, and the copies of them that make a run directory whole.

A path counts from the folder of the file that names it, never from where somebody happens to work. A run keeps a copy of
all it read in `inputs/`, and flies again from there.
"""

from __future__ import annotations

import filecmp
import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from affinet.scenario.sections import Scenario
from affinet.scenario.wrong import ScenarioError
from analysis.models.finding import Finding
from netem.core.parts import parts
from netem.loading import modules
from netem.medium.medium import JOURNAL

FOLDER = "inputs"  # in a run directory
SCENARIO = "scenario.json"  # in a run directory, as resolved
_BOOK = "inputs.json"
# What is read of a run directory that stands in for a world.
FLIGHT = tuple(f"arrays/{name}.npy" for name in ("measured", "position", "input"))


@dataclass(frozen=True)
class Kept:
    """What a run directory says of its inputs.

    Parameters
    ----------
    originals
        Where each copy was taken from, by its path in the folder of inputs.
    modules
        In which of those folders the module of an algorithm lies, by "module:Class".
    verdicts
        The journal that judged the run in place of the models.
    """

    originals: Mapping[str, str] = field(default_factory=dict)
    modules: Mapping[str, str] = field(default_factory=dict)
    verdicts: str | None = None


def anchored(said: Any, folder: Path) -> Any:
    """A scenario, or a part of it, as a file of this folder says it, with every path whole."""
    return _placed(said, lambda path: os.path.abspath(folder / path))


def own(given: Scenario, folders: Callable[[str, str], Iterable[Path]]) -> dict[str, Path]:
    """The folders in which the modules that a scenario names lie, by "module:Class"; without those that are installed.

    A class of `__main__` is one of the script or notebook that runs, whatever file of that name there is.

    Parameters
    ----------
    given
        The scenario.
    folders
        Where to look, by the key that names the algorithm, and its name.
    """
    named = {f"agents.parameters.{name}": name for name in given.agents.parameters}
    named |= {"agents.estimator": given.agents.estimator, "agents.law": given.agents.law}
    named |= {
        f"network.profiles.{profile}.loss.{number}.model": loss.model
        for profile, said in given.network.profiles.items()
        for number, loss in said.own
    }
    found = {
        name: modules.holder(name.partition(":")[0], folders(key, name))
        for key, name in named.items()
        if ":" in name and not modules.is_running(name)
    }
    return {name: folder for name, folder in found.items() if folder is not None}


def files_of_modules(name: str, folder: Path) -> list[Path]:
    """The files of "module:Class", of its package if it is in one, and of all that was imported from its folder so far."""
    top = folder / name.partition(":")[0].partition(".")[0]
    package = [file for file in top.rglob("*") if file.is_file() and "__pycache__" not in file.parts]
    return sorted({*modules.sources(str(folder)), *package})


def keep(given: Scenario, journal: Path | None, out: Path) -> Scenario:
    """Copy all that a run reads into its directory; the scenario that names the copies.

    Parameters
    ----------
    given
        The scenario.
    journal
        What judges the run in place of the models, if something does.
    out
        The run directory.
    """
    copies = _Copies(out / FOLDER)
    said, flight = given.model_dump(mode="json", exclude_none=True), given.recorded
    told = _placed(said | {"recorded": None}, lambda path: f"{FOLDER}/{copies.of(Path(path))}")
    if flight is not None:
        told["recorded"] = {"flight": f"{FOLDER}/{copies.of_flight(Path(flight.flight))}"}
    folders = {name: copies.of_modules(name, folder) for name, folder in given.own_modules.items()}
    verdicts = None if journal is None else copies.of_journal(journal)
    if copies.originals:
        book = Kept(copies.originals, folders, verdicts)
        (out / FOLDER / _BOOK).write_text(json.dumps(vars(book), indent=2) + "\n", encoding="utf-8")
    return Scenario.model_validate(told)


def kept(out: Path) -> Kept:
    """What a run directory says of its inputs.

    Raises
    ------
    ScenarioError
        When it cannot be read any more.
    """
    file = out / FOLDER / _BOOK
    if not file.exists():
        return Kept()
    try:
        return _whole(Kept(**json.loads(file.read_text(encoding="utf-8"))))
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise ScenarioError(f"{file}: not what a run wrote there: {error}") from error


def _whole(book: Kept) -> Kept:
    for name in ("originals", "modules"):
        table = getattr(book, name)
        if not isinstance(table, dict) or not all(map(_names_a_file, table.values())):
            raise TypeError(f"{name} must be a table of paths")
    if book.verdicts is not None and not _names_a_file(book.verdicts):
        raise TypeError("verdicts must be a path")
    return book


def _names_a_file(said: Any) -> bool:
    return isinstance(said, str) and "\0" not in said


def changed(out: Path) -> list[Finding]:
    """Which originals are no longer what was flown."""
    return [
        Finding("inputs", "note", f"{original} is not what it was: the copy {FOLDER}/{copy} is flown")
        for copy, original in kept(out).originals.items()
        if Path(original).is_file() and not _alike(Path(original), out / FOLDER / copy)
    ]


def _alike(one: Path, other: Path) -> bool:
    try:
        return filecmp.cmp(one, other, shallow=False)
    except OSError:
        return False


@dataclass
class _Copies:
    """Copies in a folder: one of each file, under a name of its own."""

    folder: Path
    originals: dict[str, str] = field(default_factory=dict)
    _files: dict[Path, str] = field(default_factory=dict)
    _shelves: dict[Path, str] = field(default_factory=dict)

    def of(self, path: Path) -> str:
        """Where the copy of a file lies in the folder; of a run directory, where what can be read again of it lies."""
        if path not in self._files:
            copy = self._files[path] = self._name(path)
            if path.is_dir():
                self._copy(path / SCENARIO, f"{copy}/{SCENARIO}")
                self._copy_parts(path / JOURNAL, copy)
            else:
                self._copy(path, copy)
        return self._files[path]

    def of_journal(self, path: Path) -> str:
        """Where the copy of a journal lies in the folder, with its parts beside it."""
        copy = self._files[path] = self._name(Path("journal"))
        self._copy_parts(path, copy)
        return f"{copy}/{path.name}"

    def of_flight(self, path: Path) -> str:
        """Where the copy of a flight lies in the folder: of a run directory, what stands in for a world."""
        if not path.is_dir():
            return self.of(path)
        copy = self._files[path] = self._name(path)
        for file in (SCENARIO, *FLIGHT):
            self._copy(path / file, f"{copy}/{file}")
        return copy

    def of_modules(self, name: str, folder: Path) -> str:
        """Where the copies of all modules lie that came from a folder."""
        if folder not in self._shelves:
            self._shelves[folder] = self._name(Path("modules"))
        copy = self._shelves[folder]
        for file in files_of_modules(name, folder):
            self._copy(file, f"{copy}/{file.relative_to(folder).as_posix()}")
        return copy

    def _name(self, path: Path) -> str:
        taken = {_BOOK, *self._files.values(), *self._shelves.values()}
        names = (path.name, *(f"{path.stem}-{n}{path.suffix}" for n in range(2, len(taken) + 3)))
        return next(name for name in names if name and name not in taken)

    def _copy_parts(self, path: Path, copy: str) -> None:
        for file in parts(path) or [path]:
            self._copy(file, f"{copy}/{file.name}")

    def _copy(self, file: Path, copy: str) -> None:
        if copy not in self.originals:
            (self.folder / copy).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, self.folder / copy)
            self.originals[copy] = os.path.abspath(file)


def _placed(said: Any, place: Callable[[str], str]) -> Any:
    """A scenario, or a part of it, with its paths put elsewhere; what is malformed stays for others to complain of."""
    if _table(said, "recorded"):
        said = said | {"recorded": _with_path(said["recorded"], "flight", place)}
    for name in ("formation", "manoeuvre"):
        if _table(said, name):
            said = said | {name: _with_path(said[name], "file", place)}
    profiles = _table(_table(said, "network"), "profiles")
    if not profiles:
        return said
    moved = {name: _profile_placed(profile, place) for name, profile in profiles.items()}
    return said | {"network": said["network"] | {"profiles": moved}}


def _profile_placed(profile: Any, place: Callable[[str], str]) -> Any:
    if not isinstance(profile, dict):
        return profile
    moved = dict(profile)
    if isinstance(losses := profile.get("loss"), list):
        moved["loss"] = [_with_path(loss, "file", place) for loss in losses]
    if "delay" in profile:
        moved["delay"] = _with_path(profile["delay"], "table", place)
    for key in ("delay", "rate"):
        if isinstance(table := moved.get(key), dict) and "trace" in table:
            moved[key] = table | {"trace": _with_path(table["trace"], "file", place)}
    return moved


def _with_path(table: Any, key: str, place: Callable[[str], str]) -> Any:
    if isinstance(table, dict) and isinstance(table.get(key), str):
        return table | {key: place(table[key])}
    return table


def _table(said: Any, name: str) -> dict[str, Any]:
    inner = said.get(name) if isinstance(said, dict) else None
    return inner if isinstance(inner, dict) else {}
