"""`affinet conformance`: what a person sees of it, and the report."""

from __future__ import annotations

import argparse
import json
import shlex
from collections.abc import Sequence

from rich import progress as bar
from rich.console import Console
from rich.table import Table
from rich.text import Text

from affinet.cli.progress import Bar
from affinet.cli.status import FAIL, PASS
from affinet.conformance.flying import Patience
from affinet.conformance.suite import CASES, Finding, findings
from affinet.runtimes import directories
from netem.processes.system_errors import about

_STYLES = {"pass": "green", "fail": "red", "not applicable": "yellow", "not reached": "red"}


def judge_and_report(parsed: argparse.Namespace) -> int:
    """Run the suite and say what it found, which fails where something speaks against the agent.

    Raises
    ------
    ScenarioError, PlanError
        When there is no such estimator, or it cannot fly.
    OSError
        When the program cannot be started, or the report not be written.
    """
    if parsed.out:
        directories.refuse_there(parsed.out)
    found: list[Finding] = []
    with Bar("conformance", len(CASES), bar.BarColumn(), bar.TextColumn("{task.fields[says]}")) as shown:
        for finding in findings(parsed.program, parsed.estimator, Patience(answer_s=parsed.patience)):
            found.append(finding)
            shown.see(len(found), finding.case.flight.name)
    conforms = all(finding.holds for finding in found)
    _print(found)
    if parsed.out:
        report = {
            "command": shlex.join(parsed.program),
            "estimator": parsed.estimator,
            "conforms": conforms,
            "cases": [_plain(finding) for finding in found],
        }
        with about(parsed.out):
            parsed.out.write_text(json.dumps(report, indent=2) + "\n", encoding="utf-8")
    return PASS if conforms else FAIL


def _print(found: Sequence[Finding]) -> None:
    console, table = Console(), Table("case", "docs/protocol.md", "")
    for finding in found:
        verdict = Text(finding.verdict, style=_STYLES[finding.verdict])
        table.add_row(finding.case.name, finding.case.section, verdict)
    console.print(table)
    for finding in found:
        if finding.instead:
            more = f" (and {len(finding.instead) - 1} more)" if len(finding.instead) > 1 else ""
            says = f"{finding.case.name}: it has to {finding.case.demand}\n    {finding.instead[0]}{more}"
            console.print(Text(says), soft_wrap=True)
    counts = {verdict: sum(finding.verdict == verdict for finding in found) for verdict in _STYLES}
    console.print(", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count))


def _plain(finding: Finding) -> dict[str, object]:
    case = finding.case
    return {
        "case": case.name,
        "demand": case.demand,
        "section": case.section,
        "flight": case.flight.name,
        "verdict": finding.verdict,
        "instead": list(finding.instead),
    }
