"""`affinet export`: a run in the formats of others."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.scenario.sections import ScenarioError
from affinet.scenario.words import one_line
from affinet.verdicts.export.formats import FORMATS


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Take `affinet export` in."""
    says = "; ".join(f"{name}: {form.says}" for name, form in FORMATS.items())
    export = commands.add_parser(
        "export",
        help=f"a run as {', '.join(FORMATS)}",
        description=f"Write a run in a format of other tools, to a place where nothing is. {says}.",
    )
    export.add_argument("directory", type=Path, metavar="RUN", help="the run directory")
    export.add_argument("--to", choices=FORMATS, required=True, help="which format")
    export.add_argument("--out", type=Path, metavar="PATH", help="default: beside the run directory, called like it")


def write(parsed: argparse.Namespace) -> None:
    """Read the run, write it, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When there is no whole run, or the library for the format is missing.
    OSError
        When something is there already, or it cannot be written.
    """
    from affinet.verdicts import reading
    from affinet.verdicts.export import extras, formats

    run = parsed.directory.absolute()
    out = parsed.out or run.with_name(run.name + FORMATS[parsed.to].ending)
    try:
        formats.write(reading.evidence(parsed.directory), parsed.to, out)
    except extras.NotInstalled as error:
        raise ScenarioError(str(error)) from error
    print(one_line(str(out)))  # noqa: T201
