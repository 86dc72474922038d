"""The command line: which commands there are, and what each can be told."""

from __future__ import annotations

import argparse
from importlib.metadata import version
from pathlib import Path

from affinet.cli import (
    comparing,
    completing,
    doctoring,
    exporting,
    helping,
    listing,
    many_runs,
    rendering,
    reporting,
    scaffolding,
    schemas,
    watching,
)
from affinet.scenario import files, loading
from affinet.scenario.programs import words
from affinet.scenario.units import LARGEST, SMALLEST
from world.formation.layouts import KINDS

_LONGEST_DAYS = 3650  # as long as the authority


def parser() -> argparse.ArgumentParser:
    """Reads a command line; `command` is the word of the command."""
    whole = argparse.ArgumentParser(prog="affinet", description=helping.PURPOSE, epilog=helping.MORE)
    whole.add_argument("--version", action="version", version=f"affinet {version('affinet')}")
    commands = whole.add_subparsers(dest="command", metavar="COMMAND")
    run = commands.add_parser("run", help="fly a scenario", description="Fly a scenario and leave a run directory.")
    check = commands.add_parser("check", help="say whether a scenario can fly, before anything starts")
    replay = commands.add_parser("replay", help="fly again what was flown, and compare")
    determinism = commands.add_parser(
        "check-determinism", help="fly a scenario twice in process and once over processes, and compare every bit"
    )
    for command in (run, check, determinism):
        command.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(loading.shipped())}")
    replay.add_argument("directory", type=_path, metavar="DIR", help="the run directory")
    replay.add_argument(
        "--verdicts",
        action="store_true",
        help="take every verdict from its journal, whatever the seed; without it the models decide again",
    )
    for command in (run, check, determinism, replay):
        _add_overrides(command)
    for command in (run, replay):
        command.add_argument("--runtime", choices=["processes", "inprocess"], help="default: processes")
        _add_output(command)
    many_runs.add_options(run)
    _add_hunt(commands)
    _add_study(commands)
    _add_design(commands)
    _add_fit(commands)
    _add_inject(commands)
    _add_keys(commands)
    _add_coordinators(commands)
    _add_seats(commands)
    _add_conformance(commands)
    for module in (
        watching,
        rendering,
        comparing,
        reporting,
        exporting,
        listing,
        schemas,
        scaffolding,
        doctoring,
        completing,
    ):
        module.add(commands)
    helping.end_with_examples(whole)
    return whole


def _add_overrides(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--set", action="append", default=[], metavar="KEY=VALUE", help="override any key, like time.dt=0.02"
    )
    command.add_argument("--estimator", metavar="NAME", help="agents.estimator")
    command.add_argument("--law", metavar="NAME", help="agents.law")
    command.add_argument(
        "--availability", metavar="P", help="network.availability, the probability that a message gets through"
    )
    command.add_argument("--seed", metavar="N", help="seed")
    command.add_argument("--duration", metavar="S", help="time.duration, in simulated seconds")
    command.add_argument("--dt", metavar="S", help="time.dt, the length of a tick, in simulated seconds")
    command.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def _add_output(command: argparse.ArgumentParser) -> None:
    command.add_argument("--out", type=_path, metavar="DIR", help="run directory (default: runs/SCENARIO-TIME)")
    watching.add_live(command)


def _add_coordinators(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hosts = commands.add_parser(
        "hosts", help="fly a scenario over several machines, whose commands are started from here"
    )
    hosts.add_argument(
        "file", type=_path, metavar="HOSTS", help="which machines, and who is on which: docs/machines.md"
    )
    hosts.add_argument("scenario", nargs="?", help="in place of the one in the file")
    world = commands.add_parser("world", help="fly a scenario over several machines, whose commands are typed there")
    world.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(loading.shipped())}")
    world.add_argument("--listen", required=True, metavar="tls/ADDRESS:PORT", help="where they find this machine")
    world.add_argument("--keys", required=True, metavar="DIR", help="made by `affinet keys`")
    world.add_argument(
        "--gone-after",
        type=_positive,
        default=20.0,
        metavar="S",
        help="give up a silent machine (default: %(default)s)",
    )
    for command in (hosts, world):
        command.set_defaults(runtime="processes")
        _add_overrides(command)
        _add_output(command)


def _add_seats(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    agent = commands.add_parser("agent", help="hold agents of a run over several machines on this one")
    agent.add_argument("numbers", nargs="+", type=_count, metavar="N", help="which")
    host = commands.add_parser("host", help="hold processes that carry several agents (agents.per_process)")
    host.add_argument("numbers", nargs="+", type=_count, metavar="N", help="which")
    netem = commands.add_parser("netem", help="hold the medium of a run over several machines on this one")
    netem.add_argument("--listen", required=True, metavar="tls/ADDRESS:PORT", help="where all others find it")
    for command in (agent, host, netem):
        command.add_argument(
            "--connect", required=True, metavar="tls/ADDRESS:PORT", help="where `affinet world` listens"
        )
        command.add_argument("--keys", required=True, metavar="DIR", help="the certificates of this machine")
        command.add_argument("--scenario", help="refuse to fly any other; without it what the others fly is taken")
        command.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="overrides of that")


