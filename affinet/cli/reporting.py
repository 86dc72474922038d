"""`affinet report`: a run, or a study, as a page that needs nothing beside it."""

from __future__ import annotations

import argparse
from pathlib import Path

from affinet.cli.options.flown import PAGE
from affinet.runtimes import directories
from affinet.scenario.words import one_line
from affinet.studies import page as of_study
from affinet.verdicts import reading
from affinet.verdicts.page import of_run
from netem.processes.system_errors import about


def report(parsed: argparse.Namespace) -> None:
    """Write the page, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When the directory holds no run and no study.
    OSError
        When the page cannot be written.
    """
    out = parsed.out or parsed.directory / PAGE
    directories.refuse_there(out)
    page = _page(parsed.directory)
    with about(out):
        out.write_text(page, encoding="utf-8")
    print(one_line(str(out)))  # noqa: T201


def _page(directory: Path) -> str:
    if of_study.is_one(directory):
        return of_study.page(directory)
    return of_run.page(reading.evidence(directory), directory)
