"""`affinet list`: what there is of each kind, with parameters, units and defaults."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict

from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from affinet.cli.options.beginning import LISTED
from affinet.cli.show import plain
from affinet.reference import catalogue
from affinet.reference.catalogue import default_of
from affinet.reference.entries import Entry
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError

_INDENT = 4


def print_list(parsed: argparse.Namespace) -> None:
    """Print what there is.

    Raises
    ------
    ScenarioError
        When there is nothing of this name.
    """
    kinds = LISTED if parsed.kind is None else (parsed.kind,)
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
    table = _table()
    for one in entry.parameters:
        kind = f"[{one.kind}]" if " | " in one.kind else ""
        table.add_row(plain(one.name), plain(default_of(one)), plain(" ".join(filter(None, (one.says, kind)))))
    return table


def _table() -> Table:
    return Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
