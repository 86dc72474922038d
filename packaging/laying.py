"""Lays the rooms that lie beside `affinet` in the repository within it, and calls them so wherever they are imported."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

PACKAGE = "affinet"
ROOMS = ("agents", "analysis", "netem", "world")
_FROM = re.compile(rb"from[ \t]+(?=\w)")


class CannotBeLaid(ValueError):
    """A file says the name of a module in a way that would be wrong within the package: which, and what to write."""


class _Insertion(NamedTuple):
    line: int
    column: int  # in bytes
    length: int  # of what is replaced
    text: str


def lay(tree: Path) -> None:
    """Move the rooms of a source tree into its package.

    Raises
    ------
    CannotBeLaid
        When a file has to be written otherwise first.
    """
    for room in ROOMS:
        (tree / room).rename(tree / PACKAGE / room)
    files = sorted((tree / PACKAGE).rglob("*.py"))
    modules = frozenset(".".join(file.relative_to(tree / PACKAGE).with_suffix("").parts) for file in files)
    for file in files:
        file.write_bytes(imports_within(file.read_bytes(), modules, str(file.relative_to(tree))))


def project_within(project: Mapping[str, Any]) -> dict[str, Any]:
    """What `pyproject.toml` says, with every script and entry point where the rooms are now."""
    said = dict(project["project"])
    said["scripts"] = _points_within(said["scripts"])
    said["entry-points"] = {group: _points_within(points) for group, points in said["entry-points"].items()}
    wheel = {"build": {"targets": {"wheel": {"packages": [PACKAGE]}}}}
    return {"build-system": project["build-system"], "project": said, "tool": {"hatch": wheel}}


def imports_within(source: bytes, modules: Collection[str], file: str) -> bytes:
    """A file with every import of a room as one from within the package; nothing else of it changes.

    Parameters
    ----------
    source
        The file.
    modules
        All modules of the rooms, by their names in the repository.
    file
        Its name, for errors.

    Raises
    ------
    CannotBeLaid
        When it names a module in a string, or imports one by a name that another would then have.
    """
    lines = source.splitlines(keepends=True)
    for node in ast.walk(tree := ast.parse(source, file)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and _names_a_module(node.value, modules):
            raise CannotBeLaid(f"{file}:{node.lineno}: {node.value!r} names a module: take its __name__ instead")
    for line, column, length, text in sorted(_insertions(tree, lines, file), reverse=True):
        row = lines[line - 1]
        lines[line - 1] = row[:column] + text.encode() + row[column + length :]
    return b"".join(lines)


def _insertions(tree: ast.AST, lines: list[bytes], file: str) -> Iterator[_Insertion]:
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and not node.level and _of_a_room(node.module or ""):
            start = _FROM.match(lines[node.lineno - 1], node.col_offset)
            if start is None:
                raise CannotBeLaid(f"{file}:{node.lineno}: write `from {node.module}` on one line")
            yield _Insertion(node.lineno, start.end(), 0, f"{PACKAGE}.")
        elif isinstance(node, ast.Import):
            yield from (_of_an_alias(alias, file) for alias in node.names if _of_a_room(alias.name))


def _of_an_alias(alias: ast.alias, file: str) -> _Insertion:
    if alias.asname:
        return _Insertion(alias.lineno, alias.col_offset, 0, f"{PACKAGE}.")
    if "." in alias.name:
        above, _, last = alias.name.rpartition(".")
        raise CannotBeLaid(f"{file}:{alias.lineno}: write `from {above} import {last}` for `import {alias.name}`")
    text = f"{PACKAGE}.{alias.name} as {alias.name}"
    return _Insertion(alias.lineno, alias.col_offset, len(alias.name), text)


def _points_within(points: Mapping[str, str]) -> dict[str, str]:
    return {name: f"{PACKAGE}.{path}" if _of_a_room(path) else path for name, path in points.items()}


def _of_a_room(path: str) -> bool:
    return re.split("[.:]", path, maxsplit=1)[0] in ROOMS


def _names_a_module(text: str, modules: Collection[str]) -> bool:
    """Whether it is the path of a module of a room, or of something in one; a room's own name is a word like any other."""
    return "." in text and _of_a_room(text) and text.partition(":")[0] in modules
