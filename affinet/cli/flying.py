"""`affinet run`, and `world` and `hosts` over several machines: a scenario is flown, and what came of it is said."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path

from affinet.cli import machines, show, watching
from affinet.cli.given import scenario
from affinet.cli.status import FAIL, PASS, USER_CODE
from affinet.planning import making as planning
from affinet.planning.plan import Plan
from affinet.planning.programs import refuse_in_process
from affinet.runtimes import directories
from affinet.runtimes.machines import hosts as hosts_file
from affinet.runtimes.machines.spread import Spread
from affinet.runtimes.run import Runtime, fly
from affinet.verdicts.outcome import Outcome, claim, refuse_taken


def run(parsed: argparse.Namespace) -> int:
    """Fly a scenario here, once or many times.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, NotTrusted, OSError
        When it cannot fly, or has no place.
    """
    if parsed.seeds is not None or parsed.sweep or parsed.check is not None:
        from affinet.cli import many_runs  # studies take a while to import

        return PASS if many_runs.fly(parsed, lambda more: scenario(parsed, more)) else FAIL
    plan = planning.make(scenario(parsed))
    return fly_plan(plan, Path(parsed.scenario).stem, parsed)


def world(parsed: argparse.Namespace) -> int:
    """Fly a scenario over several machines, whose commands are typed there.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, NotTrusted, OSError
        When it cannot fly, or has no place.
    """
    plan = planning.make(scenario(parsed))
    return fly_plan(plan, Path(parsed.scenario).stem, parsed, machines.typed(plan, parsed))


def hosts(parsed: argparse.Namespace) -> int:
    """Fly a scenario over several machines, whose commands are started from here.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, NotTrusted, OSError
        When it cannot fly, or has no place.
    """
    read = hosts_file.load(parsed.file)
    folder = parsed.file.absolute().parent
    parsed.scenario = parsed.scenario or read.scenario_from(folder)
    plan = planning.make(scenario(parsed))
    return fly_plan(plan, Path(parsed.scenario).stem, parsed, machines.started(plan, read, folder))


def fly_plan(plan: Plan, name: str, parsed: argparse.Namespace, spread: Callable[[Path], Spread] | None = None) -> int:
    """Fly a plan, and say what came of it; its exit status.

    Parameters
    ----------
    plan, name
        What flies, and what it is called.
    parsed
        How, by the command line.
    spread
        Makes the other machines of a run that some of them fly, for its directory.

    Raises
    ------
    PlanError, UserCodeError, OSError
        When it cannot fly so, or has no place.
    """
    runtime: Runtime = parsed.runtime or "processes"
    if runtime == "inprocess":
        refuse_in_process(plan)
    if parsed.out:
        refuse_taken(parsed.out)
    with watching.live(parsed) as viewer:
        parsed.out = parsed.out or directories.for_run(name)
        claim(parsed.out)
        with show.Progress(plan, name, parsed.out) as watch:
            elsewhere = None if spread is None else spread(parsed.out)
            outcome = fly(plan, runtime, parsed.out, watch.see, viewer, elsewhere)
        if parsed.json:
            print(json.dumps(outcome.to_json(), allow_nan=False), flush=True)  # noqa: T201
        else:
            show.outcome(outcome, plan)
    return _status(outcome)


def _status(outcome: Outcome) -> int:
    if outcome.user_code:
        print(f"traceback: in {Path(outcome.out) / 'logs'}", file=sys.stderr)  # noqa: T201
        return USER_CODE
    return PASS if outcome.verdict == "pass" else FAIL
