"""What was requested of the air against what it did: in process, composed, over processes, in real time.

    python bench/accuracy.py [--verdicts 1000000] [--seed 1] [--only loss,delay,place,independence,composed,processes,real]
        [--keep docs/accuracy.json]

Prints a table of what was requested and what was achieved, of so many verdicts at least of each model. A mean or a share must
have what was requested in its interval, of 99.73 %; a distribution must have p > 0.001; what leaves no room for chance must be
exact. The exit status is 1 when a row is not ok. Of so many rows chance alone turns one down for about every third seed (the
last line says what to expect): look at it again with other seeds and more verdicts before you blame the model. `--keep` writes
the tables down, and where the page beside that file has their marks.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import composed
import independent
import late
import lossy
import placed
from against import Row
from carried import processes, real

_Check = Callable[[int, int], Iterator[Row]]
_CHECKS: dict[str, _Check] = {
    "loss": lossy.check,
    "delay": late.check,
    "place": placed.check,
    "independence": independent.check,
    "composed": composed.check,
    "processes": processes.check,
    "real": real.check,
}
# The tables of the page, and whose rows are in them.
TABLES = {
    "models": ("loss", "delay", "place", "independence"),
    "composed": ("composed",),
    "processes": ("processes",),
    "real": ("real",),
}
_HEAD = (
    "| model | parameters | what | requested | achieved | interval | z or p | found from | file | |",
    "|---|---|---|---|---|---|---|---|---|---|",
)
_CHECKS_AT_MOST, _SEEDS_APART = 10, 10_000
_LEAST = 10_000  # verdicts, below which intervals say nothing


def main() -> int:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--verdicts", type=int, default=1_000_000, help="of every model, at least")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda names: names.split(","), default=list(_CHECKS), metavar="loss,delay,...")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="where the tables are kept, beside their page")
    given = parser.parse_args()
    if given.verdicts < _LEAST:
        parser.error(f"--verdicts {given.verdicts}: give {_LEAST} or more, of which something can be told")
    if not 0 <= given.seed < 1 << 32:
        parser.error(f"--seed {given.seed}: give a whole number from 0 to 2^32 - 1")
    if unknown := {*given.only} - {*_CHECKS}:
        parser.error(f"--only: no {', '.join(sorted(unknown))}; there is {', '.join(_CHECKS)}")
    ok = True
    for name, checks in TABLES.items():
        if wanted := [check for check in checks if check in given.only]:
            table = _measured(wanted, given.verdicts, given.seed)
            ok &= all(row["ok"] for row in table["rows"])
            if given.keep and wanted == [*checks]:
                keep(given.keep, name, table)
    return 0 if ok else 1


def _measured(checks: Sequence[str], verdicts: int, seed: int) -> dict[str, Any]:
    """A table, printed as it comes."""
    began, rows = time.perf_counter(), []
    print(*_HEAD, sep="\n")
    for name in checks:
        place = seed * _CHECKS_AT_MOST + [*_CHECKS].index(name)
        for row in _CHECKS[name](verdicts, place * _SEEDS_APART):
            rows.append(replace(row, file=row.file or f"bench/{_CHECKS[name].__module__}.py"))
            print(rows[-1], flush=True)
    seconds = round(time.perf_counter() - began)
    table = {"verdicts": verdicts, "seed": seed, "seconds": seconds, "rows": [*map(asdict, rows)]}
    print("", _in_all(table), "", sep="\n")
    return table


def _in_all(table: Mapping[str, Any]) -> str:
    rows = [Row(**row) for row in table["rows"]]
    failed, chance = sum(not row.ok for row in rows), sum(row.chance for row in rows)
    said = f"{len(rows)} rows, {failed} not ok where chance alone makes {chance:.2f}"
    return f"{said}; {table['verdicts']:,} verdicts, seed {table['seed']}, {table['seconds']} s"


def keep(file: Path, name: str, table: Mapping[str, Any]) -> None:
    """Write a table down beside those that are in a file, and all of them on the page beside it."""
    tables = (json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}) | {name: table}
    file.write_text(json.dumps(tables, indent=1) + "\n", encoding="utf-8")
    page = file.with_suffix(".md")
    page.write_text(laid(page.read_text(encoding="utf-8"), tables), encoding="utf-8")


def laid(page: str, tables: Mapping[str, Any]) -> str:
    """A page with these tables where it has their marks.

    Raises
    ------
    ValueError
        When it has none.
    """
    for name, table in tables.items():
        begins, ends = f"<!-- {name}: written by bench/accuracy.py -->", f"<!-- end of {name} -->"
        if begins not in page or ends not in page:
            raise ValueError(f"the page has no place for its table: write {begins} and {ends} where it is to be")
        rows = (str(Row(**row)) for row in table["rows"])
        block = "\n".join([begins, "", *_HEAD, *rows, "", _in_all(table), "", ends])
        before, _, rest = page.partition(begins)
        page = before + block + rest.partition(ends)[2]
    return page


if __name__ == "__main__":
    sys.exit(main())
