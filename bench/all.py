"""All that is measured of affinet's speed, against its peers, in one table.

    python bench/all.py [--only runs tick7 tick10 growth] [--rounds 5] [--share 1.0] [--keep] [--history FILE]

Every ratio is affinet's cost by that of the peer: below 1 affinet is the cheaper. Peers and affinet take turns, round by
round, and a ratio is the median of those of the rounds, with an interval of it. A ratio whose interval goes 20 % beyond it, or
of fewer than five rounds, is noisy: that is said, and it is neither kept nor compared. Ends with status 1 where a ratio is 20 %
worse than the last that was kept on such a machine, beyond the intervals of both. docs/bench.md says how to read it.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

from speed import growth, history, lockstep, monte_carlo
from speed.history import Entry
from speed.measured import Measured, worse
from speed.rows import Row

PARTS: Mapping[str, Callable[[int, float], Iterable[Row]]] = {
    "runs": monte_carlo.measure,
    "tick7": partial(lockstep.measure, "corridor"),
    "tick10": partial(lockstep.measure, "hexa"),
    "growth": growth.measure,
}


def main() -> None:
    """Measure, print the table, compare, and keep."""
    options = _options()
    earlier = history.read(options.history)
    load = os.getloadavg()[0]
    print("| what | affinet | against | ratio, or exponent (interval) | rounds |\n|---|---|---|---|---|")
    rows = []
    for part in options.only:
        for row in PARTS[part](options.rounds, options.share):
            rows.append(row)
            print(row, flush=True)
    entry = Entry(
        day=history.today(),
        machine=history.machine(),
        load=(load, os.getloadavg()[0]),
        share=options.share,
        versions=history.versions(),
        ratios=_found(rows, "ratio"),
        exponents=_found(rows, "exponent"),
    )
    print(f"\n{entry.machine}; load {entry.load[0]:.1f} before, {entry.load[1]:.1f} after; {_listed(entry.versions)}")
    if noisy := [row.name for row in rows if row.measured is not None and not row.is_steady]:
        print(f"{len(noisy)} of {len(rows)} rows are noisy on this machine now, and neither kept nor compared")
    fallen = _compared(history.last(earlier, entry), entry.ratios)
    if options.keep and (entry.ratios or entry.exponents):
        history.keep(options.history, entry)
    sys.exit(1 if fallen else 0)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), help="some parts")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--share", type=float, default=1.0, help="of the ticks; compared with runs of the same share")
    parser.add_argument("--keep", action="store_true", help="add what is not noisy to the history")
    parser.add_argument("--history", type=Path, default=history.FILE, metavar="FILE")
    return parser.parse_args()


def _found(rows: Sequence[Row], kind: str) -> dict[str, Measured]:
    return {row.name: row.measured for row in rows if row.kind == kind and row.measured and row.is_steady}


def _listed(versions: Mapping[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def _compared(before: Mapping[str, Measured], now: Mapping[str, Measured]) -> list[str]:
    """Say what has become worse."""
    if not before:
        print("nothing was kept on such a machine to compare with: --keep keeps this run")
    fallen = worse(before, now)
    for name in fallen:
        print(f"worse: {name}: {now[name]}, was {before[name]}")
    return fallen


if __name__ == "__main__":
    main()
