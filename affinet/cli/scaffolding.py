"""`affinet new`: something small that works, to begin with."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.runtimes import directories
from affinet.scaffold import making
from affinet.scenario import files


def write(parsed: argparse.Namespace) -> None:
    """Write it, and say what one does next.

    Raises
    ------
    ScenarioError
        When it cannot be called so.
    OSError
        When something of it is there already, or cannot be written.
    """
    folder = files.working_directory()
    made, then = making.make(parsed.kind, parsed.name, folder)
    for path in made:
        print(directories.on_a_command_line(Path(path).relative_to(folder)))  # noqa: T201
    print("\nthen:\n" + "\n".join(f"  {line}" for line in then))  # noqa: T201
