"""The `affinet` command.

Exit status: 0 pass, 1 fail or vacuous, 2 bad input, 3 a user's own code failed (estimator, law or module), 130 interrupted;
143 or 129 where SIGTERM or SIGHUP ended a run.
"""

from __future__ import annotations

import argparse
import errno
import json
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import asdict
from datetime import timedelta
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from affinet.cli import (
    comparing,
    completing,
    doctoring,
    exporting,
    helping,
    hunting,
    listing,
    machines,
    many_runs,
    options,
    rendering,
    reporting,
    scaffolding,
    schemas,
    show,
    terminal,
    watching,
)
from affinet.cli.given import overrides, scenario
from affinet.planning import making as planning
from affinet.planning.plan import Plan, PlanError
from affinet.planning.programs import refuse_in_process
from affinet.runtimes import directories
from affinet.runtimes.inject import Access, InjectRequest, NotFlying
from affinet.runtimes.interruption import Interrupted
from affinet.runtimes.machines import hosts
from affinet.runtimes.machines.place import Refused
from affinet.runtimes.machines.spread import Spread
from affinet.runtimes.rerun_command import NoViewer
from affinet.runtimes.run import Runtime, fly
from affinet.scenario import files, loading
from affinet.scenario.sections import ScenarioError
from affinet.scenario.words import one_line
from affinet.studies import fit
from affinet.verdicts import compare
from affinet.verdicts.outcome import claim, refuse_taken
from analysis.models.finding import Finding
from netem.processes.leaving import leave, status_of
from netem.processes.system_errors import about, said
from netem.processes.user_code import UserCodeError
from netem.wire.certificates import NotTrusted
from netem.wire.session import CENTRE, CONTROL, COORDINATOR, DRIVER, HUB, WORLD, agent_name, host_name
from world.books import history

if TYPE_CHECKING:
    from affinet.verdicts.outcome import Outcome

PASS, FAIL, BAD_INPUT, USER_CODE, INTERRUPTED = 0, 1, 2, 3, 130


