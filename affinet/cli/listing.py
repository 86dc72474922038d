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
from affinet.planning import registry
from affinet.reference import catalogue
from affinet.reference.catalogue import default_of
from affinet.reference.docstrings import first_line, parameters_of
from affinet.reference.entries import Entry
from affinet.scenario import files
from affinet.scenario.profiles import IMPAIRMENTS
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from netem.loading import modules

_INDENT = 4
# Of which there may be some of one's own, by "module:Class".
_OWN = {"estimators": registry.ESTIMATORS, "laws": registry.LAWS, "impairments": IMPAIRMENTS}


def print_list(parsed: argparse.Namespace) -> None:
    """Print what there is.

    Raises
    ------
    ScenarioError
        When there is nothing of this name.
    UserCodeError
        When a module of one's own fails.
    """
    if parsed.name is None:
        kinds = LISTED if parsed.kind is None else (parsed.kind,)
        found = {kind: list(catalogue.KINDS[kind]()) for kind in kinds}
    elif ":" in parsed.name and parsed.kind in _OWN:
        found = {parsed.kind: [_own(parsed.name, parsed.kind)]}
    else:
        found = {parsed.kind: _called(parsed.name, parsed.kind, list(catalogue.KINDS[parsed.kind]()))}
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


def _own(name: str, kind: str) -> Entry:
    module = name.partition(":")[0]
    folder = modules.holder(module, [files.working_directory()])
    algorithm = registry.loaded(_OWN[kind], kind, name, folder)
    return Entry(name, first_line(algorithm), tuple(parameters_of(algorithm)), module.partition(".")[0])


def _print_kinds(found: dict[str, list[Entry]]) -> None:
    table = _table()
    for kind, entries in found.items():
        table.add_row(f"affinet list {kind}", plain(", ".join(entry.name for entry in entries)))
    Console().print(table)


def _print_entries(entries: Sequence[Entry]) -> None:
    console = Console()
    for entry in entries:
        brought = "" if entry.package == "affinet" or ":" in entry.name else f" ({entry.package})"
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
