"""Names for run directories that are told together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path


def apart(directories: Sequence[Path]) -> list[str]:
    """The last part of each path; with a number where that is the same."""
    names = [directory.absolute().name for directory in directories]
    counts, seen = Counter(names), Counter[str]()
    shown = []
    for name in names:
        seen[name] += 1
        shown.append(name if counts[name] == 1 else f"{name} ({seen[name]})")
    return shown
