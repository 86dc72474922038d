"""What is said beside what a command prints: a line each, on standard error."""

from __future__ import annotations

import sys

from affinet.scenario.words import one_line


def note(line: str) -> None:
    """Say it."""
    print(one_line(line), file=sys.stderr)  # noqa: T201
