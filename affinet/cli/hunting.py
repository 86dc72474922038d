"""`affinet hunt`: what a person sees of it, and the scenario that it leaves."""

from __future__ import annotations

import argparse
import json
import operator
from dataclasses import asdict
from functools import reduce
from pathlib import Path

from affinet.cli import show
from affinet.cli.given import scenario
from affinet.cli.status import FAIL, PASS
from affinet.planning import making as planning
from affinet.runtimes import directories
from affinet.runtimes.run import evidence, fly
from affinet.scenario import files, loading
from affinet.scenario.words import among
from affinet.scenario.wrong import ScenarioError
from affinet.testing import hunt, strategies
from affinet.testing.hunt import Counterexample
from affinet.verdicts import invariants
from affinet.verdicts.checking import Checker
from netem.processes.system_errors import about


def hunt_and_report(parsed: argparse.Namespace) -> int:
    """Hunt, and say what was found; to find something is to fail.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, OSError
        When the hunt cannot begin, or its smallest fault not be written.
    """
    given = scenario(parsed)
    invariant = reduce(operator.and_, map(invariants.parse, parsed.invariant))
    verbs = parsed.verbs or list(strategies.VERBS)
    if strangers := sorted(set(verbs) - set(strategies.VERBS)):
        raise ScenarioError(f"--verbs {','.join(strangers)}: {among(strangers[0], strategies.VERBS)}")
    if parsed.out and not parsed.out.parent.is_dir():
        raise ScenarioError(f"--out {parsed.out}: there is no directory {parsed.out.parent}")
    folder = parsed.out.absolute().parent if parsed.out else files.working_directory()
    for name, lies_in in given.own_modules.items():
        if folder != lies_in:
            raise ScenarioError(f"--out {parsed.out or '.'}: {name} lies in {lies_in}: write the file there")
    file = directories.for_hunt(parsed.out or Path(parsed.scenario).stem)
    with directories.unless_empty(file), show.HuntProgress(parsed.budget) as chase:
        counterexample, coverage = hunt.hunt(
            given, invariant, budget=parsed.budget, verbs=verbs, seed=given.seed, watch=chase.see
        )
        if counterexample is not None:
            with about(file):
                file.write_text(loading.to_toml(counterexample.scenario), encoding="utf-8")
    show.hunted(counterexample, coverage)
    if counterexample is not None:
        _confirm(counterexample, invariant, file)
    if parsed.json:
        found = (
            None
            if counterexample is None
            else {"scenario": str(file), "finding": str(counterexample.finding), "digest": counterexample.digest}
        )
        print(json.dumps({"found": found, "tried": asdict(coverage)}))  # noqa: T201
    return PASS if counterexample is None else FAIL


def _confirm(counterexample: Counterexample, invariant: Checker, file: Path) -> None:
    """Fly the smallest fault over processes."""
    plan = planning.make(loading.load(str(file)))
    out = directories.for_run(file.stem)
    with show.Progress(plan, file.stem, out) as watch:
        flown = fly(plan, "processes", out, watch.see)
    same = "the same bits" if flown.digest == counterexample.digest else "OTHER BITS"
    landed = evidence(plan, flown)
    found = invariant(landed) if landed else "; ".join(flown.reasons)
    print(f"over processes, {same}: {found}\n{file}: affinet run {directories.on_a_command_line(file)}")  # noqa: T201
