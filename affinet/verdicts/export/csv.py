"""CSV: a table in each file, units in its heading, and every number as it is read back bit for bit."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from affinet.verdicts.evidence import Evidence
from affinet.verdicts.export import derived, folder, tables
from affinet.verdicts.export.tables import Column


def write(run: Evidence, out: Path) -> None:
    """Write the tables of a run into a folder, new, some ticks at a time.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    with folder.new(out), ExitStack() as files:
        sinks = {
            name: csv.writer(files.enter_context((out / f"{name}.csv").open("w", encoding="utf-8", newline="")))
            for name in tables.NAMES
        }
        first = 0
        for span in derived.by_parts(run):
            for name, table in tables.of_span(run, span, first).items():
                if not first:
                    sinks[name].writerow(heading(of, column) for of, column in table.items())
                sinks[name].writerows(zip(*map(_cells, table.values()), strict=True))
            first += len(span["error"])


def heading(name: str, column: Column) -> str:
    """The name of a column, and its unit where it has one: `position_x [m]`."""
    return name if column.unit in ("", "1") else f"{name} [{column.unit}]"


def _cells(column: Column) -> Iterator[Any]:
    """As text: the shortest that is read back as the same number, words for codes, and nothing where there is nothing."""
    for value, is_there in zip(column.values.tolist(), column.is_there.tolist(), strict=True):
        if not is_there:
            yield ""
        elif column.words:
            yield column.words[value]
        else:
            yield int(value) if isinstance(value, bool) else repr(value)
