"""`affinet new`: something small that works, to begin with."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.runtimes import directories
from affinet.scenario import files

KINDS = ("scenario", "estimator", "law", "study", "test", "project")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet new` in."""
    new = commands.add_parser(
        "new",
        help="write a scenario, an estimator, a law, a study, a test or a project to begin with",
        description="Write a small, commented thing that works at once, into the working directory. Nothing is overwritten.",
    )
    new.add_argument("kind", choices=KINDS, metavar="KIND", help=f"one of: {', '.join(KINDS)}")
    new.add_argument("name", metavar="NAME", help="small letters, figures and dashes, like my-filter")


def write(parsed: argparse.Namespace) -> None:
    """Write it, and say what one does next.

    Raises
    ------
    ScenarioError
        When it cannot be called so.
    OSError
        When something of it is there already, or cannot be written.
    """
    from affinet.scaffold import making  # what there is of each kind takes a while to import

    folder = files.working_directory()
    made, then = making.make(parsed.kind, parsed.name, folder)
    for path in made:
        print(directories.on_a_command_line(Path(path).relative_to(folder)))  # noqa: T201
    print("\nthen:\n" + "\n".join(f"  {line}" for line in then))  # noqa: T201