def command() -> NoReturn:
    """What the shell starts: the process ends here with the command's exit status, whatever threads a module has started."""
    terminal.settle()
    status = status_of(main)
    try:
        if sys.stdout is not None:  # it was closed
            sys.stdout.flush()
    except OSError as error:
        if status != BAD_INPUT:  # else it has said already what came in between
            print(one_line(said(error)), file=sys.stderr)  # noqa: T201
        status = status or BAD_INPUT  # the answer did not get out
    leave(status)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = options.parser()
    parsed = parser.parse_args(arguments)
    if parsed.command is None:
        print(helping.guide(parser), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    try:
        status = _COMMANDS[parsed.command](parsed) or PASS
    except (ScenarioError, PlanError, NoViewer, NotFlying, NotTrusted, Refused, history.Damaged) as error:
        print(one_line(str(error)), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except UserCodeError as error:
        print(f"{error}; traceback: {_kept(error)}", file=sys.stderr)  # noqa: T201
        return USER_CODE
    except OSError as error:
        print(one_line(said(error)), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except RuntimeError as error:
        if (refused := _refused(error)) is None:
            raise
        print(one_line(refused), file=sys.stderr)  # noqa: T201
        return BAD_INPUT
    except Interrupted as error:
        print(error, file=sys.stderr)  # noqa: T201
        return error.status
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)  # noqa: T201
        return INTERRUPTED
    return status


def _kept(error: UserCodeError) -> str:
    """The file that has the traceback, as there is no run directory; or why none has it."""
    try:
        with tempfile.NamedTemporaryFile(
            "w", prefix="affinet-", suffix=".log", delete=False, encoding="utf-8", errors="backslashreplace"
        ) as log:
            traceback.print_exception(error, file=log)
    except OSError as refused:
        return f"not kept, {said(refused)}"
    return log.name


def _status(outcome: Outcome) -> int:
    if outcome.user_code:
        print(f"traceback: in {Path(outcome.out) / 'logs'}", file=sys.stderr)  # noqa: T201
        return USER_CODE
    return PASS if outcome.verdict == "pass" else FAIL


def _refused(error: RuntimeError) -> str | None:
    """In one line what the system refused, where a library says so by an error of its own."""
    if isinstance(error, BrokenExecutor):
        return f"a worker process ended: {error}; was there memory enough, and room for its threads (ulimit -v, -u)?"
    if "can't start new thread" in str(error):
        return said(OSError(errno.EAGAIN, str(error)))
    return None


def _check(parsed: argparse.Namespace) -> int:
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


def _run(parsed: argparse.Namespace) -> int:
    if many_runs.are_asked_for(parsed):
        return PASS if many_runs.fly(parsed, lambda more: scenario(parsed, more)) else FAIL
    plan = planning.make(scenario(parsed))
    return _fly(plan, Path(parsed.scenario).stem, parsed)


def _world(parsed: argparse.Namespace) -> int:
    plan = planning.make(scenario(parsed))
    return _fly(plan, Path(parsed.scenario).stem, parsed, machines.typed(plan, parsed))


def _hosts(parsed: argparse.Namespace) -> int:
    read = hosts.load(parsed.file)
    folder = parsed.file.absolute().parent
    parsed.scenario = parsed.scenario or read.scenario_from(folder)
    plan = planning.make(scenario(parsed))
    return _fly(plan, Path(parsed.scenario).stem, parsed, machines.started(plan, read, folder))


def _replay(parsed: argparse.Namespace) -> int:
    changes = overrides(parsed)
    from netem.medium.journal import JournalError  # pyarrow takes a while to import

    plan = planning.again(parsed.directory, changes, verdicts=parsed.verdicts, folder=files.working_directory())
    flown = parsed.directory / history.ARRAYS
    by_the_clock = "real" in (plan.scenario.time.mode, loading.resolved(parsed.directory).time.mode)
    before = history.load(flown) if flown.exists() and (by_the_clock or not changes) else None
    for finding in plan.findings:
        if finding.check == "inputs":
            print(one_line(f"note: {finding.says}"), file=sys.stderr)  # noqa: T201
    try:
        status = _fly(plan, "replay", parsed)
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


def _check_determinism(parsed: argparse.Namespace) -> int:
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


def _study(parsed: argparse.Namespace) -> int:
    from affinet.cli import studying  # pyarrow and matplotlib take a while to import

    return PASS if studying.fly_and_report(parsed) else FAIL


def _design(parsed: argparse.Namespace) -> int:
    from affinet.planning import designing  # its sparse matrices take a while to import

    nominal = designing.nodes(parsed.nodes, parsed.agents, parsed.dimension, parsed.seed)
    made = designing.designed(nominal, parsed.range, parsed.settle)
    file = directories.for_design(parsed.out or Path(parsed.nodes).stem)
    with directories.unless_empty(file), about(file):
        file.write_text(loading.to_toml(made.scenario), encoding="utf-8")
    show.designed(made, file)
    return PASS


def _fit(parsed: argparse.Namespace) -> int:
    model = fit.inputs(parsed.directory, parsed.order)
    print(json.dumps(asdict(model)) if parsed.json else "\n".join(fit.overrides(model)))  # noqa: T201
    return PASS


def _fly(plan: Plan, name: str, parsed: argparse.Namespace, spread: Callable[[Path], Spread] | None = None) -> int:
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


def _inject(parsed: argparse.Namespace) -> int:
    request = InjectRequest(
        parsed.verb,
        links=tuple(getattr(parsed, "links", ())),
        groups=getattr(parsed, "groups", ()),
        loss=getattr(parsed, "loss", 0.0),
        lasts_s=getattr(parsed, "lasts", None),
        in_flight=getattr(parsed, "in_flight", "drop"),
    )
    flown = loading.resolved(parsed.directory)
    try:
        order = request.order(flown)
    except ValueError as error:
        raise ScenarioError(f"{parsed.verb}: {error}") from error
    answer = Access.to(parsed.directory).ask(order)
    if answer.refused:
        raise ScenarioError(f"{parsed.verb}: {answer.refused}")
    show.answer(answer, flown.time.dt)
    return PASS


def _keys(parsed: argparse.Namespace) -> int:
    from netem.wire import authority  # its library takes a while to import

    agents, hosts = range(1, parsed.agents + 1), range(1, (parsed.hosts or 0) + 1)
    names = [COORDINATOR, HUB, WORLD, CENTRE, CONTROL, DRIVER, *map(agent_name, agents), *map(host_name, hosts)]
    made = authority.make(parsed.directory, names, parsed.hub, timedelta(days=parsed.days))
    show.keys(parsed.directory, made)
    return PASS


def _hunt(parsed: argparse.Namespace) -> int:
    return PASS if hunting.hunt_and_report(parsed) else FAIL


def _conformance(parsed: argparse.Namespace) -> int:
    from affinet.cli import conforming  # large swarms and what designs them take a while to import

    return PASS if conforming.judge_and_report(parsed) else FAIL


def _doctor(parsed: argparse.Namespace) -> int:
    return PASS if doctoring.examine(parsed) else FAIL


def _completion(parsed: argparse.Namespace) -> int:
    print(completing.script(parsed.shell, options.parser()), end="")  # noqa: T201
    return PASS


# Of each its exit status, where it is not always 0.
_COMMANDS: Mapping[str, Callable[[argparse.Namespace], int | None]] = {
    "run": _run,
    "check": _check,
    "replay": _replay,
    "watch": watching.watch,
    "render": rendering.render,
    "compare": comparing.compare,
    "report": reporting.report,
    "check-determinism": _check_determinism,
    "hunt": _hunt,
    "study": _study,
    "design": _design,
    "fit": _fit,
    "inject": _inject,
    "keys": _keys,
    "hosts": _hosts,
    "world": _world,
    **dict.fromkeys(("agent", "host", "netem"), machines.hold),
    "conformance": _conformance,
    "list": listing.print_list,
    "schema": schemas.print_schema,
    "new": scaffolding.write,
    "doctor": _doctor,
    "completion": _completion,
    "export": exporting.write,
}
