"""Means with their confidence intervals, a row each, as a table that folds where the terminal is narrow."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from affinet.cli.show import plain
from affinet.scenario.words import one_line
from affinet.studies import record
from affinet.studies.batch import REPORT
from affinet.studies.quantities import Quantity, said
from affinet.studies.record import StudyRecord

_SIGNED = {"fall"}  # quantities that may be negative
_MOST_ROWS = 24  # of a study, which has them all in a file
_WITHOUT_END = 10_000  # characters


class Row(NamedTuple):
    """A mean, with the settings it is of.

    Parameters
    ----------
    labels
        The settings, by what is varied.
    found, low, high
        The mean and its interval; None is none.
    verdicts
        What its runs came to.
    """

    labels: Mapping[str, str]
    found: float | None
    low: float | None
    high: float | None
    verdicts: str = ""


def show(console: Console, rows: Sequence[Row], unit: str, *, intervals: bool) -> None:
    """Print them: where it is too wide what is varied has its name on several lines, and then the table no rules."""
    wide = console.options.update_width(_WITHOUT_END)
    for parted, rules in (("", True), ("\n", True), ("\n", False)):
        table = _table(rows, unit, intervals=intervals, parted=parted, rules=rules)
        if console.measure(table, options=wide).maximum <= console.width:
            break
    console.print(table)


def warn(console: Console, quantity: Quantity, rows: Sequence[Row]) -> None:
    """Say what to think of a mean whose interval has numbers that the quantity cannot have."""
    scattered = [
        row for row in rows if row.found is not None and row.low is not None and -math.inf < row.low < 0.0 <= row.found
    ]
    if scattered and quantity not in _SIGNED and not quantity.startswith(REPORT):
        says = "an interval reaches below 0: a few runs make the mean; fly more, or take the median (docs/studies.md)"
        console.print(plain(says), soft_wrap=True)


def of_study(judged: StudyRecord, out: Path) -> None:
    """Print what the cases of a study came to in what it draws, and say where the others are."""
    cases = [case for case in judged.cases if case.quantity == judged.cases[0].quantity]
    others = dict.fromkeys(said(case.quantity)[0] for case in judged.cases if case.quantity != cases[0].quantity)
    rows = [Row(case.labels, case.found, case.low, case.high) for case in cases[:_MOST_ROWS]]
    console = Console()
    says = f"{said(cases[0].quantity)[0]}, mean over {judged.runs} runs of each case"
    console.print(plain(f"{says}; {100 * judged.confidence:g} % interval by Student's t"), soft_wrap=True)
    show(console, rows, cases[0].unit, intervals=judged.runs > 1)
    warn(console, cases[0].quantity, rows)
    beyond = [f"{len(cases) - len(rows)} cases more"] if len(cases) > len(rows) else []
    if beyond or others:
        console.print(plain(one_line(f"{out / record.FILE} has {', '.join([*beyond, *others])}")), soft_wrap=True)


def _table(rows: Sequence[Row], unit: str, *, intervals: bool, parted: str, rules: bool) -> Table:
    table = Table() if rules else Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    for name in rows[0].labels:
        table.add_column(plain(name.replace(".", f".{parted}")), overflow="fold")
    verdicts = any(row.verdicts for row in rows)
    for heading in (f"mean ({unit})" if unit else "mean", *(["interval"] * intervals)):
        table.add_column(heading, no_wrap=True)
    if verdicts:
        table.add_column("verdicts")
    for row in rows:
        between = [f"{_figure(row.low)} to {_figure(row.high)}"] if intervals else []
        cells = (*row.labels.values(), _figure(row.found), *between, *([row.verdicts] if verdicts else []))
        table.add_row(*map(plain, cells))
    return table


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
