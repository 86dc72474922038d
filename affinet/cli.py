"""The `affinet` command.

Exit status: 0 pass, 1 fail or vacuous, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from affinet import plan as planning
from affinet import scenario
from affinet.checks import Finding
from affinet.outcome import Outcome
from affinet.plan import Plan, PlanError
from affinet.rerun_command import NoViewer, open_viewer
from affinet.run import fly
from affinet.sections import ScenarioError

PASS, FAIL, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130

_LEVELS = {"ok": "[green]ok[/]", "note": "[yellow]note[/]", "error": "[red]error[/]"}
_VERDICTS = {"pass": "[green]pass[/]", "fail": "[red]fail[/]", "vacuous": "[yellow]vacuous[/]"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    sys.path.append(os.getcwd())  # so that "module:Class" finds what lies beside the scenario
    parsed = _parser().parse_args(arguments)
    try:
        status: int = parsed.command(parsed)
    except (ScenarioError, PlanError, NoViewer, FileExistsError) as error:
        print(error, file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="affinet", description="Fly a swarm of agents through a network that loses, delays and cuts."
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    run = commands.add_parser("run", help="fly a scenario", description="Fly a scenario and leave a run directory.")
    check = commands.add_parser("check", help="say whether a scenario can fly, before anything starts")
    for command in (run, check):
        command.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(scenario.shipped())}")
        command.add_argument(
            "--set",
            action="append",
            default=[],
            metavar="KEY=VALUE",
            help="override any key, like time.dt=0.02",
        )
        command.add_argument("--estimator", metavar="NAME", help="agents.estimator")
        command.add_argument(
            "--availability",
            metavar="P",
            help="network.availability, the probability that a message gets through",
        )
        command.add_argument("--seed", metavar="N", help="seed")
        command.add_argument("--duration", metavar="S", help="time.duration, in simulated seconds")
        command.add_argument("--json", action="store_true", help="print one JSON object as the last line")
    run.add_argument("--runtime", choices=["processes", "inprocess"], default="processes", help="default: %(default)s")
    run.add_argument("--out", type=Path, metavar="DIR", help="run directory (default: runs/SCENARIO-TIME)")
    run.add_argument("--view", action="store_true", help="watch in a Rerun viewer while it flies")
    run.set_defaults(command=_run)
    check.set_defaults(command=_check)
    return parser


def _plan(parsed: argparse.Namespace) -> Plan:
    options = {
        "agents.estimator": parsed.estimator,
        "network.availability": parsed.availability,
        "seed": parsed.seed,
        "time.duration": parsed.duration,
    }
    overrides = [*parsed.set, *(f"{key}={value}" for key, value in options.items() if value is not None)]
    return planning.make(scenario.load(parsed.scenario, overrides))


def _check(parsed: argparse.Namespace) -> int:
    try:
        findings: Sequence[Finding] = _plan(parsed).findings
    except PlanError as error:
        findings = error.findings
    flies = not any(finding.fatal for finding in findings)
    if parsed.json:
        report = [{"check": f.check, "level": f.level, "says": f.says} for f in findings]
        print(json.dumps({"flies": flies, "findings": report}))  # noqa: T201
    else:
        table = Table("check", "", "says", title=f"{parsed.scenario}: {'can fly' if flies else 'cannot fly'}")
        for finding in findings:
            table.add_row(finding.check, _LEVELS[finding.level], finding.says)
        Console().print(table)
    return PASS if flies else BAD_INPUT


def _run(parsed: argparse.Namespace) -> int:
    plan = _plan(parsed)
    name = Path(parsed.scenario).stem
    out = parsed.out or Path("runs") / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    viewer = open_viewer() if parsed.view else None
    with _Progress(plan, name) as watch:
        outcome = fly(plan, parsed.runtime, out, watch.see, viewer)
    if parsed.json:
        print(json.dumps(outcome.to_json(), allow_nan=False))  # noqa: T201
    else:
        _show(outcome, plan)
    return PASS if outcome.verdict == "pass" else FAIL


class _Progress:
    """A progress bar with the real-time factor, on standard error."""

    def __init__(self, plan: Plan, name: str) -> None:
        self._dt = plan.world.dt
        self._first: tuple[int, float] | None = None
        self._bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.fields[says]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._task = self._bar.add_task(name, total=plan.world.ticks, says="starting")

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def see(self, tick: int, error: float) -> None:
        now = time.perf_counter()
        self._first = self._first or (tick, now)
        elapsed = now - self._first[1]
        factor = f"{(tick - self._first[0]) * self._dt / elapsed:4.1f} x real time" if elapsed > 0.0 else ""
        self._bar.update(self._task, completed=tick, says=f"{tick * self._dt:6.2f} s  error {error:.4f} m²  {factor}")


def _show(outcome: Outcome, plan: Plan) -> None:
    table = Table(show_header=False, title=f"{_VERDICTS[outcome.verdict]}")
    error, messages = outcome.tracking_error, outcome.messages
    rows = [
        ("flown", f"{outcome.ticks} ticks, {outcome.ticks * plan.world.dt:g} s in {outcome.wall_s:.1f} s"),
        ("speed", f"{outcome.ticks_per_s:.0f} ticks/s, {outcome.real_time_factor:.2f} x real time"),
        ("tracking error", "  ".join(f"{name} {_figure(value)} m²" for name, value in error.items())),
        (
            "messages",
            f"{messages['offered']} offered, {messages['delivered']} delivered, {messages['in_flight']} in flight",
        ),
        (
            "dropped",
            ", ".join(f"{reason} {number}" for reason, number in messages["dropped"].items()) or "none",
        ),
        ("lost by nobody's order", f"{messages['uninstructed']}"),
        *(
            ("fault", f"{fault['at']:g} s: {fault['fault']} held {fault['messages']} messages")
            for fault in outcome.faults
        ),
        ("digest", str(outcome.digest)),
        ("directory", outcome.out),
    ]
    for name, value in rows:
        table.add_row(name, value)
    console = Console()
    console.print(table)
    for reason in outcome.reasons:
        console.print(reason, markup=False, highlight=False)


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"


if __name__ == "__main__":
    sys.exit(main())
