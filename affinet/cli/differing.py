"""`affinet diff`: where a run that fails parts from one that passes, and what the air did before."""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from affinet.cli import moments
from affinet.cli.notes import note
from affinet.planning import making
from affinet.runtimes.rehearsing import rehearse
from affinet.scenario import files
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import parted, reading
from affinet.verdicts.evidence import Evidence


def diff(parsed: argparse.Namespace) -> None:
    """Hold a run against another, which is read, or flown with another seed.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged
        When there is no such run, or none to hold it against.
    """
    if (parsed.other is None) == (parsed.seed is None):
        raise ScenarioError("affinet diff: give the directory of a run that passes, or --seed to fly one")
    failing = reading.evidence(parsed.run)
    passing = reading.evidence(parsed.other) if parsed.seed is None else _flown(parsed)
    last = float(min(failing.seconds[-1], passing.seconds[-1]))
    at = None if parsed.at is None else failing.tick(moments.within("--at", parsed.at, last))
    _warn(failing, passing)
    try:
        found = parted.parted(failing, passing, at)
    except parted.NotAlike as error:
        raise ScenarioError(str(error)) from error
    if parsed.json:
        print(json.dumps(None if found is None else asdict(found)))  # noqa: T201
        return
    lines = ["no agent is farther off in it than in the other run"] if found is None else found.lines()
    print("\n".join(lines))  # noqa: T201


def _warn(failing: Evidence, passing: Evidence) -> None:
    """What would be misread; by its own verdict alone a run that a test failed may pass."""
    verdict, reasons = passing.outcome.verdict, "; ".join(passing.outcome.reasons)
    if verdict == "fail":
        note(f"note: the other run fails too: {reasons}")
    if failing.ticks > passing.ticks:
        note(f"note: the other run has {passing.ticks} ticks: nothing is said of what came after them")


def _flown(parsed: argparse.Namespace) -> Evidence:
    changes = (f"seed={parsed.seed}",)
    return rehearse(making.again(parsed.run, changes, verdicts=False, folder=files.working_directory()))
