"""`affinet list`: what there is of each kind, with parameters, units and defaults."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from affinet.cli.show import plain
from affinet.scenario.sections import ScenarioError
from affinet.scenario.words import among

if TYPE_CHECKING:
    from affinet.reference.entries import Entry

KINDS = ("scenarios", "estimators", "laws", "profiles", "impairments", "verbs", "checkers", "studies", "figures")
_INDENT = 4


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet list` in."""
    listing = commands.add_parser(
        "list",
        help="what there is: scenarios, estimators, verbs, ..., with parameters, units and defaults",
        description="List what there is of a kind, that of installed packages included.",
    )
    listing.add_argument("kind", nargs="?", choices=KINDS, metavar="KIND", help=f"one of: {', '.join(KINDS)}")
    listing.add_argument("name", nargs="?", metavar="NAME", help="this one alone")
    listing.add_argument("--json", action="store_true", help="print one JSON object")


def print_list(parsed: argparse.Namespace) -> None:
    """Print what there is.

    Raises
    ------
    ScenarioError
        When there is nothing of this name.
    """
    from affinet.reference import catalogue  # studies and what reads docstrings take a while to import

    kinds = KINDS if parsed.kind is None else (parsed.kind,)
    found = {kind: list(catalogue.KINDS[kind]()) for kind in kinds}
    if parsed.name is not None:
        found[parsed.kind] = _called(parsed.name, parsed.kind, found[parsed.kind])
    if parsed.json:
        print(json.dumps({kind: [asdict(entry) for entry in entries] for kind, entries in found.items()}))  # noqa: T201
    elif parsed.kind is None:
        _print_kinds(found)
    else:
        _print_entries(found[parsed.kind])


def _called(name: str, kind: str, entries: Sequence[Entry]) -> list[Entry]:
    chosen = [entry for entry in entries if entry.name == name]
    if not chosen:
        raise ScenarioError(f"{name}: none of the {kind}; {among(name, [entry.name for entry in entries])}")
    return chosen


def _print_kinds(found: dict[str, list[Entry]]) -> None:
    table = _table()
    for kind, entries in found.items():
        table.add_row(f"affinet list {kind}", plain(", ".join(entry.name for entry in entries)))
    Console().print(table)


def _print_entries(entries: Sequence[Entry]) -> None:
    console = Console()
    for entry in entries:
        brought = "" if entry.package == "affinet" else f" ({entry.package})"
        console.print(Text(plain(entry.name + brought).plain, style="bold"))
        console.print(Padding(plain(entry.says), (0, 0, 0, _INDENT)))
        if entry.parameters:
            console.print(Padding(_parameters(entry), (0, 0, 0, 2 * _INDENT)))


def _parameters(entry: Entry) -> Table:
    from affinet.reference.catalogue import default_of

    table = _table()
    for one in entry.parameters:
        kind = f"[{one.kind}]" if " | " in one.kind else ""
        table.add_row(plain(one.name), plain(default_of(one)), plain(" ".join(filter(None, (one.says, kind)))))
    return table


def _table() -> Table:
    return Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
