"""`affinet report`: a run, or a study, as a page that needs nothing beside it."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.scenario.words import one_line
from affinet.verdicts import reading
from netem.processes.system_errors import about

_NAME = "report.html"


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command `report`."""
    report = commands.add_parser("report", help="a page of a run or a study, in one file for any browser")
    report.add_argument("directory", type=Path, metavar="RUN|STUDY", help="the directory that it left")
    report.add_argument("--out", type=Path, metavar="FILE", help=f"default: {_NAME} in the directory")


def report(parsed: argparse.Namespace) -> None:
    """Write the page, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When the directory holds no run and no study.
    OSError
        When the page cannot be written.
    """
    out = parsed.out or parsed.directory / _NAME
    page = _page(parsed.directory)
    with about(out):
        out.write_text(page, encoding="utf-8")
    print(one_line(str(out)))  # noqa: T201


def _page(directory: Path) -> str:
    from affinet.studies import page as of_study
    from affinet.verdicts.page import of_run

    if of_study.is_one(directory):
        return of_study.page(directory)
    return of_run.page(reading.evidence(directory), directory)
