"""The `affinet` command.

Exit status: 0 pass, 1 fail or vacuous, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import json
import operator
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING

from affinet import compare, files, fit, scenario, show
from affinet import plan as planning
from affinet.checks import Finding
from affinet.inject import Access, NotFlying, Wish
from affinet.plan import Plan, PlanError
from affinet.rerun_command import NoViewer, open_viewer
from affinet.run import Runtime, evidence, fly
from affinet.sections import ScenarioError
from world import history

if TYPE_CHECKING:
    from affinet.checkers import Checker
    from affinet.hunt import Quarry

PASS, FAIL, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    sys.path.append(os.getcwd())  # so that "module:Class" finds what lies beside the scenario
    parsed = _parser().parse_args(arguments)
    try:
        status: int = parsed.command(parsed)
    except (ScenarioError, PlanError, NoViewer, NotFlying, FileExistsError) as error:
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
    replay = commands.add_parser("replay", help="fly again what was flown, and compare")
    determinism = commands.add_parser(
        "check-determinism", help="fly a scenario twice in process and once over processes, and compare every bit"
    )
    for command in (run, check, determinism):
        command.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(scenario.shipped())}")
    replay.add_argument("directory", type=Path, metavar="DIR", help="the run directory")
    replay.add_argument(
        "--verdicts",
        action="store_true",
        help="take every verdict from its journal, whatever the seed; without it the models decide again",
    )
    for command in (run, check, determinism, replay):
        _add_overrides(command)
    for command in (run, replay):
        command.add_argument(
            "--runtime", choices=["processes", "inprocess"], default="processes", help="default: %(default)s"
        )
        command.add_argument("--out", type=Path, metavar="DIR", help="run directory (default: runs/SCENARIO-TIME)")
        command.add_argument("--view", action="store_true", help="watch in a Rerun viewer while it flies")
    _add_hunt(commands)
    _add_study(commands)
    _add_fit(commands)
    run.set_defaults(command=_run)
    check.set_defaults(command=_check)
    replay.set_defaults(command=_replay)
    determinism.set_defaults(command=_check_determinism)
    _add_inject(commands)
    return parser


def _add_overrides(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="override any key, like time.dt=0.02"
    )
    command.add_argument("--estimator", metavar="NAME", help="agents.estimator")
    command.add_argument(
        "--availability", metavar="P", help="network.availability, the probability that a message gets through"
    )
    command.add_argument("--seed", metavar="N", help="seed")
    command.add_argument("--duration", metavar="S", help="time.duration, in simulated seconds")
    command.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def _add_inject(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    inject = commands.add_parser("inject", help="change the air of a run while it flies over processes")
    inject.add_argument("directory", type=Path, metavar="RUN", help="the run directory")
    verbs = inject.add_subparsers(dest="verb", required=True, metavar="VERB")
    cut = verbs.add_parser("cut", help="links that carry nothing: 1-2, 1->2, leaders->followers")
    cut.add_argument("links", nargs="+")
    partition = verbs.add_parser("partition", help="groups between which nothing passes: 1,2,3/4,5,6,7")
    partition.add_argument("groups", type=_groups)
    lose = verbs.add_parser("lose", help="a probability with which messages are lost on top")
    lose.add_argument("loss", type=float, metavar="P")
    lose.add_argument("--links", nargs="+", default=["all"], help="default: all")
    for verb in (cut, partition, lose):
        verb.add_argument(
            "--for", dest="lasts", type=float, metavar="S", help="simulated seconds (default: until healed)"
        )
    for verb in (cut, partition):
        verb.add_argument(
            "--in-flight", choices=["drop", "deliver", "hold"], default="drop", help="default: %(default)s"
        )
    verbs.add_parser("heal", help="end what was injected; what the scenario scripts stays")
    verbs.add_parser("show", help="what is imposed now")
    inject.set_defaults(command=_inject)


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number, at least 1")
    return int(text)


def _add_hunt(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hunt = commands.add_parser(
        "hunt",
        help="look for the smallest fault that breaks an invariant",
        description="Draw schedules of faults, fly them in process, and shrink the first that breaks an invariant; "
        "the smallest is written as a scenario and confirmed over processes. Exit status 1 when one was found.",
    )
    hunt.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(scenario.shipped())}")
    _add_overrides(hunt)
    hunt.add_argument(
        "--invariant",
        required=True,
        action="append",
        metavar="CHECKER",
        help="what must not fail, like 'bounded(5)' or 'recovers(0.1, within=5) & collision_free(0.2)'",
    )
    hunt.add_argument(
        "--budget", type=_count, default=100, metavar="N", help="schedules to draw (default: %(default)s)"
    )
    hunt.add_argument(
        "--verbs", type=lambda text: text.split(","), metavar="VERB,...", help="to draw from (default: all)"
    )
    hunt.add_argument(
        "--out", type=Path, metavar="FILE", help="the smallest, as a scenario (default: hunted-SCENARIO.toml)"
    )
    hunt.set_defaults(command=_hunt)


def _add_study(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    study = commands.add_parser(
        "study",
        help="fly a scenario over a grid of settings and many seeds; a figure, and a verdict on every claim",
        description="Exit status 0 whatever the verdicts on the claims: that a claim does not hold is a finding.",
    )
    study.add_argument("study", help=f"a TOML file, or one of: {', '.join(files.shipped('studies'))}")
    study.add_argument("--quick", action="store_true", help="a coarse version, in a minute")
    study.add_argument("--out", type=Path, metavar="DIR", help="default: studies/NAME")
    study.set_defaults(command=_study)


def _add_fit(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    fitting = commands.add_parser(
        "fit", help="an autoregressive model of the inputs of a run, for filters that predict them"
    )
    fitting.add_argument("directory", type=Path, metavar="RUN", help="the run directory")
    fitting.add_argument(
        "--order", type=_count, default=1, metavar="P", help="ticks it takes in (default: %(default)s)"
    )
    fitting.add_argument("--json", action="store_true", help="print one JSON object")
    fitting.set_defaults(command=_fit)


def _groups(text: str) -> tuple[tuple[int, ...], ...]:
    try:
        return tuple(tuple(int(agent) for agent in group.split(",")) for group in text.split("/"))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: write groups of agents as 1,2,3/4,5,6,7") from error


def _overrides(parsed: argparse.Namespace) -> list[str]:
    options = {
        "agents.estimator": parsed.estimator,
        "network.availability": parsed.availability,
        "seed": parsed.seed,
        "time.duration": parsed.duration,
    }
    return [*parsed.set, *(f"{key}={value}" for key, value in options.items() if value is not None)]


def _check(parsed: argparse.Namespace) -> int:
    try:
        findings: Sequence[Finding] = planning.make(scenario.load(parsed.scenario, _overrides(parsed))).findings
    except PlanError as error:
        findings = error.findings
    flies = not any(finding.fatal for finding in findings)
    if parsed.json:
        report = [{"check": f.check, "level": f.level, "says": f.says} for f in findings]
        print(json.dumps({"flies": flies, "findings": report}))  # noqa: T201
    else:
        show.findings(parsed.scenario, findings, flies=flies)
    return PASS if flies else BAD_INPUT


def _run(parsed: argparse.Namespace) -> int:
    plan = planning.make(scenario.load(parsed.scenario, _overrides(parsed)))
    return _fly(plan, Path(parsed.scenario).stem, parsed)


def _replay(parsed: argparse.Namespace) -> int:
    overrides = _overrides(parsed)
    from netem.journal import JournalError  # pyarrow takes a while to import

    plan = planning.again(parsed.directory, overrides, verdicts=parsed.verdicts)
    try:
        status = _fly(plan, "replay", parsed)
    except JournalError as error:
        raise ScenarioError(f"{parsed.directory}: {error}") from error
    flown, again = parsed.directory / history.FILE, parsed.out / history.FILE
    if overrides or not flown.exists() or not again.exists():
        return status  # it was to be another run, or one of the two left nothing to compare
    links, channels = plan.world.links, plan.channels
    difference = compare.first_difference(history.load(flown), history.load(again), links, channels)
    print(difference or f"the same bits as {parsed.directory}", file=sys.stderr)  # noqa: T201
    return status if difference is None else FAIL


def _check_determinism(parsed: argparse.Namespace) -> int:
    plan = planning.make(scenario.load(parsed.scenario, _overrides(parsed)))
    runs: list[Runtime] = ["inprocess", "inprocess", "processes"]
    with tempfile.TemporaryDirectory(prefix="affinet-") as folder:
        flown = []
        for number, runtime in enumerate(runs):
            with show.Progress(plan, runtime, Path(folder) / str(number)) as watch:
                done = fly(plan, runtime, Path(folder) / str(number), watch.see)
            if done.digest is None:
                print(f"{runtime}: {'; '.join(done.reasons)}", file=sys.stderr)  # noqa: T201
                return FAIL
            flown.append(history.load(Path(folder) / str(number) / history.FILE))
    for runtime, arrays in zip(runs[1:], flown[1:], strict=True):
        if difference := compare.first_difference(flown[0], arrays, plan.world.links, plan.channels):
            print(f"inprocess, then {runtime}: {difference}")  # noqa: T201
            return FAIL
    print(f"twice in process and once over processes: {len(flown[0]['error'])} ticks, the same bits")  # noqa: T201
    return PASS


def _study(parsed: argparse.Namespace) -> int:
    from affinet import judging, study_report  # pyarrow and matplotlib take a while to import
    from affinet import study as studies

    study = studies.load(parsed.study)
    out = parsed.out or Path("studies") / f"{Path(parsed.study).stem}{'-quick' if parsed.quick else ''}"
    total = len(list(studies.cases(study, quick=parsed.quick)))
    with show.Grid(study.title, total) as grid:
        results = studies.run(study, quick=parsed.quick, watch=grid.see)
    verdicts = judging.judge(study, results)
    study_report.save(out, study, results, verdicts)
    show.claims(study, verdicts, out)
    return PASS


def _fit(parsed: argparse.Namespace) -> int:
    model = fit.inputs(parsed.directory, parsed.order)
    print(json.dumps(asdict(model)) if parsed.json else "\n".join(fit.overrides(model)))  # noqa: T201
    return PASS


def _hunt(parsed: argparse.Namespace) -> int:
    from affinet import hunt, invariants  # hypothesis takes a while to import
    from affinet.testing import strategies

    given = scenario.load(parsed.scenario, _overrides(parsed))
    invariant = reduce(operator.and_, map(invariants.parse, parsed.invariant))
    verbs = parsed.verbs or list(strategies.VERBS)
    if strangers := sorted(set(verbs) - set(strategies.VERBS)):
        raise ScenarioError(f"--verbs {','.join(strangers)}: there are {', '.join(strategies.VERBS)}")
    file = parsed.out or Path(f"hunted-{Path(parsed.scenario).stem}.toml")
    if not file.parent.is_dir():
        raise ScenarioError(f"--out {file}: there is no directory {file.parent}")
    with show.Chase(parsed.budget) as chase:
        quarry, coverage = hunt.hunt(
            given, invariant, budget=parsed.budget, verbs=verbs, seed=given.seed, watch=chase.see
        )
    if quarry is not None:
        file.write_text(scenario.to_toml(quarry.scenario))
    show.hunted(quarry, coverage)
    status = PASS if quarry is None else _confirm(quarry, invariant, file)
    if parsed.json:
        found = (
            None if quarry is None else {"scenario": str(file), "finding": str(quarry.finding), "digest": quarry.digest}
        )
        print(json.dumps({"found": found, "tried": asdict(coverage)}))  # noqa: T201
    return status


def _confirm(quarry: Quarry, invariant: Checker, file: Path) -> int:
    plan = planning.make(scenario.load(str(file)))
    out = Path("runs") / f"{file.stem}-{time.strftime('%Y%m%d-%H%M%S')}"
    with show.Progress(plan, file.stem, out) as watch:
        flown = fly(plan, "processes", out, watch.see)
    same = "the same bits" if flown.digest == quarry.digest else "OTHER BITS"
    landed = evidence(plan, flown)
    found = invariant(landed) if landed else "; ".join(flown.reasons)
    print(f"over processes, {same}: {found}\n{file}: affinet run {file}")  # noqa: T201
    return FAIL


def _fly(plan: Plan, name: str, parsed: argparse.Namespace) -> int:
    parsed.out = parsed.out or Path("runs") / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    viewer = open_viewer() if parsed.view else None
    with show.Progress(plan, name, parsed.out) as watch:
        outcome = fly(plan, parsed.runtime, parsed.out, watch.see, viewer)
    if parsed.json:
        print(json.dumps(outcome.to_json(), allow_nan=False))  # noqa: T201
    else:
        show.outcome(outcome, plan)
    return PASS if outcome.verdict == "pass" else FAIL


def _inject(parsed: argparse.Namespace) -> int:
    wish = Wish(
        parsed.verb,
        links=tuple(getattr(parsed, "links", ())),
        groups=getattr(parsed, "groups", ()),
        loss=getattr(parsed, "loss", 0.0),
        lasts_s=getattr(parsed, "lasts", None),
        in_flight=getattr(parsed, "in_flight", "drop"),
    )
    flown = scenario.resolved(parsed.directory)
    try:
        order = wish.order(flown)
    except ValueError as error:
        raise ScenarioError(f"{parsed.verb}: {error}") from error
    answer = Access.to(parsed.directory).ask(order)
    if answer.refused:
        raise ScenarioError(f"{parsed.verb}: {answer.refused}")
    show.answer(answer, flown.time.dt)
    return PASS


if __name__ == "__main__":
    sys.exit(main())
