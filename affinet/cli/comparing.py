"""`affinet compare`: in which settings runs differ, what came of each, and where they part."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from affinet.cli.options.flown import OVERLAID
from affinet.cli.show import plain
from affinet.runtimes import directories
from affinet.scenario.names import apart
from affinet.scenario.words import one_line, shown
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import beside, measures, reading
from affinet.verdicts.beside import Row
from affinet.verdicts.evidence import Evidence
from netem.processes.system_errors import about

_DIGITS = 12  # by which a digest is known


def compare(parsed: argparse.Namespace) -> None:
    """Read the runs, and say how they differ.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When a directory holds no run, or there is one alone.
    OSError
        When the picture cannot be written.
    """
    if len(parsed.directories) < 2:
        raise ScenarioError("affinet compare: give two run directories, or more")
    if parsed.out and parsed.out.suffix not in OVERLAID:
        raise ScenarioError(f"--out {parsed.out}: give a name that ends in {', '.join(OVERLAID)}")
    if parsed.out:
        directories.refuse_there(parsed.out)
    names = apart(parsed.directories)
    runs = [reading.evidence(directory) for directory in parsed.directories]
    partings = {name: beside.parting(runs[0], run) for name, run in zip(names[1:], runs[1:], strict=True)}
    if parsed.json:
        said = {"runs": names, "settings": dict(beside.settings(runs)), "figures": dict(beside.figures(runs))}
        print(json.dumps({**said, "parts": partings}))  # noqa: T201
    else:
        _print(names, runs, partings)
    if parsed.out:
        _draw(beside.titles(runs, names), runs, parsed.out)


def _print(names: Sequence[str], runs: Sequence[Evidence], partings: dict[str, str]) -> None:
    console = Console()
    for title, rows in (
        ("settings that differ", _shown(beside.settings(runs))),
        ("figures", _written(beside.figures(runs))),
    ):
        console.print(_table(title, names, rows) if rows else f"{title}: none")
    for name, parting in partings.items():
        console.print(plain(f"{name}: {parting}"), soft_wrap=True)


def _shown(settings: Sequence[Row]) -> list[Row]:
    return [(name, tuple("-" if value is None else shown(value) for value in values)) for name, values in settings]


def _written(figures: Sequence[Row]) -> list[Row]:
    """As people read them: `--json` has all of them."""
    return [(name, tuple(_figure(name, value) for value in values)) for name, values in figures]


def _figure(name: str, value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.4g}"
    return str(value)[:_DIGITS] if name == "digest" else str(value)


def _table(title: str, names: Sequence[str], rows: Sequence[Row]) -> Table:
    table = Table("", title=title)
    for name in names:
        table.add_column(plain(name))
    for name, values in rows:
        table.add_row(plain(name), *(plain(value) for value in values))
    return table


def _draw(names: Sequence[str], runs: Sequence[Evidence], out: Path) -> None:
    from analysis.figures import overlaid  # matplotlib takes a while to import

    curves = []
    for name, run in zip(names, runs, strict=True):
        quantity, values = measures.over_time(run.plan, run.timeline, run.arrays)
        curves.append(overlaid.Curve(name, quantity, run.seconds, values))
    with about(out):
        overlaid.draw(curves, out)
    print(one_line(str(out)))  # noqa: T201