def _add_inject(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    inject = commands.add_parser("inject", help="change the air of a run while it flies over processes")
    inject.add_argument("directory", type=_path, metavar="RUN", help="the run directory")
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


def _add_conformance(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    conformance = commands.add_parser(
        "conformance",
        help="whether an agent, in whatever language, speaks as docs/protocol.md says",
        description="Fly one agent by a program of yours, in a score of short flights, and say case by case what it does "
        "not do that it has to. Exit status 1 when there is such a case.",
    )
    conformance.add_argument(
        "program", type=_command_line, metavar="COMMAND", help="what starts the agent, in quotes: 'python my_agent.py'"
    )
    conformance.add_argument(
        "--estimator", default="none", metavar="NAME", help="whose channels it broadcasts on (default: %(default)s)"
    )
    conformance.add_argument(
        "--patience",
        type=_positive,
        default=3.0,
        metavar="S",
        help="how long it may do nothing where an answer is due (default: %(default)g)",
    )
    conformance.add_argument("--out", type=_path, metavar="FILE", help="the report, as JSON")


def _command_line(text: str) -> list[str]:
    try:
        return words(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number, at least 1")
    return int(text)


def _days(text: str) -> int:
    if (days := _count(text)) > _LONGEST_DAYS:
        raise argparse.ArgumentTypeError(f"{text}: give at most {_LONGEST_DAYS}")
    return days


def _seed(text: str) -> int:
    if not text.isdecimal() or int(text) >= 2**64:
        raise argparse.ArgumentTypeError(f"{text!r}: give a whole number below 2^64")
    return int(text)


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not SMALLEST <= value <= LARGEST:
        raise argparse.ArgumentTypeError(f"{text!r}: give a number from {SMALLEST:g} to {LARGEST:g}")
    return value


def _path(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("it is empty: name a directory")
    return Path(text)


def _scenario_file(text: str) -> Path:
    if not text.endswith(".toml"):
        raise argparse.ArgumentTypeError(f"a scenario is a TOML file: call it {text}.toml")
    return Path(text)


def _add_hunt(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hunt = commands.add_parser(
        "hunt",
        help="look for the smallest fault that breaks an invariant",
        description="Draw schedules of faults, fly them in process, and shrink the first that breaks an invariant; "
        "the smallest is written as a scenario and confirmed over processes. Exit status 1 when one was found.",
    )
    hunt.add_argument("scenario", help=f"a TOML file, or one of: {', '.join(loading.shipped())}")
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
        "--out", type=_scenario_file, metavar="FILE", help="the smallest, as a scenario (default: hunted-SCENARIO.toml)"
    )


def _add_study(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    study = commands.add_parser(
        "study",
        help="fly a scenario over a grid of settings and many seeds; a figure, and a verdict on every claim",
        description="Exit status 0 whatever the verdicts on the claims: that a claim does not hold is a finding.",
    )
    study.add_argument("study", help=f"a TOML file, or one of: {', '.join(files.shipped('studies'))}")
    study.add_argument("--quick", action="store_true", help="a coarse version, of fewer runs")
    study.add_argument(
        "--out",
        type=_path,
        metavar="DIR",
        help="default: studies/NAME, numbered where that is taken; one that was interrupted there goes on",
    )
    where = study.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs", type=_count, metavar="N", help="in so many processes (default: as many as processors; 1: this one)"
    )
    where.add_argument(
        "--dask", metavar="ADDRESS", help="on the workers of the Dask scheduler there, like tcp://host:8786"
    )


def _add_design(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    design = commands.add_parser(
        "design",
        help="a large formation: edges, leaders and stress for nodes and a range, as a scenario",
        description="Compose the stress of a formation of its cliques, choose leaders until what is slowest settles in time, "
        "and write a scenario.",
    )
    design.add_argument(
        "nodes", help=f"a file with the coordinates of a node in each line, in metres, or {', '.join(KINDS)}"
    )
    design.add_argument("--range", type=_positive, required=True, metavar="M", help="of sensing and communication")
    design.add_argument("--agents", type=_count, metavar="N", help="how many, a metre from each other or so")
    design.add_argument("--dimension", type=int, choices=[2, 3], help="default: 2")
    design.add_argument(
        "--settle",
        type=_positive,
        default=15.0,
        metavar="S",
        help="to 1/e, under the static law (default: %(default)g)",
    )
    design.add_argument("--seed", type=_seed, default=1, metavar="N", help="of random nodes (default: %(default)s)")
    design.add_argument(
        "--out", type=_scenario_file, metavar="FILE", help="the scenario (default: designed-NODES.toml)"
    )


def _add_fit(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    fitting = commands.add_parser(
        "fit", help="an autoregressive model of the inputs of a run, for filters that predict them"
    )
    fitting.add_argument("directory", type=_path, metavar="RUN", help="the run directory")
    fitting.add_argument(
        "--order", type=_count, default=1, metavar="P", help="ticks it takes in (default: %(default)s)"
    )
    fitting.add_argument("--json", action="store_true", help="print one JSON object")


def _add_keys(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    keys = commands.add_parser(
        "keys",
        help="certificates for runs over several machines",
        description="Make an authority, and a certificate and a key for each process of a run. Run again, it makes new "
        "certificates of the same authority for all who have one. docs/trust.md says what goes to which machine.",
    )
    keys.add_argument("directory", type=_path, metavar="DIR", help="where to keep them, for this user alone")
    keys.add_argument("--agents", type=_count, default=10, metavar="N", help="for agents 1 to N (default: %(default)s)")
    keys.add_argument(
        "--hosts", type=_count, metavar="N", help="for N processes that carry several agents (agents.per_process)"
    )
    keys.add_argument(
        "--hub",
        nargs="+",
        default=[],
        metavar="ADDRESS",
        help="host names and IP addresses under which the medium is reached, besides loopback",
    )
    keys.add_argument(
        "--days", type=_days, default=30, metavar="D", help="how long they are valid (default: %(default)s)"
    )


def _groups(text: str) -> tuple[tuple[int, ...], ...]:
    try:
        return tuple(tuple(int(agent) for agent in group.split(",")) for group in text.split("/"))
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: write groups of agents as 1,2,3/4,5,6,7") from error
