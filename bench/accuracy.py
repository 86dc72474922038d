"""Every model of the medium against its closed form: at least a million verdicts each, through `netem.medium.medium.Medium`.

    python bench/accuracy.py [--verdicts 1000000] [--seed 1] [--only loss,delay,place,independence]

Prints a table of what was requested and what was achieved. A mean or a share must lie within three standard deviations, a
distribution must have p > 0.001; what leaves no room for chance must be exact. The exit status is 1 when a row is not ok.
Of so many rows chance alone turns one down for about every third seed (the last line says what to expect): look at it again
with other seeds and more verdicts before you blame the model.
"""

from __future__ import annotations

import argparse
import sys
import time

import composed
import independent
import late
import lossy
import placed
from carried import processes

_CHECKS = {
    "loss": lossy.check,
    "delay": late.check,
    "place": placed.check,
    "independence": independent.check,
    "composed": composed.check,
    "processes": processes.check,
}
_SEEDS_APART = 10_000


def main() -> int:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--verdicts", type=int, default=1_000_000, help="of every model, at least")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=lambda names: names.split(","), default=list(_CHECKS), metavar="loss,delay,...")
    options = parser.parse_args()
    began, rows = time.perf_counter(), []
    print("| model | parameters | what | requested (closed form) | achieved | z or p | |")
    print("|---|---|---|---|---|---|---|")
    for number, (name, check) in enumerate(_CHECKS.items()):
        if name in options.only:
            for row in check(options.verdicts, (options.seed * len(_CHECKS) + number) * _SEEDS_APART):
                rows.append(row)
                print(row, flush=True)
    failed = sum(not row.ok for row in rows)
    chance = sum(row.chance for row in rows)
    print(f"\n{len(rows)} rows, {failed} not ok where chance alone makes {chance:.2f}; ", end="")
    print(f"seed {options.seed}, {time.perf_counter() - began:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
