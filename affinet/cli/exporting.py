"""`affinet export`: a run in the formats of others."""

from __future__ import annotations

import argparse

from affinet.scenario.words import one_line
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import reading
from affinet.verdicts.export import extras, formats


def write(parsed: argparse.Namespace) -> None:
    """Read the run, write it, and say where.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When there is no whole run, or the library for the format is missing.
    OSError
        When something is there already, or it cannot be written.
    """
    run = parsed.directory.absolute()
    out = parsed.out or run.with_name(run.name + formats.FORMATS[parsed.to].ending)
    try:
        formats.write(reading.evidence(parsed.directory), parsed.to, out)
    except extras.NotInstalled as error:
        raise ScenarioError(str(error)) from error
    print(one_line(str(out)))  # noqa: T201
