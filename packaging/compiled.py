"""Compile all kernels beforehand, in the plane and in space: `python packaging/compiled.py`."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

HOUSE = Path(__file__).parents[1]
ROOMS = ("analysis", "netem", "agents", "world")
_IMPORTED = re.compile(r"^from analysis\.kernels\.kernel import .*\bkernel\b", re.MULTILINE)

sys.path.insert(0, str(HOUSE))  # a checkout is compiled before anything is installed from it

from analysis.kernels.kept import folder  # noqa: E402
from analysis.kernels.kernel import Kernel  # noqa: E402


def kernels() -> Iterator[Kernel]:
    """Every kernel of the house."""
    for room in ROOMS:
        for file in sorted((HOUSE / room).rglob("*.py")):
            if _IMPORTED.search(file.read_text(encoding="utf-8")):
                module = import_module(".".join(file.relative_to(HOUSE).with_suffix("").parts))
                yield from (held for held in vars(module).values() if isinstance(held, Kernel))


def sizes(kernel: Kernel, dimension: int) -> tuple[int, ...]:
    """What a kernel is compiled for in so many dimensions.

    Filters of up to two derivatives have the most states; a message under way has so many fields, and as it arrives so many.
    """
    known = {"A": 4, "F": 6, "D": dimension, "M": dimension, "O": 3, "R": 3, "S": 3 * dimension}
    return tuple(known[name] for name in kernel.sizes)


def main() -> int:
    """Compile what is not compiled yet."""
    before = set(folder().glob("*.o"))
    for kernel in kernels():
        for dimension in (2, 3):
            kernel.prepare(sizes(kernel, dimension))
    made = len(set(folder().glob("*.o")) - before)
    sys.stdout.write(f"{made} kernels compiled, kept in {folder()}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
