"""What was requested of the air against what it did: in process, composed, over processes, in real time.

    python bench/accuracy.py [--verdicts 1000000] [--seed 1] [--only loss,delay,place,independence,composed,processes,real]
        [--keep docs/accuracy.md]

Prints a table of what was requested and what was achieved, of so many verdicts at least of each model. A mean or a share must
lie within three standard deviations, a distribution must have p > 0.001; what leaves no room for chance must be exact. The exit
status is 1 when a row is not ok. Of so many rows chance alone turns one down for about every third seed (the last line says
what to expect): look at it again with other seeds and more verdicts before you blame the model. `--keep` writes each table
where the page has its mark.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

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
    "| model | parameters | what | requested | achieved | z or p | found from | |",
    "|---|---|---|---|---|---|---|---|",
)
_CHECKS_AT_MOST, _SEEDS_APART = 10, 10_000


def main() -> int:
    """Measure, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--verdicts", type=int, default=1_000_000, help="of every model, at least")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda names: names.split(","), default=list(_CHECKS), metavar="loss,delay,...")
    parser.add_argument("--keep", type=Path, metavar="PAGE")
    given = parser.parse_args()
    if unknown := {*given.only} - {*_CHECKS}:
        parser.error(f"--only: no {', '.join(sorted(unknown))}; there is {', '.join(_CHECKS)}")
    failed = 0
    for name, checks in TABLES.items():
        if wanted := [check for check in checks if check in given.only]:
            lines, wrong = _table(wanted, given.verdicts, given.seed)
            failed += wrong
            if given.keep and wanted == [*checks]:
                given.keep.write_text(kept(given.keep.read_text(), name, lines))
    return 1 if failed else 0


def _table(checks: Sequence[str], verdicts: int, seed: int) -> tuple[list[str], int]:
    """The lines of a table, printed as they come, and how many of its rows are not ok."""
    began, rows = time.perf_counter(), []
    lines = [*_HEAD]
    print(*lines, sep="\n")
    for name in checks:
        place = seed * _CHECKS_AT_MOST + [*_CHECKS].index(name)
        for row in _CHECKS[name](verdicts, place * _SEEDS_APART):
            rows.append(row)
            lines.append(str(row))
            print(row, flush=True)
    failed, chance = sum(not row.ok for row in rows), sum(row.chance for row in rows)
    said = f"{len(rows)} rows, {failed} not ok where chance alone makes {chance:.2f}; "
    lines += ["", f"{said}{verdicts} verdicts, seed {seed}, {time.perf_counter() - began:.0f} s"]
    print(*lines[-2:], "", sep="\n")
    return lines, failed


def kept(page: str, name: str, lines: Sequence[str]) -> str:
    """A page with these lines where it has the mark of a table.

    Raises
    ------
    ValueError
        When it has none.
    """
    begins, ends = f"<!-- {name}: written by bench/accuracy.py -->", f"<!-- end of {name} -->"
    if begins not in page or ends not in page:
        raise ValueError(f"the page has no place for its table: write {begins} and {ends} where it is to be")
    block = "\n".join([begins, "", *lines, "", ends])
    return re.sub(f"{re.escape(begins)}.*?{re.escape(ends)}", lambda _: block, page, flags=re.DOTALL)


if __name__ == "__main__":
    sys.exit(main())
