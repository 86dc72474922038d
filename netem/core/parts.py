"""Files that grow for as long as a run flies, in parts of bounded size: run.rrd, run-2.rrd, run-3.rrd ..."""

from __future__ import annotations

import itertools
from pathlib import Path


def part(path: Path, number: int) -> Path:
    """A part of a file, the first of which has its own name."""
    return path if number == 1 else path.with_stem(f"{path.stem}-{number}")


def parts(path: Path) -> list[Path]:
    """All parts there are of a file, in order."""
    return list(itertools.takewhile(Path.exists, (part(path, number) for number in itertools.count(1))))
