"""Commands that fly a great many runs to judge something, and that make what they are flown with."""

from __future__ import annotations

import argparse

from affinet.cli.options import values
from affinet.cli.options.scenarios import add_overrides, add_scenario
from affinet.scenario import files

LAYOUTS = ("grid", "random")  # of world.formation.layouts, which is more than a command line needs


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add them."""
    _add_study(commands)
    _add_score(commands)
    _add_hunt(commands)
    _add_conformance(commands)
    _add_design(commands)


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
        type=values.path,
        metavar="DIR",
        help="default: studies/NAME, numbered where that is taken; one that was interrupted there goes on",
    )
    _add_where(study)


def _add_where(command: argparse.ArgumentParser) -> None:
    where = command.add_mutually_exclusive_group()
    where.add_argument(
        "--jobs",
        type=values.count,
        metavar="N",
        help="in so many processes (default: as many as processors; 1: this one)",
    )
    where.add_argument(
        "--dask", metavar="ADDRESS", help="on the workers of the Dask scheduler there, like tcp://host:8786"
    )


def _add_score(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    score = commands.add_parser(
        "score",
        help="what an estimator or a law is worth over a network, against the others, and how sure one may be",
        description="Fly it through tasks and airs beside the others, with the same draws; compare, find where swarms are "
        "lost, and say so in words. Exit status 0 whatever comes out.",
    )
    score.add_argument("name", metavar="NAME", help="an estimator: of those there are, or module:Class of your own")
    score.add_argument("--law", action="store_true", help="NAME is a law")
    score.add_argument(
        "--against",
        type=lambda text: text.split(","),
        default=[],
        metavar="NAME,...",
        help="others to compare with (default: those of the card)",
    )
    score.add_argument(
        "--card",
        default="edges",
        metavar="CARD",
        help=f"tasks and airs: a TOML file, or one of: {', '.join(files.shipped('scorecards'))} (default: %(default)s)",
    )
    score.add_argument("--quick", action="store_true", help="a coarse version, in minutes")
    score.add_argument(
        "--out", type=values.path, metavar="DIR", help="default: scores/NAME; what has flown there does not fly again"
    )
    _add_where(score)
    score.add_argument("--json", action="store_true", help="print one JSON object as the last line")


def _add_hunt(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    hunt = commands.add_parser(
        "hunt",
        help="look for the smallest fault that breaks an invariant",
        description="Draw schedules of faults, fly them side by side, and shrink the first that breaks an invariant; "
        "the smallest is written as a scenario and confirmed over processes. Exit status 1 when one was found.",
    )
    add_scenario(hunt)
    add_overrides(hunt)
    hunt.add_argument(
        "--invariant",
        required=True,
        action="append",
        metavar="CHECKER",
        help="what must not fail, like 'bounded(5)' or 'recovers(0.1, within=5) & collision_free(0.2)'; each of several "
        "has its own smallest fault",
    )
    hunt.add_argument(
        "--seeds", type=values.seeds, metavar="A-B", help="of the runs, to draw from (default: that of the scenario)"
    )
    hunt.add_argument(
        "--sweep",
        action="append",
        default=[],
        metavar="KEY=V,V,...",
        help="settings to draw from; several combine",
    )
    hunt.add_argument("--budget", type=values.count, metavar="N", help="schedules to draw (default: 100)")
    hunt.add_argument(
        "--verbs", type=lambda text: text.split(","), metavar="VERB,...", help="to draw from (default: all)"
    )
    hunt.add_argument(
        "--out",
        type=values.scenario_file,
        metavar="FILE",
        help="the smallest, as a scenario (default: hunted-SCENARIO.toml)",
    )
    hunt.add_argument(
        "--every",
        metavar="CLASS",
        help="draw nothing, and fly all of a class of faults, like 'one link, up to 5 s, from any 0.5 s, with cut'; a "
        "certificate where all hold",
    )
    hunt.add_argument(
        "--certificate",
        type=values.path,
        metavar="FILE",
        help="of --every, where nothing breaks (default: certified-SCENARIO.json)",
    )
    hunt.add_argument(
        "--frontier",
        type=values.drawing,
        metavar="FILE",
        help="draw nothing, and cut more and more links for longer and longer: a picture of what breaks",
    )
    hunt.add_argument(
        "--corpus",
        type=values.path,
        metavar="DIR",
        help="a folder: what broke something in earlier hunts, or covered what is rare, flies first; what does now is kept",
    )
    hunt.add_argument(
        "--jobs",
        type=values.count,
        metavar="N",
        help="in so many processes, where it takes long (default: as many as processors; 1: this one)",
    )


def _add_conformance(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    conformance = commands.add_parser(
        "conformance",
        help="whether an agent, in whatever language, speaks as docs/protocol.md says",
        description="Fly one agent by a program of yours, in a score of short flights, and say case by case what it does "
        "not do that it has to. Exit status 1 when there is such a case.",
    )
    conformance.add_argument(
        "program",
        type=values.command_line,
        metavar="COMMAND",
        help="what starts the agent, in quotes: 'python my_agent.py'",
    )
    conformance.add_argument(
        "--estimator", default="none", metavar="NAME", help="whose channels it broadcasts on (default: %(default)s)"
    )
    conformance.add_argument(
        "--patience",
        type=values.positive,
        default=3.0,
        metavar="S",
        help="how long it may do nothing where an answer is due (default: %(default)g)",
    )
    conformance.add_argument("--out", type=values.path, metavar="FILE", help="the report, as JSON")


def _add_design(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    design = commands.add_parser(
        "design",
        help="a large formation: edges, leaders and stress for nodes and a range, as a scenario",
        description="Compose the stress of a formation of its cliques, choose leaders until what is slowest settles in time, "
        "and write a scenario.",
    )
    design.add_argument(
        "nodes", help=f"a file with the coordinates of a node in each line, in metres, or {', '.join(LAYOUTS)}"
    )
    design.add_argument(
        "--range", type=values.positive, required=True, metavar="M", help="of sensing and communication"
    )
    design.add_argument("--agents", type=values.count, metavar="N", help="how many, a metre from each other or so")
    design.add_argument("--dimension", type=int, choices=[2, 3], help="default: 2")
    design.add_argument(
        "--settle",
        type=values.positive,
        default=15.0,
        metavar="S",
        help="to 1/e, under the static law (default: %(default)g)",
    )
    design.add_argument(
        "--seed", type=values.seed, default=1, metavar="N", help="of random nodes (default: %(default)s)"
    )
    design.add_argument(
        "--out", type=values.scenario_file, metavar="FILE", help="the scenario (default: designed-NODES.toml)"
    )
