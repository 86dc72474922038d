"""`affinet check`: whether a scenario can fly."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence

from affinet.cli import show
from affinet.cli.given import scenario
from affinet.cli.status import BAD_INPUT, PASS
from affinet.planning import making as planning
from affinet.planning.plan import PlanError
from affinet.scenario.words import one_line
from analysis.models.finding import Finding


def check(parsed: argparse.Namespace) -> int:
    """Say what was checked.

    Raises
    ------
    ScenarioError, UserCodeError
        When there is no such scenario, or something in it is wrong.
    """
    try:
        findings: Sequence[Finding] = planning.make(scenario(parsed)).findings
    except PlanError as error:
        findings = error.findings
        print(one_line(f"{parsed.scenario}: cannot fly: {error}"), file=sys.stderr)  # noqa: T201
    flies = not any(finding.fatal for finding in findings)
    if parsed.json:
        report = [{"check": f.check, "level": f.level, "says": f.says} for f in findings]
        print(json.dumps({"flies": flies, "findings": report}))  # noqa: T201
    else:
        show.findings(f"{parsed.scenario}: {'can fly' if flies else 'cannot fly'}", findings)
    return PASS if flies else BAD_INPUT
