"""`affinet replay` and `check-determinism`: the same again, compared bit by bit."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from affinet.cli import show
from affinet.cli.flying import fly_plan
from affinet.cli.given import overrides, scenario
from affinet.cli.notes import note
from affinet.cli.status import FAIL, PASS, USER_CODE
from affinet.planning import making as planning
from affinet.runtimes.run import Runtime, fly
from affinet.scenario import files, loading
from affinet.scenario.wrong import ScenarioError
from affinet.verdicts import compare
from netem.medium.journal import JournalError
from world.books import history


def replay(parsed: argparse.Namespace) -> int:
    """Fly a run again, and compare every bit where it was to be the same.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, Damaged, OSError
        When there is no such run, or it cannot fly any more.
    """
    changes = overrides(parsed)
    plan = planning.again(parsed.directory, changes, verdicts=parsed.verdicts, folder=files.working_directory())
    flown = parsed.directory / history.ARRAYS
    by_the_clock = "real" in (plan.scenario.time.mode, loading.resolved(parsed.directory).time.mode)
    before = history.load(flown) if flown.exists() and (by_the_clock or not changes) else None
    for finding in plan.findings:
        if finding.check == "inputs":
            note(f"note: {finding.says}")
    try:
        status = fly_plan(plan, "replay", parsed)
    except JournalError as error:
        raise ScenarioError(f"{parsed.directory}: {error}") from error
    again = parsed.out / history.ARRAYS
    if by_the_clock and before is not None and again.exists():  # what comes of a clock comes once
        print(compare.distance(before, history.load(again)), file=sys.stderr)  # noqa: T201
        return status
    if changes:
        return status  # it was to be another run
    if before is None or not again.exists():
        gone = flown if before is None else again
        print(f"{gone}: not there, so no bit was compared; repeat the run with `affinet run`", file=sys.stderr)  # noqa: T201
        return status or FAIL
    links, channels = plan.world.links, plan.channels
    difference = compare.first_difference(before, history.load(again), links, channels)
    print(difference or f"the same bits as {parsed.directory}", file=sys.stderr)  # noqa: T201
    return status if difference is None else FAIL


def check_determinism(parsed: argparse.Namespace) -> int:
    """Fly a scenario three times, and compare every bit.

    Raises
    ------
    ScenarioError, PlanError, UserCodeError, OSError
        When it cannot fly.
    """
    plan = planning.make(scenario(parsed))
    runs: list[Runtime] = ["inprocess", "inprocess", "processes"]
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        flown = []
        for number, runtime in enumerate(runs):
            with show.Progress(plan, runtime, Path(folder) / str(number)) as watch:
                done = fly(plan, runtime, Path(folder) / str(number), watch.see)
            if done.digest is None or done.user_code:
                print(f"{runtime}: {'; '.join(done.reasons)}", file=sys.stderr)  # noqa: T201
                return USER_CODE if done.user_code else FAIL
            flown.append(history.load(Path(folder) / str(number) / history.ARRAYS))
    for runtime, arrays in zip(runs[1:], flown[1:], strict=True):
        if difference := compare.first_difference(flown[0], arrays, plan.world.links, plan.channels):
            print(f"inprocess, then {runtime}: {difference}")  # noqa: T201
            return FAIL
    print(f"twice in process and once over processes: {len(flown[0]['error'])} ticks, the same bits")  # noqa: T201
    return PASS
